//===- AdjointSums.h - Fewer sums in an adjoint --------------- -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_ADJOINTSUMS_H
#define WARP_TRANSFORMS_AUTODIFF_ADJOINTSUMS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// Consecutive sums into one element become one.
void mergeSums(mlir::Block &block);

/// Adding to what has just been set to zero is storing, and nothing at all if
/// it is what was there before.
void storeSums(mlir::func::FuncOp adjoint);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_ADJOINTSUMS_H
