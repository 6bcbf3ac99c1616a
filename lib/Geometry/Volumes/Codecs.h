//===- Codecs.h - Compression codecs of grid files --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_VOLUMES_CODECS_H
#define WARP_LIB_GEOMETRY_VOLUMES_CODECS_H

#include "warp/VoxelGrids.h"

namespace warp::geometry {

/// Bytes of a file that are being read.
class Source {
public:
  Source(const uint8_t *bytes, size_t size) : bytes(bytes), size(size) {}

  /// The next bytes; throws if there are fewer.
  const uint8_t *take(uint64_t count);
  void skip(uint64_t count) { take(count); }

private:
  const uint8_t *bytes;
  size_t size, at = 0;
};

/// The next grid of a file, of `size` bytes; `stored` says how many the file
/// has for it where it is not packed.
GridBytes unpackGrid(Source &source, uint64_t size, uint64_t stored,
                     GridCodec codec);

/// A file's record of a grid.
std::vector<uint8_t> packGrid(const uint8_t *grid, size_t size,
                              GridCodec codec);

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_VOLUMES_CODECS_H
