//===- WidenTurns.cpp - Lanes that take one thread after the other --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Where threads leave a loop after very different numbers of iterations, a
// vector of them runs as long as the slowest, mostly for a few lanes. A lane
// that is done may take another thread instead:
//
//     before the loop (p)          while any thread is left:
//     while c: body           =>     p, for lanes that begin a thread
//     after it (e)                   while any lane runs, and not half of them
//                                        wait for a next thread: body
//                                    e, for lanes that have left the loop
//
// Lane l of W takes the threads l, l + W, l + 2 W ... of a stretch. Lanes are
// in different iterations then, so that what counts iterations differs among
// them, too, and elements are gathered. The loop must not change memory: it is
// entered again with what lanes held when others left, and so its condition is
// found twice. A thread changes memory after it, so it keeps the order of its
// own accesses.
//
//===----------------------------------------------------------------------===//

#include "Analysis/CostModel.h"
#include "LanePlan.h"
#include "Widening.h"

#include "mlir/Dialect/Math/IR/Math.h"

using namespace mlir;
using warp::Widening;

//===----------------------------------------------------------------------===//
// Whether
//===----------------------------------------------------------------------===//

/// Whether an operation does no more to memory than load.
static bool isRepeatable(Operation *op) {
  return isa<warp::LoadComponentsOp>(op) || op->getNumRegions() != 0 ||
         isMemoryEffectFree(op);
}

/// Rough cycles of the operations of a block and of those inside.
static double costOf(Operation *op) {
  double cost = 0;
  op->walk([&](Operation *inner) {
    bool isCall = isa<math::MathDialect>(inner->getDialect()) &&
                  !isa<math::AbsFOp, math::FmaOp, math::FloorOp, math::CeilOp,
                       math::CopySignOp, math::SqrtOp>(inner);
    if (auto access = dyn_cast<warp::AccessOp>(inner))
      cost += warp::cost::turnAccess;
    else
      cost += isCall ? warp::cost::callCost : 1;
  });
  return cost;
}

/// Whether it is data that ends a loop, and not where the thread is: neighbours
/// in a picture or a grid leave together for the most part.
static bool endsByData(scf::WhileOp loop) {
  SmallVector<Value> pending{loop.getConditionOp().getCondition()};
  llvm::DenseSet<Value> seen;
  while (!pending.empty()) {
    Value next = pending.pop_back_val();
    if (!seen.insert(next).second)
      continue;
    Operation *op = next.getDefiningOp();
    if (auto argument = dyn_cast<BlockArgument>(next)) {
      unsigned number = argument.getArgNumber();
      if (argument.getOwner() == loop.getBeforeBody())
        pending.append({loop.getInits()[number],
                        loop.getYieldOp().getOperand(number)});
      else if (argument.getOwner() == loop.getAfterBody())
        pending.push_back(loop.getConditionOp().getArgs()[number]);
      continue;
    }
    if (isa<warp::LoadComponentsOp>(op))
      return true;
    llvm::append_range(pending, op->getOperands());
    if (auto branch = dyn_cast<scf::IfOp>(op)) {
      unsigned number = cast<OpResult>(next).getResultNumber();
      pending.append({branch.thenYield().getOperand(number),
                      branch.elseYield().getOperand(number)});
    }
  }
  return false;
}

scf::WhileOp warp::findTurns(ThreadsOp threads,
                             const ThreadVariance &variance) {
  scf::WhileOp found;
  double others = 0;
  if (threads.getNumResults() != 0)
    return {};
  for (Operation &op : threads.getThread()->without_terminator()) {
    auto loop = dyn_cast<scf::WhileOp>(op);
    if (loop && !found && variance.isDivergent(loop)) {
      found = loop;
      continue;
    }
    bool fits = true;
    op.walk([&](Operation *inner) {
      fits &= !isa<scf::ForOp, scf::WhileOp, ScratchOp>(inner) &&
              (found || isRepeatable(inner));
    });
    if (!fits)
      return {};
    others += costOf(&op);
  }
  if (!found)
    return {};
  bool fits = llvm::all_of(found.getResults(), [&](Value result) {
    return result.use_empty() || !variance.isUniform(result, Scope::Lanes);
  });
  found->walk([&](Operation *op) {
    bool isInner = op != found && isa<scf::ForOp, scf::WhileOp>(op);
    fits &= !isInner && isRepeatable(op);
  });
  double body = costOf(found);
  return fits && endsByData(found) && body >= cost::leastTurn && others <= cost::mostBetween * body
             ? found
             : scf::WhileOp();
}

//===----------------------------------------------------------------------===//
// How
//===----------------------------------------------------------------------===//

namespace {
/// Vectors that turns hand on.
using Vectors = SmallVector<Value>;
} // namespace

static bool isIn(Operation *op, Operation *container) {
  return container->isAncestor(op);
}

