//===- Exports.h - Functions of the device library for kernels --*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Before the names of functions that include/WarpDialect/Functions.td has.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_EXPORTS_H
#define WARP_DEVICELIB_GEOMETRY_EXPORTS_H

#include "DeviceLib/Prototypes.h"

#define WARP_GEOMETRY                                                          \
  extern "C" __attribute__((used, noinline, visibility("default"))) void

/// Inlined into kernels on GPUs, where results of a call would go
/// through memory.
#ifdef WARP_GPU
#define WARP_GEOMETRY_PART                                                     \
  extern "C" __attribute__((used, always_inline, visibility("default"))) void
#else
#define WARP_GEOMETRY_PART WARP_GEOMETRY
#endif

/// Inlined into a GPU kernel that calls it once: a call would take
/// registers as long as it lasts, and arguments are often constants.
#ifdef WARP_GPU
#define WARP_GEOMETRY_ONCE                                                     \
  extern "C" __attribute__((used, visibility("default"))) void
#else
#define WARP_GEOMETRY_ONCE WARP_GEOMETRY
#endif

#endif // WARP_DEVICELIB_GEOMETRY_EXPORTS_H
