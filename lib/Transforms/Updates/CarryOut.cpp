//===- CarryOut.cpp - Reductions carried out of regions -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An update of one element deep in branches and loops becomes a value that
// leaves them, region by region: a branch yields the identity where control
// does not pass the update, a loop carries the combination of what its
// iterations had.
//
//===----------------------------------------------------------------------===//

#include "CarryOut.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using warp::Carried;

bool warp::canCarryOut(Block *from, Block *outer) {
  for (; from != outer; from = from->getParentOp()->getBlock())
    if (!isa<scf::IfOp, scf::ForOp, scf::WhileOp>(from->getParentOp()))
      return false;
  return true;
}

static SmallVector<Value> identities(ArrayRef<Carried> values) {
  return llvm::map_to_vector(
      values, [](const Carried &carried) { return carried.identity; });
}

static SmallVector<Value> combineAll(OpBuilder &b, ArrayRef<Carried> values,
                                     ValueRange sums) {
  SmallVector<Value> combined;
  for (auto [carried, sum] : llvm::zip_equal(values, sums))
    combined.push_back(carried.combine(b, sum, carried.value));
  return combined;
}

/// Appends to what a region's terminator passes on.
static void appendOperands(Operation *terminator, ValueRange values) {
  terminator->insertOperands(terminator->getNumOperands(), values);
}

/// Results of an operation that has more of them than `old`, whose uses it
/// takes over: the additional ones.
static ValueRange takeOver(Operation *old, Operation *made) {
  unsigned count = old->getNumResults();
  old->replaceAllUsesWith(made->getResults().take_front(count));
  old->erase();
  return made->getResults().drop_front(count);
}

static SmallVector<Type> resultTypes(Operation *op, ArrayRef<Carried> values) {
  SmallVector<Type> types(op->getResultTypes());
  for (const Carried &carried : values)
    types.push_back(carried.identity.getType());
  return types;
}

static ValueRange leave(scf::IfOp branch, ArrayRef<Carried> values,
                        Block *from) {
  OpBuilder b(branch);
  auto made = scf::IfOp::create(b, branch.getLoc(),
                                resultTypes(branch, values),
                                branch.getCondition(), /*withElse=*/true);
  made->setDiscardableAttrs(branch->getDiscardableAttrDictionary());
  bool inThen = from == branch.thenBlock();
  made.getThenRegion().takeBody(branch.getThenRegion());
  if (branch.elseBlock()) {
    made.getElseRegion().takeBody(branch.getElseRegion());
  } else {
    b.setInsertionPointToEnd(made.elseBlock());
    if (made.elseBlock()->empty())
      scf::YieldOp::create(b, branch.getLoc());
  }
  SmallVector<Value> reached = llvm::map_to_vector(
      values, [](const Carried &carried) { return carried.value; });
  SmallVector<Value> none = identities(values);
  appendOperands(made.thenYield(), inThen ? reached : none);
  appendOperands(made.elseYield(), inThen ? none : reached);
  return takeOver(branch, made);
}

static ValueRange leave(scf::ForOp loop, ArrayRef<Carried> values) {
  OpBuilder b(loop);
  SmallVector<Value> inits(loop.getInitArgs());
  llvm::append_range(inits, identities(values));
  auto made = scf::ForOp::create(b, loop.getLoc(), loop.getLowerBound(),
                                 loop.getUpperBound(), loop.getStep(), inits,
                                 nullptr, loop.getUnsignedCmp());
  made->setDiscardableAttrs(loop->getDiscardableAttrDictionary());
  made.getRegion().takeBody(loop.getRegion());
  SmallVector<Value> sums;
  for (const Carried &carried : values)
    sums.push_back(made.getBody()->addArgument(carried.identity.getType(),
                                               loop.getLoc()));
  Operation *yield = made.getBody()->getTerminator();
  b.setInsertionPoint(yield);
  appendOperands(yield, combineAll(b, values, sums));
  return takeOver(loop, made);
}

static ValueRange leave(scf::WhileOp loop, ArrayRef<Carried> values,
                        Block *from) {
  OpBuilder b(loop);
  SmallVector<Value> inits(loop.getInits());
  llvm::append_range(inits, identities(values));
  auto made = scf::WhileOp::create(b, loop.getLoc(), resultTypes(loop, values),
                                   inits);
  made->setDiscardableAttrs(loop->getDiscardableAttrDictionary());
  bool isBefore = from == loop.getBeforeBody();
  made.getBefore().takeBody(loop.getBefore());
  made.getAfter().takeBody(loop.getAfter());
  auto addSums = [&](Block *block) {
    SmallVector<Value> sums;
    for (const Carried &carried : values)
      sums.push_back(
          block->addArgument(carried.identity.getType(), loop.getLoc()));
    return sums;
  };
  SmallVector<Value> before = addSums(made.getBeforeBody());
  SmallVector<Value> after = addSums(made.getAfterBody());
  Operation *condition = made.getConditionOp(), *yield = made.getYieldOp();
  b.setInsertionPoint(isBefore ? condition : yield);
  SmallVector<Value> combined =
      combineAll(b, values, isBefore ? before : after);
  appendOperands(condition, isBefore ? combined : before);
  appendOperands(yield, isBefore ? after : combined);
  return takeOver(loop, made);
}

void warp::carryOut(MutableArrayRef<Carried> values, Block *from,
                    Block *outer) {
  while (from != outer) {
    Operation *parent = from->getParentOp();
    Block *around = parent->getBlock();
    ValueRange left;
    if (auto branch = dyn_cast<scf::IfOp>(parent))
      left = leave(branch, values, from);
    else if (auto loop = dyn_cast<scf::ForOp>(parent))
      left = leave(loop, values);
    else
      left = leave(cast<scf::WhileOp>(parent), values, from);
    for (auto [carried, value] : llvm::zip_equal(values, left))
      carried.value = value;
    from = around;
  }
}
