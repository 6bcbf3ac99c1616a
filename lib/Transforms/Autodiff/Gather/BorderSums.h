//===- BorderSums.h - Clamped stencil updates, split at borders -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_BORDERSUMS_H
#define WARP_TRANSFORMS_AUTODIFF_BORDERSUMS_H

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

#include "llvm/ADT/DenseSet.h"

namespace warp::autodiff {

/// Splits the additions of an adjoint whose indices are clamped to bounds:
/// where a thread is between them, the index is the thread's own plus a
/// constant. The additions of the other threads are the result.
llvm::DenseSet<mlir::Operation *> splitBorders(mlir::func::FuncOp adjoint);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_BORDERSUMS_H
