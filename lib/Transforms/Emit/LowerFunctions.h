//===- LowerFunctions.h - Lowering of out-of-line functions -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LOWERFUNCTIONS_H
#define WARP_LIB_TRANSFORMS_LOWERFUNCTIONS_H

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/BuiltinOps.h"
#include "llvm/ADT/STLFunctionalExtras.h"

namespace warp {

/// Makes internal functions of the target from those that stay, with the facts
/// of the launch that the entry has. Their bodies, and calls, are as before.
llvm::SmallVector<mlir::LLVM::LLVMFuncOp>
emitFunctions(mlir::LLVM::LLVMFuncOp entry,
              llvm::function_ref<mlir::Type(mlir::Type)> convert);

/// Calls and returns of a function whose values have LLVM's types.
void lowerCalls(mlir::LLVM::LLVMFuncOp function);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LOWERFUNCTIONS_H
