//===- TensorMaps.h - Arrays as the copy engine sees them -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The copy engine of GPUs from compute capability 9.0 on takes boxes of an
// array to the memory of a block. It knows an array by a map of 128 bytes that
// the driver makes (CUDA driver API, tensor map object management). Kernels
// find theirs in the parameter block, behind everything else.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TENSORMAPS_H
#define WARP_TENSORMAPS_H

#include <cstddef>
#include <cstdint>

namespace warp {

inline constexpr size_t tensorMapBytes = 128, tensorMapAlignment = 64;

/// A map that a launch needs.
struct TensorMap {
  /// Where the descriptor of the array, of two dimensions, lies in the
  /// parameter block, and where the map is to lie.
  int64_t descriptor = 0, place = 0;
  /// Elements of a box, and bytes of one: 2 or 4.
  int64_t rows = 0, columns = 0, elementBytes = 2;
  /// Bytes over which rows are swizzled: as long as rows of a box are, 32, 64
  /// or 128, or 0 for not at all.
  int64_t swizzle = 0;
};

} // namespace warp

#endif // WARP_TENSORMAPS_H
