//===- LocalMemory.cpp - Composites in thread-private memory --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LocalMemory.h"

#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using namespace warp;

void LocalMemory::moveAfter(Value value) {
  b.setInsertionPointAfterValue(value);
  loc = value.getLoc();
}

Value LocalMemory::constant(int64_t number) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(number));
}

Value LocalMemory::slot(Stored stored, Value index) {
  return stored.base ? arith::AddIOp::create(b, loc, stored.base, index)
                     : index;
}

Value LocalMemory::get(Stored from, Value index) {
  Type element = cast<ScratchType>(from.memory.getType()).getElementType();
  return ScratchLoadOp::create(b, loc, element, from.memory, slot(from, index));
}

void LocalMemory::put(Value number, Stored to, Value index) {
  ScratchStoreOp::create(b, loc, number, to.memory, slot(to, index));
}

void LocalMemory::repeat(int64_t count, llvm::function_ref<void(Value)> body) {
  Value zero = constant(0), end = constant(count), one = constant(1);
  auto loop = scf::ForOp::create(b, loc, zero, end, one);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  body(loop.getInductionVar());
}

Stored LocalMemory::allocate(Type composite, int64_t count) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(&entry);
  auto type =
      ScratchType::get(b.getContext(), getComponentCount(composite) * count,
                       getElementScalar(composite));
  return {ScratchOp::create(b, loc, type), Value()};
}

Stored LocalMemory::at(Stored all, Type composite, Value slot) {
  slot = CastOp::create(b, loc, b.getI32Type(), slot);
  return {all.memory,
          arith::MulIOp::create(b, loc, slot,
                                constant(getComponentCount(composite)))};
}

void LocalMemory::copy(Type composite, Stored from, Stored to) {
  repeat(getComponentCount(composite),
         [&](Value index) { put(get(from, index), to, index); });
}

Value LocalMemory::extract(Value composite, ArrayRef<int64_t> indices) {
  Type type = b.getIntegerType(32, /*isSigned=*/true);
  SmallVector<Value> numbers;
  for (int64_t index : indices)
    numbers.push_back(
        ConstantOp::create(b, loc, b.getIntegerAttr(type, index)));
  return ExtractOp::create(b, loc, getElementScalar(composite.getType()),
                           composite, numbers);
}

void LocalMemory::fill(Value composite, Stored to) {
  Type element = getElementScalar(composite.getType());
  int64_t count = getComponentCount(composite.getType());
  auto whole = composite.getDefiningOp<ConstructOp>();
  if (whole && whole->getNumOperands() == 0) {
    Value zero = ConstantOp::create(b, loc, b.getZeroAttr(element));
    return repeat(count, [&](Value index) { put(zero, to, index); });
  }
  if (whole && whole->getNumOperands() == 1 &&
      whole->getOperand(0).getType() == element)
    return repeat(count,
                  [&](Value index) { put(whole->getOperand(0), to, index); });
  auto matrix = dyn_cast<MatType>(composite.getType());
  int64_t cols = matrix ? count / matrix.getRows() : count;
  for (int64_t i = 0; i < count; ++i)
    put(matrix ? extract(composite, {i / cols, i % cols})
               : extract(composite, {i}),
        to, constant(i));
}

Value LocalMemory::load(Type composite, Stored from) {
  SmallVector<Value> numbers;
  for (int64_t i = 0; i < getComponentCount(composite); ++i)
    numbers.push_back(get(from, constant(i)));
  return ConstructOp::create(b, loc, composite, numbers);
}

/// A position along an axis, counted from its end if negative; the last if it
/// is out of range.
Value LocalMemory::normalize(Value index, int64_t extent) {
  bool isUnsigned = index.getType().isUnsignedInteger();
  APInt bits;
  if (matchPattern(index, m_ConstantInt(&bits))) {
    int64_t position = isUnsigned ? bits.getZExtValue() : bits.getSExtValue();
    position += position < 0 ? extent : 0;
    return constant(std::clamp<int64_t>(position, 0, extent - 1));
  }
  index = CastOp::create(b, loc, b.getI32Type(), index);
  if (!isUnsigned) {
    Value isNegative = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt,
                                             index, constant(0));
    Value fromEnd = arith::AddIOp::create(b, loc, index, constant(extent));
    index = arith::SelectOp::create(b, loc, isNegative, fromEnd, index);
  }
  return arith::MinUIOp::create(b, loc, index, constant(extent - 1));
}

/// The number of a component, or those of a row.
SmallVector<Value> LocalMemory::slotsOf(Type composite, ValueRange indices) {
  int64_t count = getComponentCount(composite);
  auto matrix = dyn_cast<MatType>(composite);
  if (!matrix)
    return {normalize(indices[0], count)};
  int64_t rows = matrix.getRows(), cols = count / rows;
  Value first = arith::MulIOp::create(b, loc, normalize(indices[0], rows),
                                      constant(cols));
  SmallVector<Value> columns;
  if (indices.size() > 1)
    columns.push_back(normalize(indices[1], cols));
  else
    for (int64_t i = 0; i < cols; ++i)
      columns.push_back(constant(i));
  for (Value &column : columns)
    column = arith::AddIOp::create(b, loc, first, column);
  return columns;
}

Value LocalMemory::load(ExtractOp op, Stored from) {
  SmallVector<Value> numbers;
  for (Value slot : slotsOf(op.getSource().getType(), op.getIndices()))
    numbers.push_back(get(from, slot));
  if (numbers.front().getType() == op.getType())
    return numbers.front();
  return ConstructOp::create(b, loc, op.getType(), numbers);
}

void LocalMemory::store(InsertOp op, Stored to) {
  SmallVector<Value> slots = slotsOf(op.getType(), op.getIndices());
  bool isRow = op.getValue().getType() != getElementScalar(op.getType());
  for (auto [i, slot] : llvm::enumerate(slots))
    put(isRow ? extract(op.getValue(), {static_cast<int64_t>(i)})
              : Value(op.getValue()),
        to, slot);
}
