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
  if (auto call = dyn_cast<LLVM::CallIntrinsicOp>(op)) {
    StringRef name = call.getIntrin();
    if (!name.consume_front("llvm.nvvm.read.ptx.sreg."))
      return false;
    if (name == "tid.y" || name == "tid.z")
      compared.insert(value);
    return name.starts_with("ctaid.") || name.starts_with("ntid.") ||
           compared.contains(value);
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
  Value all = constant(i32, -1);
  Value active = callIntrinsic(b, loc, i32, "llvm.nvvm.activemask", {});
  Value whole = equal(active, all);
  if (compared.empty())
    return whole;
  auto agree = scf::IfOp::create(b, loc, i1, whole, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(agree.elseBlock());
  scf::YieldOp::create(b, loc, Value(constant(i1, 0)));
  b.setInsertionPointToStart(agree.thenBlock());
  Value same = constant(i1, 1);
  for (Value value : compared) {
    Value first = shuffle(b, loc, "idx", value, constant(i32, 0));
    same = arith::AndIOp::create(b, loc, same, equal(value, first));
  }
  same = callIntrinsic(b, loc, i1, "llvm.nvvm.vote.all.sync", {all, same});
  scf::YieldOp::create(b, loc, same);
  return agree.getResult(0);
}
