//===- SaveForAdjoint.h - Residuals saved for the adjoint -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_SAVEFORADJOINT_H
#define WARP_TRANSFORMS_AUTODIFF_SAVEFORADJOINT_H

#include "MemoryClasses.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// Has every load and atomic of the kernel whose value the adjoint has an
/// argument for store it; returns whether there is any.
bool saveForAdjoint(mlir::func::FuncOp kernel, mlir::func::FuncOp adjoint,
                    const MemoryClasses &memory);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_SAVEFORADJOINT_H
