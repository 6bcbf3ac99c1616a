//===- ReverseWhile.cpp - Reversal of while loops -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loop with a condition, a break or a return: the front end carries flags and
// tests them in the condition. True if there is another iteration is not known
// before the one is done, so the replay counts the trips; after that the loop
// is a counted one. An iteration is what leads from one evaluation of the
// condition to the next: the region that evaluates it, then the body. The last
// evaluation, which ends the loop, is reversed first, on its own.
//
// Mostly the condition is about integers. Then an iteration is drafted without
// what evaluates it, and if the reverse only adds, it is a loop with the same
// condition: nobody has to count.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/Loops/LoopReversal.h"

#include "Analysis/Effects.h"
#include "Analysis/Forms.h"
#include "Autodiff/DeadValues.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp::autodiff;

namespace {

class WhileReversal : public LoopReversal {
public:
  WhileReversal(ReverseBuilder &reverse, scf::WhileOp op)
      : LoopReversal(reverse, op), op(op), decidesApart(isApart()) {}

  LogicalResult run();

private:
  ValueRange getStates() override { return op.getBeforeArguments(); }
  ValueRange getNexts() override { return op.getYieldOp().getResults(); }
  ValueRange getInits() override { return op.getInits(); }
  Value getFinal(unsigned state) override { return final[state]; }
  Value trace(Value value) override;
  LogicalResult replayIteration() override;
  LogicalResult reverseIteration() override;
  LogicalResult completeDraft() override;
  bool mayEndApart() override { return true; }
  std::optional<int64_t> getMostTrips() override;
  Operation *getForwardSweep() override { return counting; }
  void keepWhileCounting(ArrayRef<unsigned> states, ValueRange tape) override;
  bool mayRunAlong(scf::ForOp reversed) override;
  FailureOr<SmallVector<Value>> runAlong(scf::ForOp reversed) override;

  ValueRange getPassed() { return op.getConditionOp().getArgs(); }
  bool isApart();
  LogicalResult reverseLast(ArrayRef<Value> given);
  LogicalResult replayCondition(scf::WhileOp made, ArrayRef<unsigned> states,
                                ArrayRef<unsigned> passed);
  void count();

  scf::WhileOp op, counting;
  /// The evaluation of the condition has no derivative and no effect.
  bool decidesApart;
  /// The iterations are those of the first draft: without the condition.
  bool isDraft = false;
  /// Number of iterations, and the states after the last.
  Value trips;
  SmallVector<Value> final;
};

} // namespace

/// The body gets what the condition passes on, mostly the state itself.
Value WhileReversal::trace(Value value) {
  auto argument = dyn_cast<BlockArgument>(value);
  if (argument && argument.getOwner() == op.getAfterBody())
    return getPassed()[argument.getArgNumber()];
  return value;
}

