//===- LowerScratch.cpp - Memory of one thread ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Scratch memory lies on the stack, in the first block of the entry: on the
// CPU all threads of a range use the same piece one after the other. Accesses
// are not marked as those of a parallel loop, since there they do depend on
// each other.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp;

/// What a slot holds in memory: a boolean takes a byte.
static mlir::Type storedType(mlir::Type element) {
  mlir::Type byte = IntegerType::get(element.getContext(), 8);
  if (auto lanes = dyn_cast<VectorType>(element))
    return isBool(lanes.getElementType())
               ? VectorType::get(lanes.getNumElements(), byte)
               : element;
  return isBool(element) ? byte : element;
}

void ArrayLowering::lowerScratch(ScratchOp op) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(&entry.getBody().front());
  auto type = cast<ScratchType>(op.getType());
  mlir::Value one = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
  auto memory = LLVM::LLVMArrayType::get(storedType(type.getElementType()),
                                         type.getSlots());
  scratches[op] = LLVM::AllocaOp::create(b, loc, pointer, memory, one);
}

mlir::Value ArrayLowering::slot(mlir::Value scratch, mlir::Value index) {
  auto type = cast<ScratchType>(scratch.getType());
  return LLVM::GEPOp::create(b, loc, pointer,
                             storedType(type.getElementType()),
                             scratches.lookup(scratch), widen(index, i64),
                             LLVM::GEPNoWrapFlags::inbounds);
}

void ArrayLowering::lowerScratch(ScratchLoadOp op) {
  mlir::Type type = op.getType();
  mlir::Value value = LLVM::LoadOp::create(
      b, loc, storedType(type), slot(op.getScratch(), op.getIndex()));
  if (value.getType() != type)
    value = arith::TruncIOp::create(b, loc, type, value);
  op.getResult().replaceAllUsesWith(value);
}

void ArrayLowering::lowerScratch(ScratchStoreOp op) {
  mlir::Value value = op.getValue();
  mlir::Type stored = storedType(value.getType());
  if (value.getType() != stored)
    value = arith::ExtUIOp::create(b, loc, stored, value);
  LLVM::StoreOp::create(b, loc, value, slot(op.getScratch(), op.getIndex()));
}
