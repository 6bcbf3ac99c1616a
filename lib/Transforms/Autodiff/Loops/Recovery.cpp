//===- Recovery.cpp - Tape in thread-private memory -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loop runs forward again and keeps what the reverse loop needs. Rank 5 keeps
// the needed values of all iterations; rank 6 is in Checkpoints.cpp, rank 7 in
// GlobalTape.cpp.
//
//===----------------------------------------------------------------------===//

#include "LoopReversal.h"

#include "Autodiff/DeadValues.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using namespace warp::autodiff;

//===----------------------------------------------------------------------===//
// Going forward
//===----------------------------------------------------------------------===//

SmallVector<unsigned> LoopReversal::closure(ArrayRef<unsigned> states) {
  auto filter = [&](Value value) {
    auto found = llvm::find(getStates(), value);
    return found == getStates().end() ||
           !hasClosedForm(found - getStates().begin());
  };
  auto uses = [&](Operation *op) { return reverse.getReplayUses(op); };
  Needs needs(loop, filter, uses);
  for (unsigned state : states)
    needs.mark(getStates()[state]);
  SmallVector<unsigned> all;
  for (auto [i, state] : llvm::enumerate(getStates()))
    if (needs.isNeeded(state))
      all.push_back(i);
  return all;
}

void LoopReversal::recoverStates(Value number, ArrayRef<unsigned> states,
                                 ValueRange values) {
  for (auto [i, state] : llvm::enumerate(getStates())) {
    auto known = llvm::find(states, i);
    Value value;
    if (known != states.end())
      value = values[known - states.begin()];
    else
      value = closedForm(i, number);
    reverse.setRecovered(state, value ? value : placeholder(state.getType()));
  }
}

SmallVector<Value> LoopReversal::recoverInits(ArrayRef<unsigned> states) {
  SmallVector<Value> inits;
  for (unsigned state : states)
    inits.push_back(reverse.recover(getInits()[state]));
  return inits;
}

/// Runs the iterations from `from` up to `to`. `visit` is called at the start
/// of each, when the states have been recovered. Returns the states at the end.
FailureOr<SmallVector<Value>>
LoopReversal::advance(Value from, Value to, ArrayRef<unsigned> states,
                      ValueRange values, function_ref<void(Value)> visit) {
  auto forward = scf::ForOp::create(b, loc, from, to, constant(to.getType(), 1),
                                    values, nullptr, /*unsignedCmp=*/true);
  OpBuilder::InsertionGuard guard(b);
  Block *body = forward.getBody();
  if (!body->empty())
    body->back().erase();
  b.setInsertionPointToEnd(body);
  Value count = forward.getInductionVar();
  recoverStates(count, states, forward.getRegionIterArgs());
  recoverIteration(count);
  visit(count);
  scf::IfOp made;
  if (ownTrips) {
    ValueRange unchanged = forward.getRegionIterArgs();
    made = scf::IfOp::create(b, loc, unchanged.getTypes(), isMade(count),
                             /*withElseRegion=*/true);
    b.setInsertionPointToStart(made.elseBlock());
    scf::YieldOp::create(b, loc, unchanged);
    b.setInsertionPointToStart(made.thenBlock());
  }
  if (failed(replayIteration()))
    return failure();
  SmallVector<Value> next;
  for (unsigned state : states)
    next.push_back(reverse.recover(getNexts()[state]));
  scf::YieldOp::create(b, loc, next);
  if (made) {
    b.setInsertionPointToEnd(body);
    scf::YieldOp::create(b, loc, made.getResults());
  }
  eraseDead(forward.getRegion());
  ++reverse.metrics.replayLoops;
  return SmallVector<Value>(forward.getResults());
}

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

/// A forward value that cannot be kept has no place in scratch memory.
LogicalResult LoopReversal::checkKept(ArrayRef<unsigned> states) {
  for (unsigned state : states)
    if (Type type = getStates()[state].getType();
        !isScalar(type) && !isComposite(type))
      return loop->emitError("the adjoint of this loop needs ")
             << type << " values that it carries, which cannot be kept; "
             << "choose the array outside of the loop, or by an index";
  return success();
}

int64_t LoopReversal::bytesOf(ArrayRef<unsigned> states) {
  int64_t bytes = 0;
  for (unsigned state : states)
    bytes += getByteSize(getStates()[state].getType());
  return bytes;
}

SmallVector<Value> LoopReversal::makeScratch(ArrayRef<unsigned> states,
                                             int64_t slots) {
  SmallVector<Value> memory;
  for (unsigned state : states) {
    Type type = getStates()[state].getType();
    memory.push_back(ScratchOp::create(
        b, loc, ScratchType::get(b.getContext(), slots, type)));
  }
  reverse.metrics.tapeBytes += bytesOf(states) * slots;
  return memory;
}

void LoopReversal::keep(ValueRange memory, Value slot, ValueRange values) {
  for (auto [scratch, value] : llvm::zip_equal(memory, values))
    ScratchStoreOp::create(b, loc, value, scratch, slot);
}

SmallVector<Value> LoopReversal::load(ValueRange memory, Value slot) {
  SmallVector<Value> values;
  for (Value scratch : memory) {
    Type type = cast<ScratchType>(scratch.getType()).getElementType();
    values.push_back(ScratchLoadOp::create(b, loc, type, scratch, slot));
  }
  return values;
}

