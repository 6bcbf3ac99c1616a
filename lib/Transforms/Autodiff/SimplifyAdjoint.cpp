//===- SimplifyAdjoint.cpp - Sums hoisted out of adjoint loops ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The adjoint of a loop that reads the same element in every iteration adds to
// the same gradient in every iteration, atomically more often than not. Such a
// sum is carried by the loop and added once after it,
//
//   for k:                              s = for k, s = 0:
//     accumulate v, g[i]        ==>       s + v
//                                       if any iteration: accumulate s, g[i]
//
// where the loop does nothing else to gradients of that array. A sum under
// conditions in the loop counts, too: they choose between the value and zero,
// and the loop carries whether they ever held. That is the form that the step
// above leaves behind, so sums move out of nested loops as well.
//
// The condition after the loop is there because an element that no iteration
// touched may not even exist.
//
//===----------------------------------------------------------------------===//

#include "DeadValues.h"
#include "Autodiff/Rules/Rules.h"

#include "Analysis/ArrayOrigins.h"
#include "Analysis/Effects.h"
#include "KernelFunction.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_SIMPLIFYADJOINT
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp::autodiff;

/// True if the loop does nothing to the array, or to one that may be the same,
/// but add.
static bool onlyAdds(scf::ForOp loop, Value array) {
  Value root = warp::rootOf(array);
  if (!warp::gradientOwner(array))
    return false;
  return !loop
              .walk([&](Operation *op) {
                if (isMemoryEffectFree(op) || warp::isSum(op) ||
                    isa<scf::ForOp, scf::IfOp, scf::WhileOp>(op) ||
                    isa<warp::ScratchLoadOp, warp::ScratchStoreOp,
                        warp::ScratchOp>(op))
                  return WalkResult::advance();
                for (Value operand : op->getOperands())
                  if (isa<warp::ArrayType>(operand.getType()) &&
                      warp::rootOf(operand) == root)
                    return WalkResult::interrupt();
                return isa<func::CallOp>(op) ? WalkResult::interrupt()
                                             : WalkResult::advance();
              })
              .wasInterrupted();
}

namespace {
/// A sum to move: directly in the loop, or in branches in it.
struct LoopSum {
  scf::ForOp loop;
  /// The innermost first, and whether the sum is in the `then` arm.
  SmallVector<std::pair<scf::IfOp, bool>, 2> branches;
  warp::AccumulateOp op;
};
} // namespace

static std::optional<LoopSum> findSum(warp::AccumulateOp op) {
  LoopSum sum{nullptr, {}, op};
  Operation *inner = op;
  while (auto branch = dyn_cast<scf::IfOp>(inner->getParentOp())) {
    sum.branches.emplace_back(branch, inner->getBlock() == branch.thenBlock());
    inner = branch;
  }
  sum.loop = dyn_cast<scf::ForOp>(inner->getParentOp());
  if (!sum.loop || !sum.loop.isDefinedOutsideOfLoop(op.getArray()) ||
      !llvm::all_of(op.getIndices(), [&](Value index) {
        return sum.loop.isDefinedOutsideOfLoop(index);
      }))
    return std::nullopt;
  if (!onlyAdds(sum.loop, op.getArray()))
    return std::nullopt;
  return sum;
}

/// The loop with one more carried value; `next` makes it from the one before.
static scf::ForOp carry(scf::ForOp loop, Value init,
                        function_ref<Value(OpBuilder &, Value)> next) {
  OpBuilder b(loop);
  SmallVector<Value> inits(loop.getInitArgs());
  inits.push_back(init);
  auto extended = scf::ForOp::create(
      b, loop.getLoc(), loop.getLowerBound(), loop.getUpperBound(),
      loop.getStep(), inits, nullptr, loop.getUnsignedCmp());
  extended.getRegion().takeBody(loop.getRegion());
  Block *body = extended.getBody();
  Value now = body->addArgument(init.getType(), loop.getLoc());
  Operation *yield = body->getTerminator();
  b.setInsertionPoint(yield);
  SmallVector<Value> yields(yield->getOperands());
  yields.push_back(next(b, now));
  yield->setOperands(yields);
  loop.replaceAllUsesWith(extended.getResults().drop_back());
  loop.erase();
  return extended;
}

