//===- LowerScratch.cpp - Thread-private scratch memory -------------------===//
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
#include "mlir/IR/TypeUtilities.h"

#include <numeric>

using namespace mlir;
using namespace warp;

/// The type of a slot in memory: a boolean takes a byte.
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

/// Addresses of a slot for each lane.
mlir::Value ArrayLowering::laneSlots(mlir::Value scratch, mlir::Value index) {
  auto type = cast<VectorType>(
      cast<ScratchType>(scratch.getType()).getElementType());
  int64_t lanes = type.getNumElements();
  auto wide = VectorType::get(lanes, i64);
  if (getElementTypeOrSelf(index).isIndex())
    index = arith::IndexCastOp::create(b, loc, wide, index);
  else if (index.getType() != wide)
    index = arith::ExtSIOp::create(b, loc, wide, index);
  SmallVector<int64_t> numbers(lanes);
  std::iota(numbers.begin(), numbers.end(), 0);
  auto constants = [&](ArrayRef<int64_t> values) {
    return arith::ConstantOp::create(b, loc,
                                     DenseElementsAttr::get(wide, values));
  };
  index = arith::MulIOp::create(b, loc, index, constants(lanes));
  index = arith::AddIOp::create(b, loc, index, constants(numbers));
  mlir::Type element =
      cast<VectorType>(storedType(type)).getElementType();
  return LLVM::GEPOp::create(b, loc, LLVM::getVectorType(pointer, lanes),
                             element, scratches.lookup(scratch),
                             ArrayRef<LLVM::GEPArg>(index));
}

static mlir::Value allLanes(OpBuilder &b, Location loc, int64_t lanes) {
  auto mask = VectorType::get(lanes, b.getI1Type());
  return arith::ConstantOp::create(
      b, loc, DenseElementsAttr::get(mask, b.getBoolAttr(true)));
}

void ArrayLowering::lowerScratch(ScratchLoadOp op) {
  mlir::Type type = op.getType();
  mlir::Value value;
  if (auto lanes = dyn_cast<VectorType>(op.getIndex().getType())) {
    auto stored = cast<VectorType>(storedType(type));
    value = LLVM::masked_gather::create(
        b, loc, stored, laneSlots(op.getScratch(), op.getIndex()),
        allLanes(b, loc, lanes.getNumElements()), ValueRange(),
        b.getI32IntegerAttr(getByteSize(stored.getElementType())));
  } else {
    value = LLVM::LoadOp::create(b, loc, storedType(type),
                                 slot(op.getScratch(), op.getIndex()));
  }
  if (value.getType() != type)
    value = arith::TruncIOp::create(b, loc, type, value);
  op.getResult().replaceAllUsesWith(value);
}

void ArrayLowering::lowerScratch(ScratchStoreOp op) {
  mlir::Value value = op.getValue();
  mlir::Type stored = storedType(value.getType());
  if (value.getType() != stored)
    value = arith::ExtUIOp::create(b, loc, stored, value);
  if (auto lanes = dyn_cast<VectorType>(op.getIndex().getType()))
    LLVM::masked_scatter::create(
        b, loc, value, laneSlots(op.getScratch(), op.getIndex()),
        allLanes(b, loc, lanes.getNumElements()),
        b.getI32IntegerAttr(
            getByteSize(cast<VectorType>(stored).getElementType())));
  else
    LLVM::StoreOp::create(b, loc, value,
                          slot(op.getScratch(), op.getIndex()));
}
