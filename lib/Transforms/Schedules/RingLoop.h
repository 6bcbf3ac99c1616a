//===- RingLoop.h - Loops for a ring reduction ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_RINGLOOP_H
#define WARP_LIB_TRANSFORMS_RINGLOOP_H

#include "Analysis/ThreadVariance.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {

/// A loop in which all threads update the same element in the same iteration,
/// if its iterations may run in any order: one for a ring reduction.
class RingLoop {
public:
  /// `anyOrder`: all sums of floats may be reassociated.
  RingLoop(mlir::scf::ForOp loop, bool anyOrder)
      : loop(loop), anyOrder(anyOrder) {}

  /// True if it is one; fills in the rest.
  bool qualifies(const ThreadVariance &variance);
  llvm::SmallVector<AtomicComponentsOp> updates;
  /// Values that lanes must agree on for bounds and indices to be the same.
  llvm::SetVector<mlir::Value> compared;

private:
  bool isOrderOpen();
  bool collectUpdates(const ThreadVariance &variance);

  mlir::scf::ForOp loop;
  bool anyOrder;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_RINGLOOP_H
