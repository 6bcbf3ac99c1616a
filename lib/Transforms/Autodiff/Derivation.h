//===- Derivation.h - Derivatives on request of passes ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_DERIVATION_H
#define WARP_TRANSFORMS_AUTODIFF_DERIVATION_H

#include "warp/Autodiff.h"

#include "mlir/IR/BuiltinOps.h"

namespace warp::autodiff {

/// From a kernel with the functions that it calls to its derivative. Functions
/// that have a derivative of their own must be kept as calls.
using Derive = mlir::LogicalResult (*)(mlir::ModuleOp module,
                                       const AutodiffOptions &options);

/// Has `derive` use a pipeline: which passes that are is the compiler's to say,
/// but one of them, warp-resolve-derivatives, needs derivatives itself.
void setDerive(Derive pipeline);
mlir::LogicalResult derive(mlir::ModuleOp module,
                           const AutodiffOptions &options);

/// Turns the inlining of functions with a derivative of their own off or on.
/// They stay calls until the derivative is built.
void keepCalls(mlir::ModuleOp module, bool keep);

/// Has pullbacks call the mere body of their function: a derivative of its own
/// says nothing about its residuals, which have that of the body.
void callBodies(mlir::ModuleOp module);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_DERIVATION_H
