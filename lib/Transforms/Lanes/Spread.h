//===- Spread.h - Broadcast to all lanes ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_SPREAD_H
#define WARP_LIB_TRANSFORMS_SPREAD_H

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

namespace warp {

/// A vector with the same scalar, or pointer, in all lanes.
inline mlir::Value spread(mlir::OpBuilder &b, mlir::Location loc,
                          mlir::Value value, int64_t lanes) {
  mlir::Type type = mlir::LLVM::getVectorType(value.getType(), lanes);
  mlir::Value none = mlir::LLVM::PoisonOp::create(b, loc, type);
  mlir::Value first =
      mlir::arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(0));
  mlir::Value one =
      mlir::LLVM::InsertElementOp::create(b, loc, none, value, first);
  return mlir::LLVM::ShuffleVectorOp::create(
      b, loc, one, none, llvm::SmallVector<int32_t>(lanes, 0));
}

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_SPREAD_H
