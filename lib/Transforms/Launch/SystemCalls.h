//===- SystemCalls.h - Factorisations followed by solves --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_SYSTEMCALLS_H
#define WARP_LIB_TRANSFORMS_SYSTEMCALLS_H

#include "WarpDialect/WarpOps.h"

namespace warp {

/// Factors and solves of one matrix per block, one after the other, or what
/// differentiates a factor: one call of the library for all blocks of a batch
/// (lib/DeviceLib/cpu/TileSystems.cpp and TileSystemAdjoints.cpp).
struct SystemCalls {
  /// Steps that the library is asked for.
  enum Step {
    factors = 1,
    isUpper = 2,
    keeps = 4,
    forwards = 8,
    backwards = 16,
    /// By itself: `out` is the cotangent of the factor `in`.
    differentiates = 32
  };

  /// Adds what follows it, if that is about the same matrix and right sides.
  bool append(const SystemCalls &next);
  /// Bytes that the library needs.
  int64_t getScratchBytes() const;

  mlir::Type real;
  int64_t n = 0, columns = 0, steps = 0;
  /// Offsets in the scratch space of the block; -1: none.
  int64_t out = -1, in = -1, sides = -1;
  mlir::Operation *first = nullptr, *last = nullptr;
};

/// The steps of a call of the library for a whole tile, if it is one of those
/// and the matrix is small.
std::optional<SystemCalls> findSystemCall(mlir::Operation *op);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_SYSTEMCALLS_H
