//===- RecoveryInRegisters.cpp - Recomputed carried values ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Rank 3 is for loops whose reverse only adds, in any order: it runs forward
// and carries the needed values as the primal loop does. A Monte Carlo sum is
// such a loop: its random state comes along.
//
// Rank 4 is for integers that have to come in the reverse order and whose
// update has an exact inverse (see IterationSolver.cpp). The reverse loop
// carries them backwards from the value that the primal loop ends with,
//
//   (state after) = last
//   for i = trips - 1 .. 0:
//     before = inverse(after);  replay and reverse from `before`
//     after = before
//
//===----------------------------------------------------------------------===//

#include "LoopReversal.h"

#include "Analysis/Effects.h"
#include "Autodiff/DeadValues.h"
#include "IterationSolver.h"
#include "WarpDialect/WarpOps.h"

#include "llvm/ADT/SmallPtrSet.h"

using namespace mlir;
using namespace warp::autodiff;

static void appendToYield(scf::ForOp loop, ValueRange values) {
  Operation *yield = loop.getBody()->getTerminator();
  yield->insertOperands(yield->getNumOperands(), values);
}

//===----------------------------------------------------------------------===//
// Rank 3
//===----------------------------------------------------------------------===//

/// True if a value is another one, whatever branch is taken and however often
/// loops run on the way.
static bool isAlways(Value value, Value other) {
  if (value == other)
    return true;
  auto result = dyn_cast<OpResult>(value);
  if (!result)
    return false;
  unsigned i = result.getResultNumber();
  if (auto branch = dyn_cast<scf::IfOp>(result.getOwner()))
    return isAlways(branch.thenYield()->getOperand(i), other) &&
           isAlways(branch.elseYield()->getOperand(i), other);
  auto inner = dyn_cast<scf::ForOp>(result.getOwner());
  return inner && isAlways(inner.getInitArgs()[i], other) &&
         isAlways(inner.getYieldedValues()[i], inner.getRegionIterArg(i));
}

/// True if iterations of the reverse loop only add, to what none of them reads;
/// then they run forward, as hardware expects.
bool LoopReversal::hasFreeOrder(scf::ForOp reversed) {
  Operation *yield = reversed.getBody()->getTerminator();
  for (unsigned i = 0; i < active.size(); ++i)
    if (!isAlways(yield->getOperand(i), reversed.getRegionIterArg(i)))
      return false;
  llvm::SmallPtrSet<Value, 4> added, read;
  bool onlyAdds = true;
  reversed.walk([&](Operation *op) {
    if (isSum(op))
      added.insert(rootOf(cast<AccessOp>(op).getArray()));
    else if (isPlainRead(op))
      read.insert(rootOf(cast<AccessOp>(op).getArray()));
    else
      onlyAdds &= !hasOwnEffect(op) || op->hasAttr(attr::taped);
  });
  return onlyAdds &&
         llvm::none_of(added, [&](Value root) { return read.contains(root); });
}

LogicalResult LoopReversal::carryAlong(scf::ForOp &reversed,
                                       ArrayRef<unsigned> needed) {
  number.replaceAllUsesWith(reversed.getInductionVar());
  if (needed.empty())
    return success();
  SmallVector<unsigned> states = closure(needed);
  reversed = extend(reversed, recoverInits(states));
  ValueRange carried =
      ValueRange(reversed.getRegionIterArgs()).take_back(states.size());
  for (auto [state, value] : llvm::zip_equal(states, carried))
    placeholders[state].replaceAllUsesWith(value);

  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(reversed.getBody());
  recoverStates(reversed.getInductionVar(), states, carried);
  recoverIteration(reversed.getInductionVar());
  if (failed(replayIteration()))
    return failure();
  appendToYield(reversed, llvm::map_to_vector(states, [&](unsigned state) {
                  return reverse.recover(getNexts()[state]);
                }));
  eraseDead(reversed.getRegion(), getHeld());
  note(needed, RecoveryRank::CarriedAlong, 0);
  return success();
}