bool WhileReversal::isApart() {
  for (Value passed : getPassed())
    if (reverse.isActive(passed) && !isa<BlockArgument>(passed))
      return false;
  auto result = op.getBefore().walk([&](Operation *inner) {
    bool matters = hasOwnEffect(inner) ||
                   llvm::any_of(inner->getResults(), [&](Value value) {
                     return reverse.isActive(value);
                   });
    if (warp::isPlainRead(inner))
      matters |= !!warp::rootOf(cast<warp::AccessOp>(inner).getArray())
                       .getDefiningOp<warp::GradOp>();
    return matters ? WalkResult::interrupt() : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

LogicalResult WhileReversal::replayIteration() {
  if (isDraft) {
    for (BlockArgument argument : op.getAfterArguments()) {
      drafted.push_back(placeholder(argument.getType()));
      reverse.setRecovered(argument, drafted.back());
    }
    return reverse.replay(*op.getAfterBody());
  }
  if (failed(reverse.replay(*op.getBeforeBody())))
    return failure();
  for (auto [argument, passed] :
       llvm::zip_equal(op.getAfterArguments(), getPassed()))
    reverse.setRecovered(argument, reverse.recover(passed));
  return reverse.replay(*op.getAfterBody());
}

LogicalResult WhileReversal::reverseIteration() {
  if (failed(reverse.reverse(*op.getAfterBody())))
    return failure();
  for (auto [argument, passed] :
       llvm::zip_equal(op.getAfterArguments(), getPassed()))
    reverse.addCotangent(passed, reverse.takeCotangent(argument));
  return isDraft ? success() : reverse.reverse(*op.getBeforeBody());
}

/// Puts what evaluates the condition in front of the iteration.
LogicalResult WhileReversal::completeDraft() {
  if (!isDraft)
    return success();
  isDraft = false;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointAfterValue(drafted.back());
  if (failed(reverse.replay(*op.getBeforeBody())))
    return failure();
  for (auto [draft, passed] : llvm::zip_equal(drafted, getPassed()))
    draft.replaceAllUsesWith(reverse.recover(passed));
  return success();
}

//===----------------------------------------------------------------------===//
// Without counting
//===----------------------------------------------------------------------===//

/// Fills the region that decides: the states are the last arguments.
LogicalResult WhileReversal::replayCondition(scf::WhileOp made,
                                             ArrayRef<unsigned> states,
                                             ArrayRef<unsigned> passed) {
  TypeRange types = made.getInits().getTypes();
  OpBuilder::InsertionGuard guard(b);
  Block *before = b.createBlock(&made.getBefore(), {}, types,
                                SmallVector<Location>(types.size(), loc));
  ValueRange arguments = before->getArguments();
  for (auto [state, value] :
       llvm::zip_equal(states, arguments.take_back(states.size())))
    reverse.setRecovered(getStates()[state], value);
  if (failed(reverse.replay(*op.getBeforeBody())))
    return failure();
  SmallVector<Value> forwarded(arguments.drop_back(states.size()));
  for (unsigned i : passed)
    forwarded.push_back(reverse.recover(getPassed()[i]));
  Value condition = reverse.recover(op.getConditionOp().getCondition());
  scf::ConditionOp::create(b, loc, condition, forwarded);
  return success();
}

/// True if every iteration has the same value.
static bool isInvariant(Value value, Operation *loop) {
  if (!loop->isAncestor(value.getParentRegion()->getParentOp()))
    return true;
  Operation *op = value.getDefiningOp();
  return op && !isa<UnrealizedConversionCastOp>(op) &&
         op->getNumRegions() == 0 && isMemoryEffectFree(op) &&
         llvm::all_of(op->getOperands(),
                      [&](Value v) { return isInvariant(v, loop); });
}

/// Not if sums to one element may leave the loop, which counted ones let them.
bool WhileReversal::mayRunAlong(scf::ForOp reversed) {
  auto mayLeave = [&](warp::AccumulateOp sum) {
    return isInvariant(sum.getArray(), reversed) &&
                   llvm::all_of(sum.getIndices(),
                                [&](Value index) {
                                  return isInvariant(index, reversed);
                                })
               ? WalkResult::interrupt()
               : WalkResult::advance();
  };
  return isDraft && needsNoState() && !reversed.walk(mayLeave).wasInterrupted();
}

FailureOr<SmallVector<Value>> WhileReversal::runAlong(scf::ForOp reversed) {
  isDraft = false;
  auto uses = [&](Operation *inner) { return reverse.getReplayUses(inner); };
  Needs needs(op, /*filter=*/nullptr, uses);
  needs.mark(op.getConditionOp().getCondition());
  for (auto [draft, value] : llvm::zip_equal(drafted, getPassed()))
    if (!draft.use_empty())
      needs.mark(value);
  auto neededOf = [&](ValueRange values) {
    SmallVector<unsigned> found;
    for (auto [i, value] : llvm::enumerate(values))
      if (needs.isNeeded(value))
        found.push_back(i);
    return found;
  };
  SmallVector<unsigned> states = neededOf(getStates());
  SmallVector<unsigned> passed;
  for (auto [i, draft] : llvm::enumerate(drafted))
    if (!draft.use_empty() || needs.isNeeded(op.getAfterArguments()[i]))
      passed.push_back(i);

  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(reversed);
  unsigned sums = reversed.getInitArgs().size();
  SmallVector<Value> inits(reversed.getInitArgs());
  llvm::append_range(inits, recoverInits(states));
  SmallVector<Type> types(reversed.getResultTypes());
  for (unsigned i : passed)
    types.push_back(getPassed()[i].getType());
  auto made = scf::WhileOp::create(b, loc, types, inits);
  if (failed(replayCondition(made, states, passed)))
    return failure();

  Block *after = b.createBlock(&made.getAfter(), {}, types,
                               SmallVector<Location>(types.size(), loc));
  ValueRange given = ValueRange(after->getArguments()).drop_front(sums);
  for (auto [i, value] : llvm::zip_equal(passed, given)) {
    reverse.setRecovered(op.getAfterArguments()[i], value);
    drafted[i].replaceAllUsesWith(value);
  }
  // The next states first: what they read is not added to yet.
  if (failed(reverse.replay(*op.getAfterBody())))
    return failure();
  Block *body = reversed.getBody();
  for (auto [old, value] :
       llvm::zip_equal(reversed.getRegionIterArgs(),
                       ValueRange(after->getArguments()).take_front(sums)))
    old.replaceAllUsesWith(value);
  SmallVector<Value> next(body->getTerminator()->getOperands());
  for (unsigned state : states)
    next.push_back(reverse.recover(getNexts()[state]));
  body->getTerminator()->erase();
  after->getOperations().splice(after->end(), body->getOperations());
  b.setInsertionPointToEnd(after);
  scf::YieldOp::create(b, loc, next);
  reversed.erase();
  eraseDead(made.getBefore(), getHeld());
  eraseDead(made.getAfter(), getHeld());
  note(states, RecoveryRank::CarriedAlong, 0);
  --reverse.metrics.replayLoops;
  return SmallVector<Value>(made.getResults().take_front(sums));
}

//===----------------------------------------------------------------------===//
// Counting
//===----------------------------------------------------------------------===//

/// Has the replay of the loop find `trips` and `final`, by carrying a counter
/// and passing it on with the states. Unused parts of that are removed by
/// dead-code elimination takes away again.
void WhileReversal::count() {
  auto replayed =
      cast<scf::WhileOp>(reverse.recover(op.getResult(0)).getDefiningOp());
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(replayed);
  Type type = b.getI64Type();
  SmallVector<Value> inits(replayed.getInits());
  inits.push_back(constant(type, 0));
  SmallVector<Type> types(replayed.getResultTypes());
  types.push_back(type);
  llvm::append_range(types, getStates().getTypes());
  counting = scf::WhileOp::create(b, loc, types, inits);
  counting.getBefore().takeBody(replayed.getBefore());
  counting.getAfter().takeBody(replayed.getAfter());

  Block *before = counting.getBeforeBody(), *after = counting.getAfterBody();
  SmallVector<Value> more{before->addArgument(type, loc)};
  llvm::append_range(more, ValueRange(before->getArguments()).drop_back());
  counting.getConditionOp().getArgsMutable().append(more);
  Value number = after->addArgument(type, loc);
  for (Type state : getStates().getTypes())
    after->addArgument(state, loc);
  scf::YieldOp yield = counting.getYieldOp();
  b.setInsertionPoint(yield);
  Value next = arith::AddIOp::create(b, loc, number, constant(type, 1));
  yield.getResultsMutable().append(next);

  ValueRange results = counting.getResults();
  unsigned given = op.getNumResults();
  replayed.replaceAllUsesWith(results.take_front(given));
  replayed.erase();
  reverse.setRecovered(op.getResults(), results.take_front(given));
  trips = results[given];
  llvm::append_range(final, results.drop_front(given + 1));
  ++reverse.metrics.replayLoops;
}

/// The body has the number and the states as its last arguments.
void WhileReversal::keepWhileCounting(ArrayRef<unsigned> states,
                                      ValueRange tape) {
  OpBuilder::InsertionGuard guard(b);
  Block *body = counting.getAfterBody();
  b.setInsertionPointToStart(body);
  unsigned first = body->getNumArguments() - getStates().size();
  SmallVector<Value> values;
  for (unsigned state : states)
    values.push_back(body->getArgument(first + state));
  Value slot = body->getArgument(first - 1);
  for (auto [memory, value] : llvm::zip_equal(tape, values))
    keep(memory, slot, value);
}

/// The largest value of an integer that is a constant, or one of several.
static std::optional<int64_t> findMost(Value value) {
  if (auto constant = warp::getConstantInteger(value))
    return constant;
  auto choice = value.getDefiningOp<warp::WhereOp>();
  if (!choice)
    return std::nullopt;
  auto x = findMost(choice->getOperand(1)), y = findMost(choice->getOperand(2));
  return x && y ? std::optional(std::max(*x, *y)) : std::nullopt;
}

/// True if a counter below `most` may leave its type with the next step, and
/// be below again.
static bool mayWrap(Type type, int64_t most, int64_t step) {
  unsigned bits = type.getIntOrFloatBitWidth();
  auto largest = type.isUnsignedInteger() ? APInt::getMaxValue(bits)
                                          : APInt::getSignedMaxValue(bits);
  APInt last = APInt(128, most, /*isSigned=*/true) - 1 + step;
  return last.sgt(largest.zext(128));
}

/// How often `index < bound` can hold for a state that grows by a constant in
/// each iteration; none if that is not known.
static std::optional<int64_t> countBelow(scf::WhileOp op, Value index,
                                         Value bound,
                                         function_ref<Value(Value)> trace) {
  auto state = dyn_cast<BlockArgument>(index);
  if (!state || state.getOwner() != op.getBeforeBody())
    return std::nullopt;
  unsigned number = state.getArgNumber();
  auto next = op.getYieldOp().getResults()[number].getDefiningOp<warp::AddOp>();
  auto first = warp::getConstantInteger(op.getInits()[number]);
  auto most = findMost(bound);
  if (!next || !first || !most)
    return std::nullopt;
  for (unsigned i : {0, 1}) {
    auto step = warp::getConstantInteger(next->getOperand(1 - i));
    if (step && *step > 0 && trace(next->getOperand(i)) == state &&
        !mayWrap(index.getType(), *most, *step))
      return std::max<int64_t>(llvm::divideCeilSigned(*most - *first, *step),
                               0);
  }
  return std::nullopt;
}

/// One part of the condition has to compare a counter with a constant.
std::optional<int64_t> WhileReversal::getMostTrips() {
  SmallVector<Value> parts{op.getConditionOp().getCondition()};
  while (!parts.empty()) {
    Operation *part = parts.pop_back_val().getDefiningOp();
    if (!part)
      continue;
    if (isa<warp::BitAndOp, arith::AndIOp>(part))
      llvm::append_range(parts, part->getOperands());
    else if (isa<warp::LtOp>(part))
      if (auto count = countBelow(op, part->getOperand(0), part->getOperand(1),
                                  [&](Value value) { return trace(value); }))
        return count;
  }
  return std::nullopt;
}

/// The evaluation of the condition that ends the loop.
LogicalResult WhileReversal::reverseLast(ArrayRef<Value> given) {
  for (auto [passed, cotangent] : llvm::zip_equal(getPassed(), given))
    reverse.addCotangent(passed, cotangent);
  if (decidesApart)
    return success();
  for (auto [state, value] : llvm::zip_equal(getStates(), final))
    reverse.setRecovered(state, value);
  return success(succeeded(reverse.replay(*op.getBeforeBody())) &&
                 succeeded(reverse.reverse(*op.getBeforeBody())));
}

LogicalResult WhileReversal::run() {
  SmallVector<Value> given;
  for (Value result : op.getResults())
    given.push_back(reverse.takeCotangent(result));
  if (isZero(given))
    return success();
  if (op.getNumResults() == 0)
    return op.emitError("the trip count of this loop depends on memory that "
                        "the kernel writes; keep the operands of its "
                        "condition in variables");
  count();
  if (failed(reverseLast(given)))
    return failure();
  isDraft = decidesApart;
  SmallVector<Value> cotangents;
  for (Value state : getStates())
    cotangents.push_back(reverse.takeCotangent(state));
  return reverseAll(trips, cotangents);
}

LogicalResult warp::autodiff::reverseWhile(ReverseBuilder &reverse,
                                           scf::WhileOp op) {
  return WhileReversal(reverse, op).run();
}
