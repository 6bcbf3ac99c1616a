//===- RulesOfComposites.h - Derivative rules of composites -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_RULESOFCOMPOSITES_H
#define WARP_TRANSFORMS_AUTODIFF_RULESOFCOMPOSITES_H

#include "Rules.h"

namespace warp::autodiff {

/// True if the operation builds a composite, takes one apart, converts a float
/// to a float or chooses between two values, outside of the registry.
bool isCompositeOp(mlir::Operation *op);

void pullbackComposite(RuleContext &context, mlir::Operation *op,
                       mlir::ValueRange operands, mlir::Value cotangent,
                       llvm::ArrayRef<bool> wanted,
                       llvm::MutableArrayRef<mlir::Value> adjoints);

mlir::Value pushforwardComposite(RuleContext &context, mlir::Operation *op,
                                 mlir::ValueRange operands,
                                 llvm::ArrayRef<mlir::Value> tangents);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_RULESOFCOMPOSITES_H
