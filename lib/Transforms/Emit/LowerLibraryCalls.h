//===- LowerLibraryCalls.h - Calls of the device library --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_LOWERLIBRARYCALLS_H
#define WARP_TRANSFORMS_LOWERLIBRARYCALLS_H

#include "mlir/IR/BuiltinOps.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

namespace attr {
/// Registers that a thread of a GPU may use, on an entry.
constexpr llvm::StringLiteral mostRegisters = "warp.most_registers";
} // namespace attr

/// Makes every `warp.library_call` of an entry a call of the function that
/// bitcode defines, or the memory of the thread that it stands for.
llvm::LogicalResult lowerLibraryCalls(mlir::ModuleOp module,
                                      mlir::FunctionOpInterface entry);

} // namespace warp

#endif // WARP_TRANSFORMS_LOWERLIBRARYCALLS_H