//===----------------------------------------------------------------------===//
// Rank 4
//===----------------------------------------------------------------------===//

/// The `states` before an iteration, from those after it; null for
/// those that do not follow.
FailureOr<SmallVector<Value>> LoopReversal::solve(ArrayRef<unsigned> states,
                                                  ValueRange after) {
  auto copies = [&](Value value) { return trace(value); };
  IterationSolver solver(reverse, loop, copies);
  recoverIteration(number);
  if (Value counter = getCounter())
    solver.learn(counter, reverse.recover(counter));
  for (auto [i, state] : llvm::enumerate(getStates()))
    if (Value value = closedForm(i, number))
      solver.learn(state, value);
  for (auto [state, value] : llvm::zip_equal(states, after))
    solver.learn(getNexts()[state], value);
  if (failed(solver.run()))
    return failure();
  return llvm::map_to_vector(
      states, [&](unsigned state) { return solver.find(getStates()[state]); });
}

/// The largest set of integers that follow from their values after an
/// iteration; empty if none of them is needed. The code for that is put where
/// an iteration of the reverse loop begins.
FailureOr<LoopReversal::Inverses>
LoopReversal::findInverses(ArrayRef<unsigned> needed) {
  auto isCandidate = [&](unsigned state) {
    auto type = dyn_cast<IntegerType>(getStates()[state].getType());
    return type && type.getWidth() > 1 && !hasClosedForm(state);
  };
  Inverses found;
  for (unsigned state = 0; state < getStates().size(); ++state)
    if (isCandidate(state))
      found.states.push_back(state);
  OpBuilder::InsertionGuard guard(b);
  while (true) {
    if (!llvm::any_of(needed, [&](unsigned state) {
          return llvm::is_contained(found.states, state);
        }))
      return Inverses();
    b.setInsertionPointAfterValue(number);
    found.after.clear();
    for (unsigned state : found.states)
      found.after.push_back(placeholder(getStates()[state].getType()));
    auto before = solve(found.states, found.after);
    if (failed(before))
      return failure();
    found.before = *before;
    if (!llvm::is_contained(found.before, Value()))
      return found;
    SmallVector<unsigned> rest;
    for (auto [state, value] : llvm::zip_equal(found.states, found.before))
      if (value)
        rest.push_back(state);
    found.states = rest;
  }
}

void LoopReversal::carryBackwards(scf::ForOp &reversed,
                                  const Inverses &inverses,
                                  ArrayRef<unsigned> needed) {
  SmallVector<Value> last = llvm::map_to_vector(
      inverses.states, [&](unsigned state) { return getFinal(state); });
  inverted = inverses.states;
  reversed = extend(reversed, last);
  appendToYield(reversed, inverses.before);
  ValueRange carried =
      ValueRange(reversed.getRegionIterArgs()).take_back(last.size());
  for (auto [after, value] : llvm::zip_equal(inverses.after, carried))
    Value(after).replaceAllUsesWith(value);
  for (auto [state, value] :
       llvm::zip_equal(inverses.states, inverses.before)) {
    placeholders[state].replaceAllUsesWith(value);
    if (llvm::is_contained(needed, state))
      note({state}, RecoveryRank::Inverted, 0);
  }
}

/// Uses what a forward run of `states` has found in the end instead of running
/// the loop forward for its last values.
void LoopReversal::startBackwards(scf::ForOp reversed,
                                  ArrayRef<unsigned> states, ValueRange last) {
  bool runsAgain = false;
  unsigned first = active.size() + captures.size();
  for (auto [i, state] : llvm::enumerate(inverted)) {
    auto found = llvm::find(states, state);
    if (found == states.end())
      runsAgain = true;
    else
      reversed.getInitArgsMutable()[first + i].assign(
          last[found - states.begin()]);
  }
  // One with a condition has run for its trips anyway.
  reverse.metrics.replayLoops += runsAgain && isa<scf::ForOp>(loop);
}
