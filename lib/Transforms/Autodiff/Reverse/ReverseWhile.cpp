//===- ReverseWhile.cpp - Other loops, backwards --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loop with a condition, a break or a return: the front end carries flags and
// tests them in the condition. Whether there is another iteration is not known
// before the one is done, so the replay counts the trips; after that the loop
// is a counted one. An iteration is what leads from one evaluation of the
// condition to the next: the region that evaluates it, then the body. The last
// evaluation, which ends the loop, is reversed first, on its own.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/Loops/LoopReversal.h"

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
  Value getFinal(unsigned state) override { return final[state]; }
  Value trace(Value value) override;
  LogicalResult replayIteration() override;
  LogicalResult reverseIteration() override;

  ValueRange getPassed() { return op.getConditionOp().getArgs(); }
  void count();

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

/// Has the replay of the loop find `trips` and `final`, by carrying a counter
/// and passing it on with the states. What of that nobody uses, dead code
/// elimination takes away again.
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
  auto counting = scf::WhileOp::create(b, loc, types, inits);
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

LogicalResult WhileReversal::run() {
  SmallVector<Value> given;
  for (Value result : op.getResults())
    given.push_back(reverse.takeCotangent(result));
  if (isZero(given))
    return success();
  if (op.getNumResults() == 0)
    return op.emitError("how often this loop runs depends on memory that the "
                        "kernel changes; keep what its condition tests in a "
                        "variable");
  count();
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
