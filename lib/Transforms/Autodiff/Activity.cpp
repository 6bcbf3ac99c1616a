//===- Activity.cpp - Activity analysis -----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Two marks spread until nothing changes: `varied` from loads of active arrays
// to results, `useful` from stores to active arrays to operands. Control flow
// passes both through what it yields and carries; a loop is why one walk may
// not be enough.
//
//===----------------------------------------------------------------------===//

#include "Activity.h"

#include "Autodiff/Rules/Rules.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

bool hasDerivative(Type type) {
  if (auto tile = dyn_cast<TileType>(type))
    type = tile.getElementType();
  Type scalar = getElementScalar(type);
  return scalar && isFloat(scalar);
}

//===----------------------------------------------------------------------===//
// Addresses
//===----------------------------------------------------------------------===//

Value gradientAddress(Value array) {
  auto at = rootOf(array).getDefiningOp<ArrayAtOp>();
  return at ? at.getGrad() : Value();
}

LogicalResult checkAddress(AccessOp write) {
  if (!gradientAddress(write.getArray()))
    return success();
  return write->emitError(
      "cannot write through an address: memory with gradients "
      "is read-only in a differentiated kernel");
}

Value ifThere(OpBuilder &builder, Location loc, Value address, Type type,
              function_ref<Value()> body) {
  Value none = zero(builder, loc, address.getType());
  Value isThere = createBuiltin(builder, loc, NeOp::getSpec(), {address, none})
                      ->getResult(0);
  auto branch = scf::IfOp::create(
      builder, loc, type ? TypeRange(type) : TypeRange(), isThere, bool(type));
  OpBuilder::InsertionGuard guard(builder);
  builder.setInsertionPointToStart(branch.thenBlock());
  Value made = body();
  if (!type)
    return {};
  scf::YieldOp::create(builder, loc, made);
  builder.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(builder, loc, zero(builder, loc, type));
  return branch.getResult(0);
}

//===----------------------------------------------------------------------===//
// Marks
//===----------------------------------------------------------------------===//

bool Activity::isActiveArray(Value array) const {
  if (gradientAddress(array))
    return true;
  return llvm::any_of(leaves.of(array), [&](unsigned leaf) {
    return leaf < active.size() && active[leaf];
  });
}

bool Activity::markVaried(Value value) {
  return hasDerivative(value.getType()) && varied.insert(value).second;
}

bool Activity::markUseful(Value value) {
  return hasDerivative(value.getType()) && useful.insert(value).second;
}

/// Data flow along control flow: calls `pass(from, to)`
/// for each pair.
static void forEachCarried(Operation *op,
                           function_ref<void(Value, Value)> pass) {
  auto passAll = [&](ValueRange from, ValueRange to) {
    for (auto [a, b] : llvm::zip_equal(from, to))
      pass(a, b);
  };
  if (auto branch = dyn_cast<scf::IfOp>(op)) {
    if (branch.getNumResults() == 0)
      return;
    passAll(branch.thenYield().getOperands(), branch.getResults());
    passAll(branch.elseYield().getOperands(), branch.getResults());
  } else if (auto loop = dyn_cast<scf::ForOp>(op)) {
    passAll(loop.getInitArgs(), loop.getRegionIterArgs());
    passAll(loop.getYieldedValues(), loop.getRegionIterArgs());
    passAll(loop.getInitArgs(), loop.getResults());
    passAll(loop.getYieldedValues(), loop.getResults());
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    passAll(loop.getInits(), loop.getBeforeArguments());
    passAll(loop.getYieldedValues(), loop.getBeforeArguments());
    passAll(loop.getConditionOp().getArgs(), loop.getAfterArguments());
    passAll(loop.getConditionOp().getArgs(), loop.getResults());
  } else if (auto map = dyn_cast<TileMapOp>(op)) {
    Block &body = map.getBody().front();
    passAll(map.getInputs(), body.getArguments());
    passAll(body.getTerminator()->getOperands(), map.getResults());
  } else if (auto fold = dyn_cast<TileFoldOp>(op)) {
    Block &body = fold.getBody().front();
    Value next = body.getTerminator()->getOperand(0);
    for (Value argument : body.getArguments()) {
      pass(fold.getTile(), argument);
      pass(next, argument);
    }
    pass(next, fold.getResult());
  }
}

