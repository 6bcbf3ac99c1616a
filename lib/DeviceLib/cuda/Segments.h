//===- Segments.h - Shared parts of the sorts of segments -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CUDA_SEGMENTS_H
#define WARP_DEVICELIB_CUDA_SEGMENTS_H

#include "SortKeys.h"

namespace {

/// The order of keys, which is found out at run time here: there is much code
/// that does not depend on it.
struct Order {
  uint32_t flip;
  bool isFloat;
  uint32_t ordered(uint32_t bits) const {
    return isFloat ? Floats<uint32_t>{flip}.ordered(bits) : bits ^ flip;
  }
  uint32_t last() const { return ~flip; }
};

/// The parameters of all kernels of a sort.
struct Segments {
  uint32_t *keys, *values;
  int64_t count;
  const int32_t *begins, *ends;
};

/// Numbers of segments, after how many there are.
struct List {
  uint32_t *size, *items;

  void add(uint32_t item) const {
    items[__scoped_atomic_fetch_add(size, 1u, __ATOMIC_RELAXED,
                                    __MEMORY_SCOPE_DEVICE)] = item;
  }
};

} // namespace

#endif // WARP_DEVICELIB_CUDA_SEGMENTS_H
