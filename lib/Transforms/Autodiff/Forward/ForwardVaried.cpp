//===- ForwardVaried.cpp - Activity analysis of forward mode --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A mark spreads from active arrays through operations to their results, and
// through control flow to what it carries, until nothing changes. Arrays and a
// thread's own memory are marked like values.
//
//===----------------------------------------------------------------------===//

#include "Forward.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

bool Varied::mark(Value value) {
  return getTangentType(value.getType()) && values.insert(value).second;
}

SmallVector<unsigned> Varied::select(ValueRange range) const {
  SmallVector<unsigned> positions;
  for (auto [i, value] : llvm::enumerate(range))
    if (contains(value))
      positions.push_back(i);
  return positions;
}

bool Varied::spreadThroughControlFlow(Operation *op) {
  bool changed = false;
  auto pass = [&](ValueRange from, ValueRange to) {
    for (auto [a, b] : llvm::zip(from, to))
      if (contains(a))
        changed |= mark(b);
  };
  if (auto branch = dyn_cast<scf::IfOp>(op)) {
    for (Region &region : branch->getRegions())
      if (!region.empty())
        pass(region.front().getTerminator()->getOperands(),
             branch.getResults());
  } else if (auto loop = dyn_cast<scf::ForOp>(op)) {
    pass(loop.getInitArgs(), loop.getRegionIterArgs());
    pass(loop.getYieldedValues(), loop.getRegionIterArgs());
    pass(loop.getRegionIterArgs(), loop.getResults());
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    pass(loop.getInits(), loop.getBeforeArguments());
    pass(loop.getYieldedValues(), loop.getBeforeArguments());
    pass(loop.getConditionOp().getArgs(), loop.getAfterArguments());
    pass(loop.getConditionOp().getArgs(), loop.getResults());
  } else if (auto call = dyn_cast<func::CallOp>(op)) {
    auto callee = SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(
        call, call.getCalleeAttr());
    if (callee && hasOwnDerivative(callee)) {
      if (llvm::any_of(call.getOperands(), [&](Value operand) {
            return contains(operand) && !isa<ArrayType>(operand.getType());
          }))
        for (Value result : call.getResults())
          changed |= mark(result);
    } else if (callee && !callee.isExternal()) {
      Block &body = callee.getBody().front();
      pass(call.getOperands(), body.getArguments());
      pass(body.getTerminator()->getOperands(), call.getResults());
    }
  }
  return changed;
}

bool Varied::spread(Operation *op) {
  bool changed = spreadThroughControlFlow(op);
  if (op->getNumRegions() != 0 || isa<func::CallOp>(op))
    return changed;
  if (auto store = dyn_cast<ScratchStoreOp>(op))
    return contains(store.getValue()) ? mark(store.getScratch()) || changed
                                      : changed;
  bool isConstant = !isDifferentiable(op) && hasRule(op);
  if (isConstant || llvm::none_of(op->getOperands(), [&](Value operand) {
        return contains(operand);
      }))
    return changed;
  for (Value result : op->getResults())
    changed |= mark(result);
  return changed;
}

Varied::Varied(func::FuncOp kernel, const ArrayLeaves &leaves,
               ArrayRef<bool> active) {
  auto isActive = [&](Value array) {
    return llvm::any_of(leaves.of(array), [&](unsigned leaf) {
      return active.empty() || active[leaf];
    });
  };
  for (BlockArgument argument : kernel.getArguments())
    if (isa<ArrayType>(argument.getType()) && isActive(argument))
      mark(argument);
  kernel->walk([&](StructGetOp get) {
    if (isa<ArrayType>(get.getType()) && isActive(get.getResult()))
      mark(get.getResult());
  });
  Operation *module = kernel->getParentOp();
  module->walk([&](ArrayAtOp at) {
    if (at.getGrad())
      mark(at.getResult());
  });
  bool changed;
  do {
    changed = false;
    module->walk<WalkOrder::PreOrder>(
        [&](Operation *op) { changed |= spread(op); });
  } while (changed);
}

} // namespace warp::autodiff
