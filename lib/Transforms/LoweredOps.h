//===- LoweredOps.h - Operations of later phases ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LOWEREDOPS_H
#define WARP_LIB_TRANSFORMS_LOWEREDOPS_H

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {

/// True if an operation is what lowering makes, and no front end builds.
inline bool isLowered(mlir::Operation *op) {
  if (auto tid = mlir::dyn_cast<TidOp>(op))
    return tid.getResult(0).getType().isSignlessInteger();
  return mlir::isa<LoadComponentsOp, StoreComponentsOp, AtomicComponentsOp,
                   AddressOp, GroupOp, ThreadsOp, OnceOp, YieldOp, AnyOp,
                   LaneNumbersOp, BroadcastOp, CombineLanesOp, EachLaneOp,
                   LoadLanesOp, StoreLanesOp, UpdateLanesOp, ParameterOp,
                   LaunchReversedOp>(op) ||
         !mlir::isa_and_nonnull<WarpDialect, mlir::scf::SCFDialect,
                                mlir::func::FuncDialect,
                                mlir::arith::ArithDialect>(op->getDialect());
}

/// Fails at the first operation of a kernel that is lowered, which those who
/// `what` do not know.
inline llvm::LogicalResult refuseLowered(mlir::Operation *kernel,
                                         llvm::StringRef what) {
  auto result = kernel->walk([&](mlir::Operation *op) {
    if (op == kernel || !isLowered(op))
      return mlir::WalkResult::advance();
    op->emitError("expects a kernel of phase 'warp' to ")
        << what << ", which operation '" << op->getName() << "' is not part of";
    return mlir::WalkResult::interrupt();
  });
  return mlir::failure(result.wasInterrupted());
}

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LOWEREDOPS_H
