//===- DeadValues.cpp - Liveness through loops ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An adjoint is built generously: every value of the forward sweep is computed
// again and every carried value is a placeholder. The needed values decide
// how a loop is reversed, so it has to be found while the adjoint is built, on
// a piece of it, and through loops that carry values. The marks go backwards
// along single results, carried values and block arguments; sweeping removes
// those places from the operations that stay.
//
//===----------------------------------------------------------------------===//

#include "DeadValues.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"
#include "llvm/ADT/BitVector.h"

using namespace mlir;
using namespace warp::autodiff;

//===----------------------------------------------------------------------===//
// Marking
//===----------------------------------------------------------------------===//

bool warp::autodiff::hasOwnEffect(Operation *op) {
  if (isa<scf::IfOp, scf::ForOp, scf::WhileOp, ScratchStoreOp>(op) ||
      op->hasTrait<OpTrait::IsTerminator>() || isMemoryEffectFree(op))
    return false;
  auto interface = dyn_cast<MemoryEffectOpInterface>(op);
  if (!interface)
    return true;
  SmallVector<MemoryEffects::EffectInstance> effects;
  interface.getEffects(effects);
  return llvm::any_of(effects, [](const MemoryEffects::EffectInstance &e) {
    return !isa<MemoryEffects::Read, MemoryEffects::Allocate>(e.getEffect());
  });
}

void Needs::push(Value value) {
  if (!within->isAncestor(value.getParentRegion()->getParentOp()) ||
      (filter && !filter(value)))
    return;
  if (needed.insert(value).second)
    worklist.push_back(value);
}

void Needs::push(ValueRange values) {
  for (Value value : values)
    push(value);
}

void Needs::mark(Value value) {
  push(value);
  drain();
}

void Needs::mark(ValueRange values) {
  push(values);
  drain();
}

void Needs::markUse(Operation *op) {
  push(op->getOperands());
  reach(op);
  drain();
}

void Needs::markEffects(Operation *root) {
  root->walk([&](Operation *op) {
    if (hasOwnEffect(op))
      markUse(op);
  });
}

void Needs::drain() {
  while (!worklist.empty())
    follow(worklist.pop_back_val());
}

void Needs::follow(Value value) {
  if (auto result = dyn_cast<OpResult>(value))
    followResult(result);
  else
    followArgument(cast<BlockArgument>(value));
}

/// The conditions and bounds on which the execution of an operation depends.
void Needs::reach(Operation *op) {
  for (; op != within && reached.insert(op).second; op = op->getParentOp()) {
    if (auto branch = dyn_cast<scf::IfOp>(op))
      push(branch.getCondition());
    else if (auto loop = dyn_cast<scf::ForOp>(op))
      push({loop.getLowerBound(), loop.getUpperBound(), loop.getStep()});
    else if (auto loop = dyn_cast<scf::WhileOp>(op))
      push(loop.getConditionOp().getCondition());
  }
}

void Needs::followResult(OpResult result) {
  Operation *op = result.getOwner();
  unsigned i = result.getResultNumber();
  reach(op);
  if (auto branch = dyn_cast<scf::IfOp>(op)) {
    push(branch.thenYield().getOperand(i));
    push(branch.elseYield().getOperand(i));
  } else if (auto loop = dyn_cast<scf::ForOp>(op)) {
    push({loop.getInitArgs()[i], loop.getYieldedValues()[i]});
    push(loop.getRegionIterArg(i));
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    push(loop.getConditionOp().getArgs()[i]);
  } else {
    if (getUses)
      push(getUses(op));
    else
      push(op->getOperands());
    if (auto load = dyn_cast<ScratchLoadOp>(op))
      for (Operation *user : load.getScratch().getUsers())
        // Stores before the operation have been done.
        if (isa<ScratchStoreOp>(user) && within->isAncestor(user)) {
          push(user->getOperands());
          reach(user);
        }
    for (Region &region : op->getRegions())
      region.walk([&](Operation *inner) { push(inner->getOperands()); });
  }
}

void Needs::followArgument(BlockArgument argument) {
  Operation *op = argument.getOwner()->getParentOp();
  unsigned i = argument.getArgNumber();
  if (auto loop = dyn_cast<scf::ForOp>(op)) {
    reach(op);
    if (i > 0)
      push({loop.getInitArgs()[i - 1], loop.getYieldedValues()[i - 1]});
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    reach(op);
    if (argument.getOwner() == loop.getBeforeBody())
      push({loop.getInits()[i], loop.getYieldOp().getOperand(i)});
    else
      push(loop.getConditionOp().getArgs()[i]);
  }
}

bool Needs::isNeeded(Operation *op) const {
  return reached.contains(op) ||
         llvm::any_of(op->getResults(),
                      [&](Value result) { return isNeeded(result); });
}

//===----------------------------------------------------------------------===//
// Sweeping
//===----------------------------------------------------------------------===//

/// The positions of `values` that are not needed by either list.
static llvm::BitVector deadPositions(const Needs &needs, ValueRange values,
                                     ValueRange twins) {
  llvm::BitVector dead(values.size());
  for (unsigned i = 0; i < values.size(); ++i)
    dead[i] = !needs.isNeeded(values[i]) && !needs.isNeeded(twins[i]);
  return dead;
}