/// Results of operations before the loop that it uses, or what comes after it.
static SmallVector<Value> findKept(scf::WhileOp loop,
                                   function_ref<bool(Value)> isVarying) {
  SmallVector<Value> kept;
  for (Operation &op : *loop->getBlock()) {
    if (&op == loop)
      break;
    for (Value result : op.getResults()) {
      bool isUsed = llvm::any_of(result.getUsers(), [&](Operation *user) {
        Operation *top = loop->getBlock()->findAncestorOpInBlock(*user);
        bool isInit = user == loop;
        return !isInit && (isIn(user, loop) || loop->isBeforeInBlock(top));
      });
      if (isUsed && isVarying(result))
        kept.push_back(result);
    }
  }
  return kept;
}

Value Widening::zeros(Type type) {
  return arith::ConstantOp::create(b, loc, b.getZeroAttr(type));
}

/// Begins threads in the lanes `fresh`: the loop's arguments, and what is kept.
Vectors Widening::beginTurn(scf::WhileOp loop, Value fresh,
                            ArrayRef<Value> carried, ArrayRef<Value> kept,
                            ValueRange old) {
  auto branch = scf::IfOp::create(b, loc, old.getTypes(), any(fresh),
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, old);
  b.setInsertionPointToStart(branch.thenBlock());
  mask = fresh;
  for (Operation &op : *loop->getBlock()) {
    if (&op == loop)
      break;
    if (variesInTurns(&op))
      widen(&op);
  }
  loc = loop.getLoc();
  Vectors begun;
  for (Value argument : carried) {
    unsigned number = cast<BlockArgument>(argument).getArgNumber();
    begun.push_back(vector(loop.getInits()[number]));
  }
  for (Value value : kept)
    begun.push_back(vector(value));
  for (auto [value, before] : llvm::zip_equal(begun, old))
    value = choose(fresh, value, before);
  scf::YieldOp::create(b, loc, begun);
  return Vectors(branch.getResults());
}

