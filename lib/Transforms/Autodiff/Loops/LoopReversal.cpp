//===- LoopReversal.cpp - Reversing a loop of either kind -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The reverse of a loop runs its iterations from the last to the first. It
// carries the cotangents of the carried values, and of values from outside
// that iterations use; each iteration is replayed, then reversed. A replay
// starts from the values that the primal loop carried at that point, and how
// to have those again is what this file is about.
//
// First the reverse loop is built as if all of them were at hand: they are
// placeholders. The uses of a placeholder that remain after dead-code
// elimination are the need. A sum needs nothing, and the loop is done.
// Otherwise, in this order:
//
//   rank 1   an invariant, or an integer plus a step: a formula of the number
//            of the iteration
//   rank 3   the order of the reverse iterations does not matter: they run
//            forward and carry the needed values along, if it may be in a loop
//            of the same kind
//   rank 4   an integer whose update has an exact inverse: carried backwards
//            from its last value
//   rank 5   few iterations, their number a constant: a forward loop keeps the
//            needed values of all of them in scratch memory. If a constant only
//            bounds the number, the loop that counts them does
//   rank 6   any number of iterations in memory of a fixed size, which is what
//            Checkpoints.cpp builds
//   rank 7   instead of that, if asked for: all of them, in memory that the
//            runtime allocates
//
// Threads that began a loop together may leave it at different times. Its
// iterations are then reversed in step, from the last one that any of them
// made: a thread skips those that it did not make itself (`skipOthers`). So
// lanes are at the same iteration, read the same element, and add to it
// together.
//
// Ranks 5 to 7 run the loop forward again, but only the part of the state from
// which the needed part follows (`closure`).
//
// Nested loops are reversed within the placeholder body of the outer one, with
// a recovery of their own; their initial values come from the replay.
//
//===----------------------------------------------------------------------===//

#include "LoopReversal.h"

#include "Analysis/Effects.h"
#include "Autodiff/DeadValues.h"
#include "WarpDialect/LaneOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp::autodiff;

//===----------------------------------------------------------------------===//
// Small values
//===----------------------------------------------------------------------===//

Value LoopReversal::placeholder(Type type) {
  return UnrealizedConversionCastOp::create(b, loc, type, ValueRange())
      .getResult(0);
}

Value LoopReversal::constant(Type type, int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
}

//===----------------------------------------------------------------------===//
// The reverse loop
//===----------------------------------------------------------------------===//

/// States whose cotangent is not zero in every iteration: those that flow to a
/// result with one, or into memory.
SmallVector<bool> LoopReversal::findCotangents(ArrayRef<Value> given) {
  auto filter = [&](Value value) { return reverse.isActive(value); };
  Needs needs(loop, filter);
  for (auto [i, cotangent] : llvm::enumerate(given))
    if (cotangent)
      needs.mark(getNexts()[i]);
  needs.markEffects(loop);
  SmallVector<bool> found;
  for (auto [i, state] : llvm::enumerate(getStates()))
    found.push_back(given[i] || (needs.isNeeded(state) && filter(state)));
  return found;
}

/// The body: replay and reverse one iteration.
LogicalResult LoopReversal::fillReverse(scf::ForOp loop) {
  number = placeholder(loop.getInductionVar().getType());
  placeholders.clear();
  for (Value state : getStates()) {
    placeholders.push_back(placeholder(state.getType()));
    reverse.setRecovered(state, placeholders.back());
  }
  recoverIteration(number);
  SmallVector<Value> next;
  auto left = reverse.inScope([&]() -> LogicalResult {
    if (failed(replayIteration()))
      return failure();
    for (auto [i, state] : llvm::enumerate(active))
      reverse.addCotangent(getNexts()[state], loop.getRegionIterArg(i));
    if (failed(reverseIteration()))
      return failure();
    for (unsigned state : active)
      next.push_back(reverse.takeCotangentOrZero(getStates()[state]));
    return success();
  });
  if (failed(left))
    return failure();
  captures = std::move(*left);
  for (auto &[primal, contribution] : captures)
    next.push_back(contribution);
  scf::YieldOp::create(b, loc, next);
  return success();
}

