//===- RingLoop.h - Loops whose sums may travel -----------------*- C++ -*-===//
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
/// if its iterations may run in any order: what warp-rotate-loops is about.
class RingLoop {
public:
  /// Lanes of a warp, and iterations of a tile.
  static constexpr int64_t lanes = 32;

  /// `anyOrder`: all sums of floats may be reassociated.
  RingLoop(mlir::scf::ForOp loop, const ThreadVariance &variance, bool anyOrder)
      : loop(loop), variance(variance), anyOrder(anyOrder) {}

  /// True if it is one; fills in the rest.
  bool qualifies();
  llvm::SmallVector<AtomicComponentsOp> updates;
  /// The values that lanes must agree on for bounds and indices to be the same.
  llvm::SetVector<mlir::Value> compared;

private:
  bool isShort();
  bool isUniform(mlir::Value value);
  bool isOrderOpen();
  bool collectUpdates();

  mlir::scf::ForOp loop;
  const ThreadVariance &variance;
  bool anyOrder;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_RINGLOOP_H
