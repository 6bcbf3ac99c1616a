//===- UniformValues.h - What the threads of a warp share -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_UNIFORMVALUES_H
#define WARP_LIB_TRANSFORMS_UNIFORMVALUES_H

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Builders.h"

#include "llvm/ADT/SetVector.h"

namespace warp {

/// Whether a value in the entry of a GPU launch is the same for all threads of
/// a warp that agree on the values in `compared`, to which this adds: counters
/// of loops and thread indices of the axes y and z.
bool isUniform(mlir::Value value, mlir::LLVM::LLVMFuncOp entry,
               llvm::SetVector<mlir::Value> &compared);

/// Whether all lanes of the warp come to the insertion point together, and
/// agree on these values.
mlir::Value isWarpTogether(mlir::OpBuilder &b, mlir::Location loc,
                           llvm::ArrayRef<mlir::Value> compared);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_UNIFORMVALUES_H