/// Cotangents of values from outside are sums over the iterations.
scf::ForOp LoopReversal::appendCaptures(scf::ForOp loop) {
  if (captures.empty())
    return loop;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(loop);
  SmallVector<Value> zeros;
  for (auto &[primal, sum] : captures)
    zeros.push_back(reverse.zeroCotangent(primal));
  scf::ForOp extended = extend(loop, zeros);
  Operation *yield = extended.getBody()->getTerminator();
  b.setInsertionPoint(yield);
  for (auto [i, capture] : llvm::enumerate(captures)) {
    unsigned at = active.size() + i;
    Value sum = extended.getRegionIterArg(at);
    yield->setOperand(at, addInAnyOrder(b, loc, sum, capture.second));
  }
  return extended;
}

scf::ForOp LoopReversal::extend(scf::ForOp loop, ValueRange inits) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(loop);
  SmallVector<Value> all(loop.getInitArgs());
  llvm::append_range(all, inits);
  auto extended =
      scf::ForOp::create(b, loc, loop.getLowerBound(), loop.getUpperBound(),
                         loop.getStep(), all, nullptr, loop.getUnsignedCmp());
  extended.getRegion().takeBody(loop.getRegion());
  for (Value init : inits)
    extended.getBody()->addArgument(init.getType(), loc);
  loop.erase();
  return extended;
}

SmallVector<Value> LoopReversal::getHeld() {
  SmallVector<Value> held(placeholders);
  llvm::append_range(held, drafted);
  held.push_back(number);
  return held;
}

bool LoopReversal::needsNoState() {
  return number.use_empty() && llvm::all_of(placeholders, [](Value value) {
           return value.use_empty();
         });
}

FailureOr<scf::ForOp> LoopReversal::buildReverse(Value trips,
                                                 ArrayRef<Value> cotangents) {
  SmallVector<bool> has = findCotangents(cotangents);
  active.clear();
  SmallVector<Value> inits;
  for (auto [i, state] : llvm::enumerate(getStates()))
    if (has[i]) {
      active.push_back(i);
      inits.push_back(cotangents[i] ? cotangents[i]
                                    : reverse.zeroCotangent(state));
    }
  Type type = trips.getType();
  auto loop =
      scf::ForOp::create(b, loc, constant(type, 0), trips, constant(type, 1),
                         inits, nullptr, /*unsignedCmp=*/true);
  OpBuilder::InsertionGuard guard(b);
  Block *body = loop.getBody();
  if (!body->empty())
    body->back().erase();
  b.setInsertionPointToEnd(body);
  if (failed(fillReverse(loop)))
    return failure();
  loop = appendCaptures(loop);
  eraseDead(loop.getRegion(), getHeld());
  return loop;
}

bool LoopReversal::isZero(ArrayRef<Value> cotangents) {
  auto hasEffect = [&](Operation *op) {
    bool matters = isa<func::CallOp>(op) ||
                   llvm::any_of(op->getOperands(), [&](Value operand) {
                     return isa<warp::ArrayType>(operand.getType()) &&
                            reverse.getActivity().isActiveArray(operand);
                   });
    return matters && hasOwnEffect(op) ? WalkResult::interrupt()
                                       : WalkResult::advance();
  };
  return llvm::none_of(cotangents, [](Value g) { return bool(g); }) &&
         !loop->walk(hasEffect).wasInterrupted();
}

