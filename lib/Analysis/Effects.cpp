//===- Effects.cpp - Side effects of operations ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Analysis/Effects.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

using namespace mlir;

bool warp::isPlainRead(Operation *op) {
  auto access = dyn_cast<AccessOp>(op);
  return access && !access.mayWrite();
}

bool warp::isSum(Operation *op) {
  auto access = dyn_cast<AccessOp>(op);
  return access && access.getCombination() == AtomicKind::add &&
         op->use_empty();
}

bool warp::isObservable(Operation *op) {
  auto access = dyn_cast<AccessOp>(op);
  return access ? access.mayWrite() : isa<PrintfOp, AssertOp>(op);
}

bool warp::isConversion(Operation *op) {
  auto call = dyn_cast<LLVM::CallIntrinsicOp>(op);
  return call && call.getIntrin().starts_with("llvm.fpto");
}
