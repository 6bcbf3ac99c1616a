//===- TensorMaps.h - Tensor maps: arrays that TMA loads --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The tensor memory accelerator (TMA) of GPUs from compute capability 9.0 on
// loads boxes of an array into shared memory. A tensor map of 128 bytes, which
// the driver makes (CUDA driver API, tensor map object management), describes
// the array. Tensor maps lie at the end of the parameter block.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TENSORMAPS_H
#define WARP_TENSORMAPS_H

#include <cstddef>
#include <cstdint>

namespace warp {

inline constexpr size_t tensorMapBytes = 128, tensorMapAlignment = 64;

/// A tensor map that a launch needs.
struct TensorMap {
  /// The place of the descriptor of the array, of two dimensions, in the
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