/// The needed states of iterations that run from the last to the first.
/// Returns what the reverse loop leaves.
FailureOr<SmallVector<Value>>
LoopReversal::recoverBackwards(scf::ForOp reversed, Value trips,
                               ArrayRef<unsigned> needed) {
  FailureOr<Inverses> inverses = findInverses(needed);
  if (failed(inverses))
    return failure();
  SmallVector<unsigned> kept;
  for (unsigned state : needed)
    if (!llvm::is_contained(inverses->states, state))
      kept.push_back(state);
  if (failed(checkKept(closure(kept))))
    return failure();
  // The states of checkpoints have to be there together.
  if (kept.empty() || fitsTape(trips, kept) || fitsCountedTape(trips, kept) ||
      fitsGlobalTape(kept))
    carryBackwards(reversed, *inverses, needed);
  else
    kept.assign(needed.begin(), needed.end());
  eraseDead(reversed.getRegion(), getHeld());
  LogicalResult done = checkKept(closure(kept));
  if (failed(done))
    return failure();
  Value steps = trips;
  bool isCounted = !kept.empty() && fitsCountedTape(trips, kept);
  if (mayEndApart() && (kept.empty() || isCounted || !fitsGlobalTape(kept))) {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPoint(reversed);
    ownTrips = trips;
    steps = MostTripsOp::create(b, loc, trips);
    reversed.setUpperBound(steps);
  }
  if (kept.empty()) {
    startBackwards(reversed, {}, {});
    skipOthers(reversed, bindNumber(reversed, steps));
  } else if (isCounted) {
    recoverFromCountedTape(reversed, steps, kept);
  } else if (fitsTape(trips, kept)) {
    done = recoverFromTape(reversed, trips, kept);
  } else {
    keepTapesOut();
    if (!fitsGlobalTape(kept))
      return recoverFromCheckpoints(reversed, steps, kept);
    done = recoverFromGlobalTape(reversed, trips, kept);
  }
  if (failed(done))
    return failure();
  return SmallVector<Value>(reversed.getResults());
}

LogicalResult LoopReversal::reverseAll(Value trips,
                                       ArrayRef<Value> cotangents) {
  FailureOr<scf::ForOp> built = buildReverse(trips, cotangents);
  if (failed(built))
    return failure();
  scf::ForOp reversed = *built;
  bool isFree = hasFreeOrder(reversed);
  SmallVector<Value> sums;
  if (isFree && mayRunAlong(reversed)) {
    auto results = runAlong(reversed);
    if (failed(results))
      return failure();
    sums = *results;
  } else {
    if (failed(completeDraft()))
      return failure();
    eraseDead(reversed.getRegion(), getHeld());
    SmallVector<unsigned> needed = resolveFree();
    if (isFree) {
      if (failed(carryAlong(reversed, needed)))
        return failure();
      sums = reversed.getResults();
    } else {
      auto results = recoverBackwards(reversed, trips, needed);
      if (failed(results))
        return failure();
      sums = *results;
    }
  }
  llvm::append_range(placeholders, drafted);
  drafted.clear();
  for (Value value : placeholders)
    value.getDefiningOp()->erase();
  number.getDefiningOp()->erase();
  for (auto [state, sum] : llvm::zip(active, sums))
    reverse.addCotangent(getInits()[state], sum);
  for (auto [capture, sum] :
       llvm::zip(captures, ArrayRef(sums).drop_front(active.size())))
    reverse.addCotangent(capture.first, sum);
  return success();
}

/// The text of --dump-recovery for each value.
void LoopReversal::note(ArrayRef<unsigned> states, RecoveryRank rank,
                        int64_t bytes) {
  if (!reverse.options.dumpRecovery)
    return;
  for (unsigned state : states) {
    std::string text;
    llvm::raw_string_ostream(text)
        << "carried value " << state << " of type '"
        << getStates()[state].getType() << "': rank " << static_cast<int>(rank)
        << ", " << bytes << " bytes"
        << (rank == RecoveryRank::GlobalTape ? " per trip" : "");
    reverse.remarks.emplace_back(loc, text);
  }
}
