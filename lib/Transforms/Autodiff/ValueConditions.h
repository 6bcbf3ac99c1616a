//===- ValueConditions.h - Assertions about values in use -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_VALUECONDITIONS_H
#define WARP_TRANSFORMS_AUTODIFF_VALUECONDITIONS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// The same value, which is right under a condition alone. If something uses
/// it once dead code is gone, that becomes an assertion of every launch.
mlir::Value expect(mlir::OpBuilder &builder, mlir::Value condition,
                   mlir::Value value, llvm::StringRef message);

/// Asserts the conditions of the values that are left.
void assertConditions(mlir::func::FuncOp function);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_VALUECONDITIONS_H