/// Whether the lanes `go` run on: some do, and not half of all wait. As long as
/// all lanes have threads, those that do not run are those that wait.
Value Widening::goesOn(Value live, Value go, Value next) {
  auto atLeast = [&](Value lanesIn, int64_t least) -> Value {
    return warp::AnyOp::create(b, loc, b.getI1Type(), lanesIn, least);
  };
  auto branch = scf::IfOp::create(b, loc, b.getI1Type(), atLeast(live, lanes),
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(b, loc, atLeast(go, lanes / 2 + 1));
  b.setInsertionPointToStart(branch.elseBlock());
  Value waits = atLeast(without(next, go), lanes / 2);
  Value none = arith::ConstantOp::create(b, loc, b.getBoolAttr(false));
  scf::YieldOp::create(
      b, loc,
      ValueRange(arith::SelectOp::create(b, loc, waits, none, any(go))));
  return branch.getResult(0);
}

/// The loop, for the lanes `live`, until half of them wait: lanes of `next` have
/// another thread to take. Results are the lanes that are still in it, the
/// arguments that these go on with, and what the others leave with.
Vectors Widening::runTurns(scf::WhileOp loop, Value live, Value next,
                           ArrayRef<Value> carried, ArrayRef<Value> results,
                           ValueRange begun) {
  Vectors inits{live};
  llvm::append_range(inits, begun);
  for (Value result : results)
    inits.push_back(zeros(lanesOf(result.getType())));
  SmallVector<Type> beforeTypes(ValueRange(inits).getTypes());
  SmallVector<Type> afterTypes = beforeTypes;
  unsigned own = beforeTypes.size();
  llvm::append_range(afterTypes, formTypes(loop.getAfterArguments()));
  auto made = scf::WhileOp::create(b, loc, afterTypes, inits);
  OpBuilder::InsertionGuard guard(b);

  Block *before =
      b.createBlock(&made.getBefore(), {}, beforeTypes,
                    SmallVector<Location>(beforeTypes.size(), loc));
  mask = before->getArgument(0);
  for (auto [i, argument] : llvm::enumerate(carried))
    setVector(argument, before->getArgument(1 + i));
  widen(*loop.getBeforeBody());
  loc = loop.getLoc();
  scf::ConditionOp condition = loop.getConditionOp();
  Value was = before->getArgument(0);
  Value go = both(was, vector(condition.getCondition()));
  Vectors forms{go};
  for (unsigned i = 0; i < carried.size(); ++i)
    forms.push_back(before->getArgument(1 + i));
  for (auto [i, result] : llvm::enumerate(results)) {
    unsigned number = cast<OpResult>(result).getResultNumber();
    forms.push_back(choose(was, vector(condition.getArgs()[number]),
                           before->getArgument(1 + carried.size() + i)));
  }
  for (auto [argument, value] :
       llvm::zip_equal(loop.getAfterArguments(), condition.getArgs()))
    appendForms(argument, value, forms);
  scf::ConditionOp::create(b, loc, goesOn(live, go, next), forms);

  Block *after = b.createBlock(&made.getAfter(), {}, afterTypes,
                               SmallVector<Location>(afterTypes.size(), loc));
  mask = after->getArgument(0);
  takeForms(loop.getAfterArguments(), after->getArguments().drop_front(own));
  widen(*loop.getAfterBody());
  loc = loop.getLoc();
  Vectors yielded(after->getArguments().take_front(own));
  for (auto [i, argument] : llvm::enumerate(carried)) {
    unsigned number = cast<BlockArgument>(argument).getArgNumber();
    yielded[1 + i] = vector(loop.getYieldOp().getOperand(number));
  }
  scf::YieldOp::create(b, loc, yielded);
  return Vectors(made.getResults().take_front(own));
}

bool Widening::variesInTurns(Operation *op) {
  return op->walk([&](Operation *inner) {
             return llvm::any_of(inner->getResults(),
                                 [&](Value v) { return isVarying(v); })
                        ? WalkResult::interrupt()
                        : WalkResult::advance();
           })
      .wasInterrupted();
}

/// What all threads share does not wait for lanes to begin one.
void Widening::widenBefore(scf::WhileOp loop) {
  for (Operation &op : *loop->getBlock()) {
    if (&op == loop)
      break;
    if (!variesInTurns(&op))
      widen(&op);
  }
  for (auto [argument, init] :
       llvm::zip_equal(loop.getBeforeArguments(), loop.getInits()))
    if (!isVarying(argument))
      setScalar(argument, scalar(init));
}

void Widening::takeTurns(scf::WhileOp loop, int64_t turns) {
  inTurns = true;
  ThreadsOp made = makeThreads(b.getI64IntegerAttr(turns));
  Value first = made.getIndices().back();
  Value limit = broadcast(made.getCount());
  Value live = mask;
  Type number = first.getType();
  Value place = warp::LaneNumbersOp::create(b, loc, lanesOf(number));
  Value width = splat(b.getIntegerAttr(number, lanes));
  widenBefore(loop);
  loc = loop.getLoc();
  SmallVector<Value> carried, results;
  for (Value argument : loop.getBeforeArguments())
    if (isVarying(argument))
      carried.push_back(argument);
  for (Value result : loop.getResults())
    if (!result.use_empty())
      results.push_back(result);
  SmallVector<Value> kept =
      findKept(loop, [&](Value value) { return isVarying(value); });

  Vectors inits{live, place, zeros(live.getType())};
  for (ArrayRef<Value> list : {ArrayRef(carried), ArrayRef(kept)})
    for (Value value : list)
      inits.push_back(zeros(lanesOf(value.getType())));
  SmallVector<Type> types(ValueRange(inits).getTypes());
  SmallVector<Location> locations(types.size(), loc);
  auto outer = scf::WhileOp::create(b, loc, types, inits);
  Block *before = b.createBlock(&outer.getBefore(), {}, types, locations);
  scf::ConditionOp::create(b, loc, any(before->getArgument(0)),
                           before->getArguments());
  Block *after = b.createBlock(&outer.getAfter(), {}, types, locations);
  live = after->getArgument(0);
  place = after->getArgument(1);
  Value running = after->getArgument(2);
  setVector(threads.getIndices().back(),
            arith::AddIOp::create(b, loc, broadcast(first), place));
  Value following = arith::AddIOp::create(b, loc, place, width);
  Value next = both(live, arith::CmpIOp::create(
                              b, loc, arith::CmpIPredicate::slt, following,
                              limit));
  Vectors begun = beginTurn(loop, without(live, running), carried, kept,
                            after->getArguments().drop_front(3));
  auto state = ArrayRef(begun).take_front(carried.size());
  for (auto [value, now] :
       llvm::zip_equal(kept, ArrayRef(begun).drop_front(carried.size())))
    setVector(value, now);
  Vectors left = runTurns(loop, live, next, carried, results, state);
  Value go = left[0], done = without(live, go);
  for (auto [i, result] : llvm::enumerate(results))
    setVector(result, left[1 + carried.size() + i]);
  mask = done;
  for (Operation *op = loop->getNextNode(); !op->hasTrait<OpTrait::IsTerminator>();
       op = op->getNextNode())
    widen(op);
  loc = loop.getLoc();
  Vectors yielded{arith::OrIOp::create(b, loc, go, both(done, next)),
                  choose(done, following, place), go};
  llvm::append_range(yielded, ArrayRef(left).slice(1, carried.size()));
  llvm::append_range(yielded, ArrayRef(begun).drop_front(carried.size()));
  scf::YieldOp::create(b, loc, yielded);
  b.setInsertionPointToEnd(body);
  warp::YieldOp::create(b, loc, ValueRange());
  threads->replaceAllUsesWith(made);
  threads->erase();
}