/// Has a branch result in values of one of its arms as well, and in zeros where
/// it takes the other; returns the new branch, which has them last.
static scf::IfOp yieldMore(scf::IfOp branch, bool inThen, ValueRange values,
                           Location loc) {
  OpBuilder b(branch);
  SmallVector<Type> types(branch.getResultTypes());
  llvm::append_range(types, values.getTypes());
  auto extended =
      scf::IfOp::create(b, branch.getLoc(), types, branch.getCondition(),
                        /*addThenBlock=*/false, /*addElseBlock=*/false);
  for (auto [to, from] :
       llvm::zip_equal(extended->getRegions(), branch->getRegions()))
    to.takeBody(from);
  Region &otherwise = extended.getElseRegion();
  if (otherwise.empty()) {
    b.createBlock(&otherwise);
    scf::YieldOp::create(b, loc);
  }
  for (bool isThen : {true, false}) {
    scf::YieldOp yield = isThen ? extended.thenYield() : extended.elseYield();
    b.setInsertionPoint(yield);
    SmallVector<Value> yields(yield.getOperands());
    for (Value value : values) {
      if (isThen == inThen)
        yields.push_back(value);
      else if (value.getType().isInteger(1))
        yields.push_back(
            arith::ConstantOp::create(b, loc, b.getBoolAttr(false)));
      else
        yields.push_back(zero(b, loc, value.getType()));
    }
    yield->setOperands(yields);
  }
  branch.replaceAllUsesWith(
      extended.getResults().take_front(branch.getNumResults()));
  branch.erase();
  return extended;
}

/// Takes the sum out of its branches; returns the value that they add, or zero,
/// and whether they come to it.
static std::pair<Value, Value> takeFromBranches(LoopSum &sum) {
  Location loc = sum.op.getLoc();
  Value value = sum.op.getValue(), condition;
  for (auto [branch, inThen] : sum.branches) {
    SmallVector<Value, 2> values{value};
    if (condition)
      values.push_back(condition);
    scf::IfOp extended = yieldMore(branch, inThen, values, loc);
    ResultRange more = extended.getResults().take_back(values.size());
    value = more.front();
    if (condition) {
      condition = more.back();
      continue;
    }
    condition = extended.getCondition();
    if (!inThen) {
      OpBuilder b(extended);
      Value yes = arith::ConstantOp::create(b, loc, b.getBoolAttr(true));
      condition = arith::XOrIOp::create(b, loc, condition, yes);
    }
  }
  return {value, condition};
}

/// True if the loop has an iteration.
static Value hasTrips(OpBuilder &b, scf::ForOp loop) {
  auto order = loop.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                     : arith::CmpIPredicate::slt;
  return arith::CmpIOp::create(b, loop.getLoc(), order, loop.getLowerBound(),
                               loop.getUpperBound());
}

static void moveOut(LoopSum sum) {
  Location loc = sum.op.getLoc();
  OpBuilder b(sum.loop);
  Value none = zero(b, loc, sum.op.getValue().getType());
  Value never = arith::ConstantOp::create(b, loc, b.getBoolAttr(false));
  auto [value, condition] = takeFromBranches(sum);
  scf::ForOp loop =
      carry(sum.loop, none, [&, value = value](OpBuilder &b, Value before) {
        return addInAnyOrder(b, loc, before, value);
      });
  Value total = loop.getResults().back(), any;
  if (condition) {
    unsigned place = loop.getNumResults() - 1;
    loop =
        carry(loop, never,
              [&, condition = condition](OpBuilder &b, Value before) -> Value {
                return arith::OrIOp::create(b, loc, before, condition);
              });
    total = loop.getResult(place);
    any = loop.getResults().back();
  }
  b.setInsertionPointAfter(loop);
  if (!any)
    any = hasTrips(b, loop);
  auto guard = scf::IfOp::create(b, loc, any, /*withElseRegion=*/false);
  b.setInsertionPointToStart(guard.thenBlock());
  sum.op->moveBefore(guard.thenBlock(), guard.thenBlock()->begin());
  sum.op.getValueMutable().assign(total);
}

/// Innermost first, so that what one loop leaves, the next one takes.
static void moveSums(func::FuncOp function) {
  SmallVector<warp::AccumulateOp> sums;
  function.walk([&](warp::AccumulateOp op) { sums.push_back(op); });
  for (warp::AccumulateOp op : sums)
    while (auto sum = findSum(op))
      moveOut(*sum);
}

namespace {

struct SimplifyAdjoint : warp::impl::SimplifyAdjointBase<SimplifyAdjoint> {
  void runOnOperation() override {
    auto adjoint =
        dyn_cast_or_null<func::FuncOp>(warp::findKernel(getOperation()));
    if (!adjoint)
      return signalPassFailure();
    moveSums(adjoint);
    eraseDead(adjoint.getBody());
  }
};

} // namespace