template <typename Range>
static SmallVector<Value> without(Range &&values, const llvm::BitVector &dead) {
  SmallVector<Value> kept;
  for (auto [i, value] : llvm::enumerate(values))
    if (!dead[i])
      kept.push_back(value);
  return kept;
}

/// Moves the regions of `op` to `rebuilt`, and the uses of the results that
/// are not dead.
static void replaceWithFewer(Operation *op, Operation *rebuilt,
                             const llvm::BitVector &dead) {
  for (auto [to, from] :
       llvm::zip_equal(rebuilt->getRegions(), op->getRegions()))
    to.takeBody(from);
  rebuilt->setDiscardableAttrs(op->getDiscardableAttrDictionary());
  for (auto [from, to] :
       llvm::zip_equal(without(op->getResults(), dead), rebuilt->getResults()))
    from.replaceAllUsesWith(to);
  op->dropAllUses();
  op->erase();
}

static void dropArguments(Block &block, const llvm::BitVector &dead,
                          unsigned first = 0) {
  for (unsigned i = dead.size(); i-- > 0;)
    if (dead[i]) {
      block.getArgument(first + i).dropAllUses();
      block.eraseArgument(first + i);
    }
}

static void shrink(const Needs &needs, scf::IfOp op) {
  llvm::BitVector dead = deadPositions(needs, op.getResults(), op.getResults());
  if (dead.none())
    return;
  OpBuilder b(op);
  op.thenYield()->eraseOperands(dead);
  op.elseYield()->eraseOperands(dead);
  SmallVector<Value> kept = without(op.getResults(), dead);
  auto rebuilt = scf::IfOp::create(b, op.getLoc(), TypeRange(ValueRange(kept)),
                                   op.getCondition(), /*addThenBlock=*/false,
                                   /*addElseBlock=*/false);
  replaceWithFewer(op, rebuilt, dead);
}

static void shrink(const Needs &needs, scf::ForOp op) {
  llvm::BitVector dead =
      deadPositions(needs, op.getResults(), op.getRegionIterArgs());
  if (dead.none())
    return;
  OpBuilder b(op);
  op.getBody()->getTerminator()->eraseOperands(dead);
  dropArguments(*op.getBody(), dead, /*first=*/1);
  auto rebuilt = scf::ForOp::create(
      b, op.getLoc(), op.getLowerBound(), op.getUpperBound(), op.getStep(),
      without(op.getInitArgs(), dead), nullptr, op.getUnsignedCmp());
  replaceWithFewer(op, rebuilt, dead);
}

static void shrink(const Needs &needs, scf::WhileOp op) {
  llvm::BitVector carried =
      deadPositions(needs, op.getBeforeArguments(), op.getBeforeArguments());
  llvm::BitVector passed =
      deadPositions(needs, op.getResults(), op.getAfterArguments());
  if (carried.none() && passed.none())
    return;
  OpBuilder b(op);
  op.getYieldOp()->eraseOperands(carried);
  dropArguments(*op.getBeforeBody(), carried);
  SmallVector<Value> args = without(op.getConditionOp().getArgs(), passed);
  op.getConditionOp().getArgsMutable().assign(args);
  dropArguments(*op.getAfterBody(), passed);
  SmallVector<Value> kept = without(op.getResults(), passed);
  auto rebuilt =
      scf::WhileOp::create(b, op.getLoc(), TypeRange(ValueRange(kept)),
                           without(op.getInits(), carried));
  replaceWithFewer(op, rebuilt, passed);
}

void warp::autodiff::eraseDead(Region &region, ValueRange keep) {
  Needs needs(region.getParentOp());
  for (Block &block : region)
    for (Operation &op : block)
      needs.markEffects(&op);
  // Loads from memory that comes from outside may be outside, too.
  region.walk([&](warp::ScratchStoreOp store) {
    if (!region.isAncestor(store.getScratch().getParentRegion()))
      needs.markUse(store);
  });
  for (Block &block : region)
    needs.mark(block.getTerminator()->getOperands());
  needs.mark(keep);

  auto stays = [&](Operation *op) {
    return needs.isNeeded(op) || op->hasTrait<OpTrait::IsTerminator>();
  };
  SmallVector<Operation *> dead, alive;
  region.walk<WalkOrder::PreOrder>([&](Operation *op) {
    if (stays(op)) {
      alive.push_back(op);
      return WalkResult::advance();
    }
    dead.push_back(op);
    return WalkResult::skip();
  });
  for (Operation *op : dead)
    op->dropAllReferences();
  for (Operation *op : dead) {
    op->dropAllUses();
    op->erase();
  }
  for (Operation *op : alive) {
    if (auto branch = dyn_cast<scf::IfOp>(op))
      shrink(needs, branch);
    else if (auto loop = dyn_cast<scf::ForOp>(op))
      shrink(needs, loop);
    else if (auto loop = dyn_cast<scf::WhileOp>(op))
      shrink(needs, loop);
  }
}