bool Activity::spreadVaried(Operation *op) {
  bool changed = false;
  forEachCarried(op, [&](Value from, Value to) {
    if (varied.contains(from))
      changed |= markVaried(to);
  });
  if (auto store = dyn_cast<ScratchStoreOp>(op))
    if (varied.contains(store.getValue()))
      changed |= varied.insert(store.getScratch()).second;
  if (op->getNumRegions() != 0 || op->getNumResults() == 0)
    return changed;
  bool isVaried = llvm::any_of(op->getOperands(), [&](Value operand) {
    return varied.contains(operand) ||
           (isa<ArrayType>(operand.getType()) && isActiveArray(operand));
  });
  // An operation without a rule is varied, so that a use of it is an error.
  if (!isVaried || (!isDifferentiable(op) && hasRule(op)))
    return changed;
  for (Value result : op->getResults())
    changed |= markVaried(result);
  return changed;
}

bool Activity::spreadUseful(Operation *op) {
  bool changed = false;
  forEachCarried(op, [&](Value from, Value to) {
    if (useful.contains(to))
      changed |= markUseful(from);
  });
  if (op->getNumRegions() != 0)
    return changed;
  bool isUseful = llvm::any_of(
      op->getResults(), [&](Value result) { return useful.contains(result); });
  auto access = dyn_cast<AccessOp>(op);
  auto tiles = dyn_cast<TileAccessOp>(op);
  if (access  ? access.mayWrite()
      : tiles ? tiles.mayWrite()
              : isa<func::CallOp>(op))
    isUseful |= llvm::any_of(op->getOperands(), [&](Value operand) {
      return isa<ArrayType>(operand.getType()) && isActiveArray(operand);
    });
  if (isUseful)
    for (Value operand : op->getOperands())
      changed |= markUseful(operand);
  return changed;
}

namespace {
/// Walks the blocks of a region and the operations of a block backwards.
struct ReverseOrder {
  template <typename T> static auto makeIterable(T &range) {
    return llvm::reverse(ForwardIterator::makeIterable(range));
  }
};
} // namespace

Activity::Activity(FunctionOpInterface function, const ArrayLeaves &leaves,
                   ArrayRef<bool> active)
    : leaves(leaves), active(active) {
  bool changed;
  do {
    changed = false;
    function->walk<WalkOrder::PreOrder>(
        [&](Operation *op) { changed |= spreadVaried(op); });
  } while (changed);
  do {
    changed = false;
    function->walk<WalkOrder::PostOrder, ReverseOrder>(
        [&](Operation *op) { changed |= spreadUseful(op); });
  } while (changed);
  findStops(function);
}

//===----------------------------------------------------------------------===//
// Places at which gradients stop
//===----------------------------------------------------------------------===//

void Activity::findStops(FunctionOpInterface function) {
  SmallVector<Value> work;
  llvm::DenseSet<Value> seen;
  auto visit = [&](Operation *op) {
    for (Value operand : op->getOperands())
      if (isInteger(operand.getType()) && seen.insert(operand).second)
        work.push_back(operand);
  };
  function->walk([&](CastOp cast) {
    if (useful.contains(cast.getResult()))
      visit(cast);
  });
  while (!work.empty()) {
    Operation *op = work.pop_back_val().getDefiningOp();
    if (!op || op->getNumRegions() != 0 || !isPure(op))
      continue;
    auto cast = dyn_cast<CastOp>(op);
    if (cast && varied.contains(cast.getSource()))
      stops.insert(cast);
    visit(op);
  }
}

} // namespace warp::autodiff
