//===- UniformValues.cpp - What the threads of a warp share ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Arguments, extents and the place of the block in the grid are the same for
// all threads of a warp. Counters of loops, and thread indices of the axes y
// and z, mostly are: lanes compare them while the program runs.
//
//===----------------------------------------------------------------------===//

#include "UniformValues.h"

#include "GpuBlock.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

bool warp::isUniform(Value value, LLVM::LLVMFuncOp entry,
                     llvm::SetVector<Value> &compared) {
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    Block *owner = argument.getOwner();
    if (owner == &entry.getBody().front())
      return true;
    auto loop = dyn_cast<scf::ForOp>(owner->getParentOp());
    if (!loop || argument != loop.getInductionVar())
      return false;
    compared.insert(value);
    return isUniform(loop.getLowerBound(), entry, compared) &&
           isUniform(loop.getStep(), entry, compared);
  }
  Operation *op = value.getDefiningOp();
  if (auto read = getGridRead(value)) {
    bool isRow = read->value == GridValue::threadId && read->axis != Axis::x;
    if (isRow)
      compared.insert(value);
    return isRow || read->value == GridValue::blockId ||
           read->value == GridValue::blockDim;
  }
  return isPure(op) && op->getNumRegions() == 0 &&
         llvm::all_of(op->getOperands(), [&](Value operand) {
           return isUniform(operand, entry, compared);
         });
}

Value warp::isWarpTogether(OpBuilder &b, Location loc,
                           ArrayRef<Value> compared) {
  auto equal = [&](Value x, Value y) {
    return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, x, y);
  };
  auto constant = [&](Type type, int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  };
  Type i1 = b.getI1Type(), i32 = b.getI32Type();
  Value whole = isFullWarp(b, loc);
  if (compared.empty())
    return whole;
  auto agree = scf::IfOp::create(b, loc, i1, whole, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(agree.elseBlock());
  scf::YieldOp::create(b, loc, Value(constant(i1, 0)));
  b.setInsertionPointToStart(agree.thenBlock());
  Value same = constant(i1, 1);
  for (Value value : compared) {
    Value first =
        shuffle(b, loc, ShuffleMode::index, value, constant(i32, 0));
    same = arith::AndIOp::create(b, loc, same, equal(value, first));
  }
  scf::YieldOp::create(b, loc, holdsInWarp(b, loc, same));
  return agree.getResult(0);
}
