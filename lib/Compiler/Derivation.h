//===- Derivation.h - The passes that make a derivative ---------*- C++ -*-===//

#ifndef WARP_LIB_COMPILER_DERIVATION_H
#define WARP_LIB_COMPILER_DERIVATION_H

#include "warp/Autodiff.h"

#include "mlir/IR/BuiltinOps.h"

namespace warp {

/// From a kernel with the functions that it calls to its derivative. Functions
/// that have a derivative of their own must be kept as calls. The caller has
/// the context's lock.
mlir::LogicalResult derive(mlir::ModuleOp module,
                           const AutodiffOptions &options);

/// Turns the inlining of functions with a derivative of their own off or on.
void keepCalls(mlir::ModuleOp module, bool keep);

} // namespace warp

#endif // WARP_LIB_COMPILER_DERIVATION_H