/// Gives the needed states of the reverse loop what is in a slot.
void LoopReversal::loadNeeded(ArrayRef<unsigned> needed, ValueRange memory,
                              Value slot) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointAfterValue(slot);
  for (auto [state, value] : llvm::zip_equal(needed, load(memory, slot)))
    placeholders[state].replaceAllUsesWith(value);
}

/// The number of an iteration of the reverse loop: it counts down to the one
/// before `end`.
Value LoopReversal::bindNumber(scf::ForOp reversed, Value end) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(reversed);
  Value last = arith::SubIOp::create(b, loc, end, constant(end.getType(), 1));
  b.setInsertionPointToStart(reversed.getBody());
  auto count = arith::SubIOp::create(b, loc, last, reversed.getInductionVar());
  count->setAttr(attr::nonNegative, b.getUnitAttr());
  number.replaceAllUsesWith(count);
  return count;
}

//===----------------------------------------------------------------------===//
// In step
//===----------------------------------------------------------------------===//

/// True if the thread has made an iteration; always, for a thread alone.
Value LoopReversal::isMade(Value number) {
  auto compare = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult,
                                       number, ownTrips);
  compare->setAttr(attr::inStep, b.getUnitAttr());
  return compare;
}

/// Has a reverse loop do nothing in iterations that the thread has not made.
void LoopReversal::skipOthers(scf::ForOp reversed, Value number) {
  if (!ownTrips)
    return;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointAfterValue(number);
  ValueRange unchanged = reversed.getRegionIterArgs();
  auto made = scf::IfOp::create(b, loc, unchanged.getTypes(), isMade(number),
                                /*withElseRegion=*/true);
  Operation *yield = reversed.getBody()->getTerminator();
  Block *then = made.thenBlock();
  if (unchanged.empty()) {
    then->getTerminator()->erase();
    made.elseBlock()->getTerminator()->erase();
  }
  then->getOperations().splice(then->end(), reversed.getBody()->getOperations(),
                               std::next(made->getIterator()),
                               yield->getIterator());
  b.setInsertionPointToEnd(then);
  scf::YieldOp::create(b, loc, yield->getOperands());
  b.setInsertionPointToEnd(made.elseBlock());
  scf::YieldOp::create(b, loc, unchanged);
  yield->setOperands(made.getResults());
}

//===----------------------------------------------------------------------===//
// Rank 5
//===----------------------------------------------------------------------===//

static std::optional<int64_t> knownTrips(Value trips) {
  APInt count;
  if (!matchPattern(trips, m_ConstantInt(&count)))
    return std::nullopt;
  return count.getZExtValue();
}

/// True if so many iterations take little memory, or no more than checkpoints
/// would, which run the loop once more.
bool LoopReversal::fitsTape(int64_t trips, Type number,
                            ArrayRef<unsigned> needed) {
  if (trips > maxComponents)
    return false;
  int64_t bytes = trips * bytesOf(needed);
  return bytes <= reverse.options.maxLocalTape ||
         bytes <= checkpointBytes(needed, number);
}

bool LoopReversal::fitsTape(Value trips, ArrayRef<unsigned> needed) {
  std::optional<int64_t> count = knownTrips(trips);
  return count && fitsTape(*count, trips.getType(), needed);
}

LogicalResult LoopReversal::recoverFromTape(scf::ForOp reversed, Value trips,
                                            ArrayRef<unsigned> needed) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(reversed);
  int64_t slots = std::max<int64_t>(*knownTrips(trips), 1);
  SmallVector<Value> tape = makeScratch(needed, slots);
  SmallVector<unsigned> states = closure(needed);
  SmallVector<Value> first = recoverInits(states);
  auto end = advance(
      constant(trips.getType(), 0), trips, states, first, [&](Value count) {
        for (auto [state, memory] : llvm::zip(needed, tape))
          keep(memory, count, reverse.recover(getStates()[state]));
      });
  if (failed(end))
    return failure();
  startBackwards(reversed, states, *end);
  loadNeeded(needed, tape, bindNumber(reversed, trips));
  note(needed, RecoveryRank::Tape, slots * bytesOf(needed));
  return success();
}

/// A loop that is left by a condition, of a bounded number of iterations.
bool LoopReversal::fitsCountedTape(Value trips, ArrayRef<unsigned> needed) {
  std::optional<int64_t> most = getMostTrips();
  return most && fitsTape(*most, trips.getType(), needed);
}

/// The run that counts the iterations keeps their values.
void LoopReversal::recoverFromCountedTape(scf::ForOp reversed, Value trips,
                                          ArrayRef<unsigned> needed) {
  int64_t slots = std::max<int64_t>(*getMostTrips(), 1);
  SmallVector<Value> tape;
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPoint(getForwardSweep());
    tape = makeScratch(needed, slots);
  }
  keepWhileCounting(needed, tape);
  startBackwards(reversed, {}, {});
  Value count = bindNumber(reversed, trips);
  loadNeeded(needed, tape, count);
  skipOthers(reversed, count);
  note(needed, RecoveryRank::Tape, slots * bytesOf(needed));
}
