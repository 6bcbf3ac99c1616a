//===- Allocation.h - Rounding and errors of allocators ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_ALLOCATION_H
#define WARP_LIB_RUNTIME_ALLOCATION_H

#include "Device.h"

namespace warp {

inline size_t roundUp(size_t bytes, size_t unit) {
  return (bytes + unit - 1) / unit * unit;
}

/// Throws an error that names request, free memory and the largest users.
[[noreturn]] void raiseOutOfMemory(Device &device, size_t bytes);

} // namespace warp

#endif // WARP_LIB_RUNTIME_ALLOCATION_H
