//===- ReverseWhile.cpp - Other loops, backwards --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loop with a condition, a break or a return: the front end carries flags and
// tests them in the condition. Whether there is another iteration is not known
// before the one is done, so a first replay counts the trips; after that the
// loop is a counted one. An iteration is what leads from one evaluation of the
// condition to the next: the region that evaluates it, then the body. The last
// evaluation, which ends the loop, is reversed first, on its own.
//
//===----------------------------------------------------------------------===//

#include "LoopReversal.h"

#include "DeadValues.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp::autodiff;

namespace {

class WhileReversal : public LoopReversal {
public:
  WhileReversal(ReverseBuilder &reverse, scf::WhileOp op)
      : LoopReversal(reverse, op), op(op) {}

  LogicalResult run();

private:
  ValueRange getStates() override { return op.getBeforeArguments(); }
  ValueRange getNexts() override { return op.getYieldOp().getResults(); }
  ValueRange getInits() override { return op.getInits(); }
  Value trace(Value value) override;
  LogicalResult replayIteration() override;
  LogicalResult reverseIteration() override;

  ValueRange getPassed() { return op.getConditionOp().getArgs(); }
  LogicalResult count();
  LogicalResult fillCondition(Block *block);
  LogicalResult fillBody(Block *block);

  scf::WhileOp op;
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

LogicalResult WhileReversal::replayIteration() {
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
  return reverse.reverse(*op.getBeforeBody());
}

//===----------------------------------------------------------------------===//
// Counting
//===----------------------------------------------------------------------===//

/// The replayed condition; passes on the count, the states and what the body
/// gets.
LogicalResult WhileReversal::fillCondition(Block *block) {
  b.setInsertionPointToEnd(block);
  ValueRange states = ValueRange(block->getArguments()).drop_front();
  for (auto [state, value] : llvm::zip_equal(getStates(), states))
    reverse.setRecovered(state, value);
  if (failed(reverse.replay(*op.getBeforeBody())))
    return failure();
  SmallVector<Value> passed(block->getArguments());
  for (Value value : getPassed())
    passed.push_back(reverse.recover(value));
  Value condition = reverse.recover(op.getConditionOp().getCondition());
  scf::ConditionOp::create(b, loc, condition, passed);
  return success();
}

LogicalResult WhileReversal::fillBody(Block *block) {
  b.setInsertionPointToEnd(block);
  ValueRange passed = ValueRange(block->getArguments())
                          .drop_front(1 + getStates().size());
  for (auto [argument, value] :
       llvm::zip_equal(op.getAfterArguments(), passed))
    reverse.setRecovered(argument, value);
  if (failed(reverse.replay(*op.getAfterBody())))
    return failure();
  Value number = block->getArgument(0);
  SmallVector<Value> next{arith::AddIOp::create(
      b, loc, number, constant(number.getType(), 1))};
  for (Value value : getNexts())
    next.push_back(reverse.recover(value));
  scf::YieldOp::create(b, loc, next);
  return success();
}

/// Runs the loop once to find `trips` and `final`.
LogicalResult WhileReversal::count() {
  OpBuilder::InsertionGuard guard(b);
  Location loc = op.getLoc();
  SmallVector<Value> inits{constant(b.getI64Type(), 0)};
  for (Value init : getInits())
    inits.push_back(reverse.recover(init));
  SmallVector<Type> carried(ValueRange(inits).getTypes());
  SmallVector<Type> passed(carried);
  for (Value value : getPassed())
    passed.push_back(value.getType());
  auto counting = scf::WhileOp::create(b, loc, passed, inits);
  Block *before =
      b.createBlock(&counting.getBefore(), {}, carried,
                    SmallVector<Location>(carried.size(), loc));
  if (failed(fillCondition(before)))
    return failure();
  Block *after = b.createBlock(&counting.getAfter(), {}, passed,
                               SmallVector<Location>(passed.size(), loc));
  if (failed(fillBody(after)))
    return failure();
  trips = counting.getResult(0);
  final.assign(counting.result_begin() + 1,
               counting.result_begin() + 1 + getStates().size());
  ++reverse.metrics.replayLoops;
  return success();
}

LogicalResult WhileReversal::run() {
  SmallVector<Value> given;
  for (Value result : op.getResults())
    given.push_back(reverse.takeCotangent(result));
  if (isZero(given))
    return success();
  if (failed(count()))
    return failure();
  for (auto [passed, cotangent] : llvm::zip_equal(getPassed(), given))
    reverse.addCotangent(passed, cotangent);
  for (auto [state, value] : llvm::zip_equal(getStates(), final))
    reverse.setRecovered(state, value);
  if (failed(reverse.replay(*op.getBeforeBody())) ||
      failed(reverse.reverse(*op.getBeforeBody())))
    return failure();
  SmallVector<Value> cotangents;
  for (Value state : getStates())
    cotangents.push_back(reverse.takeCotangent(state));
  return reverseAll(trips, cotangents);
}

LogicalResult warp::autodiff::reverseWhile(ReverseBuilder &reverse,
                                           scf::WhileOp op) {
  return WhileReversal(reverse, op).run();
}
