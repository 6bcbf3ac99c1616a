//===- CarryValue.cpp - Additional loop-carried value ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "CarryValue.h"

using namespace mlir;

namespace warp::autodiff {

Value ValueCarrier::carry(Block &block, Value current) {
  for (Operation &op : llvm::make_early_inc_range(block))
    current =
        op.getNumRegions() != 0 ? carry(&op, current) : pass(&op, current);
  return current;
}

bool ValueCarrier::holdsChange(Operation *op) const {
  return op
      ->walk([&](Operation *inner) {
        return changes(inner) ? WalkResult::interrupt() : WalkResult::advance();
      })
      .wasInterrupted();
}

Value ValueCarrier::carry(Operation *op, Value current) {
  if (!holdsChange(op)) {
    for (Region &region : op->getRegions())
      for (Block &block : region)
        carry(block, current);
    return current;
  }
  if (auto branch = dyn_cast<scf::IfOp>(op))
    return carry(branch, current);
  if (auto loop = dyn_cast<scf::ForOp>(op))
    return carry(loop, current);
  return carry(cast<scf::WhileOp>(op), current);
}

static void append(Operation *terminator, Value value) {
  terminator->insertOperands(terminator->getNumOperands(), value);
}

/// The results but for the last one, which is new.
static void replaceResults(Operation *old, Operation *extended) {
  old->replaceAllUsesWith(extended->getResults().drop_back());
  old->erase();
}

Value ValueCarrier::carry(scf::IfOp branch, Value current) {
  OpBuilder builder(branch);
  SmallVector<Type> types(branch.getResultTypes());
  types.push_back(current.getType());
  auto extended = scf::IfOp::create(builder, branch.getLoc(), types,
                                    branch.getCondition(), true);
  for (auto [to, from] :
       llvm::zip_equal(extended->getRegions(), branch->getRegions())) {
    if (from.empty()) {
      builder.setInsertionPointToStart(&to.front());
      scf::YieldOp::create(builder, branch.getLoc(), current);
      continue;
    }
    to.takeBody(from);
    append(to.front().getTerminator(), carry(to.front(), current));
  }
  replaceResults(branch, extended);
  return extended->getResults().back();
}

Value ValueCarrier::carry(scf::ForOp loop, Value start) {
  OpBuilder builder(loop);
  SmallVector<Value> inits(loop.getInitArgs());
  inits.push_back(start);
  auto extended = scf::ForOp::create(
      builder, loop.getLoc(), loop.getLowerBound(), loop.getUpperBound(),
      loop.getStep(), inits, nullptr, loop.getUnsignedCmp());
  extended.getRegion().takeBody(loop.getRegion());
  Block &body = extended.getRegion().front();
  Value current = body.addArgument(start.getType(), loop.getLoc());
  append(body.getTerminator(), carry(body, current));
  replaceResults(loop, extended);
  return extended->getResults().back();
}

Value ValueCarrier::carry(scf::WhileOp loop, Value start) {
  OpBuilder builder(loop);
  SmallVector<Value> inits(loop.getInits());
  inits.push_back(start);
  SmallVector<Type> types(loop.getResultTypes());
  types.push_back(start.getType());
  auto extended = scf::WhileOp::create(builder, loop.getLoc(), types, inits);
  Value current = start;
  for (auto [to, from] :
       llvm::zip_equal(extended->getRegions(), loop->getRegions())) {
    to.takeBody(from);
    current = to.front().addArgument(start.getType(), loop.getLoc());
    append(to.front().getTerminator(), carry(to.front(), current));
  }
  replaceResults(loop, extended);
  return extended->getResults().back();
}

} // namespace warp::autodiff
