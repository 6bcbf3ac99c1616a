//===- SpectralProducts.h - U diag(f(s)) V^T of a decomposition -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_SPECTRALPRODUCTS_H
#define WARP_TRANSFORMS_AUTODIFF_SPECTRALPRODUCTS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// On a decomposition whose vectors are used in products that are complete.
constexpr llvm::StringLiteral completeAttrName = "warp.complete";

/// Gives products of a decomposition's vectors and a diagonal the derivative
/// that they have where values repeat. All builtins must have rules.
llvm::LogicalResult completeSpectralProducts(mlir::func::FuncOp function);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_SPECTRALPRODUCTS_H
