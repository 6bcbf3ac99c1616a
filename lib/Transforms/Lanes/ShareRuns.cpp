//===- ShareRuns.cpp - Lanes meet where they go through the same ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loop over the neighbours of a point goes through runs of a list: its
// condition looks for the next run when one has ended. Threads that follow each
// other have almost the same neighbours, yet as lanes they would be at
// different places of their runs, gather what they read, and look for runs at
// different times.
//
//     while (seek(place, end), place < end)      while (seek(..), place < end)
//       body(place)                         =>     while (place < end)
//       place += 1                                   u = agree(place, u)
//                                                    if (place == u)
//                                                      body(u);  place += 1
//                                                    u += 1
//
// So the lanes come to an element of the list together, what is there is read
// once for all of them, and they wait for each other at the ends of runs. Each
// lane does what it did, in its order. Lanes with nothing in common would take
// turns (0.6 of the speed on Zen 4, 3.5 times it for neighbours): only kernels
// whose threads follow the order of a hash grid are changed.
//
//===----------------------------------------------------------------------===//

#include "ShareRuns.h"

#include "Analysis/GeometryMemory.h"
#include "Analysis/ThreadVariance.h"
#include "WarpDialect/LaneOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using warp::ThreadVariance;

namespace {

/// A loop as above.
struct RunLoop {
  scf::WhileOp loop;
  /// Positions of place and end among the body's arguments.
  unsigned place = 0, end = 0;
  /// Which value of the last iteration each argument of the body is when no run
  /// is sought.
  SmallVector<unsigned> sources;

  Value next(unsigned argument) {
    return loop.getYieldOp()->getOperand(sources[argument]);
  }
  Value argument(unsigned i) { return loop.getAfterArguments()[i]; }
};

} // namespace

/// Whether a condition does not hold where place < end.
static bool meansEnd(Value condition, Value place, Value end) {
  Operation *op = condition.getDefiningOp();
  if (auto compare = dyn_cast_or_null<arith::CmpIOp>(op))
    return compare.getPredicate() == arith::CmpIPredicate::sge &&
           compare.getLhs() == place && compare.getRhs() == end;
  if (auto conjunction = dyn_cast_or_null<arith::AndIOp>(op))
    return meansEnd(conjunction.getLhs(), place, end) ||
           meansEnd(conjunction.getRhs(), place, end);
  auto branch = dyn_cast_or_null<scf::IfOp>(op);
  return branch && branch.elseBlock() &&
         matchPattern(branch.elseYield().getOperand(
                          cast<OpResult>(condition).getResultNumber()),
                      m_Zero()) &&
         meansEnd(branch.getCondition(), place, end);
}

/// The argument of a block that a value is; none if it is something else.
static std::optional<unsigned> argumentOf(Value value, Block *block) {
  auto argument = dyn_cast<BlockArgument>(value);
  if (!argument || argument.getOwner() != block)
    return std::nullopt;
  return argument.getArgNumber();
}

/// The argument of a loop that a value passed to its body is, as long as `seek`
/// has nothing to do.
static std::optional<unsigned> sourceOf(Value value, scf::WhileOp loop,
                                        scf::WhileOp seek) {
  auto result = dyn_cast<OpResult>(value);
  if (result && result.getOwner() == seek) {
    Value passed = seek.getConditionOp().getArgs()[result.getResultNumber()];
    auto own = argumentOf(passed, seek.getBeforeBody());
    if (!own)
      return std::nullopt;
    value = seek.getInits()[*own];
  }
  return argumentOf(value, loop.getBeforeBody());
}

static std::optional<RunLoop> findRuns(scf::WhileOp loop) {
  RunLoop found{loop};
  Block *before = loop.getBeforeBody();
  scf::ConditionOp condition = loop.getConditionOp();
  auto seek = dyn_cast<scf::WhileOp>(before->front());
  auto goesOn = condition.getCondition().getDefiningOp<arith::CmpIOp>();
  bool isPlain = seek && goesOn && seek->getNextNode() == goesOn &&
                 goesOn->getNextNode() == condition &&
                 goesOn.getPredicate() == arith::CmpIPredicate::slt;
  if (!isPlain)
    return std::nullopt;
  auto place = dyn_cast<OpResult>(goesOn.getLhs());
  auto end = dyn_cast<OpResult>(goesOn.getRhs());
  if (!place || !end || place.getOwner() != seek || end.getOwner() != seek)
    return std::nullopt;
  ValueRange passed = seek.getConditionOp().getArgs();
  if (!meansEnd(seek.getConditionOp().getCondition(),
                passed[place.getResultNumber()], passed[end.getResultNumber()]))
    return std::nullopt;
  llvm::SmallDenseSet<unsigned> covered;
  bool hasPlace = false, hasEnd = false;
  for (auto [i, value] : llvm::enumerate(condition.getArgs())) {
    auto source = sourceOf(value, loop, seek);
    if (!source)
      return std::nullopt;
    found.sources.push_back(*source);
    covered.insert(*source);
    if (value == place && !hasPlace)
      found.place = unsigned(i), hasPlace = true;
    if (value == end && !hasEnd)
      found.end = unsigned(i), hasEnd = true;
  }
  bool isWhole = covered.size() == before->getNumArguments();
  return hasPlace && hasEnd && isWhole ? std::optional(found) : std::nullopt;
}

/// Whether it pays: lanes have places of their own, go on by one, and read the
/// list there.
static bool pays(RunLoop &run, const ThreadVariance &variance) {
  Value place = run.argument(run.place);
  auto step = run.next(run.place).getDefiningOp<arith::AddIOp>();
  bool goesOn = step && step.getLhs() == place &&
                matchPattern(step.getRhs(), m_One()) &&
                run.next(run.end) == run.argument(run.end);
  auto reads = [&](Operation *user) {
    auto access = dyn_cast<warp::AccessOp>(user);
    return access && !access.mayWrite();
  };
  return goesOn && !variance.isUniform(place, warp::Scope::Lanes) &&
         llvm::any_of(place.getUsers(), reads);
}

static void share(RunLoop &run) {
  Location loc = run.loop.getLoc();
  Block *body = run.loop.getAfterBody();
  auto yield = cast<scf::YieldOp>(body->getTerminator());
  // What the runs change; the rest stays in the outer loop.
  SmallVector<unsigned> changed;
  SmallVector<Value> inits, next;
  for (unsigned i = 0; i < body->getNumArguments(); ++i)
    if (run.next(i) != run.argument(i)) {
      changed.push_back(i);
      inits.push_back(run.argument(i));
      next.push_back(run.next(i));
    }
  OpBuilder b(body, body->begin());
  Type type = run.argument(run.place).getType();
  inits.push_back(
      arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, -1)));
  SmallVector<Type> types(ValueRange(inits).getTypes());
  SmallVector<Location> locations(types.size(), loc);
  auto inner = scf::WhileOp::create(b, loc, types, inits);
  unsigned at = unsigned(llvm::find(changed, run.place) - changed.begin());

  Block *before = b.createBlock(&inner.getBefore(), {}, types, locations);
  Value left =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt,
                            before->getArgument(at), run.argument(run.end));
  scf::ConditionOp::create(b, loc, left, before->getArguments());

  Block *after = b.createBlock(&inner.getAfter(), {}, types, locations);
  ValueRange own = after->getArguments().drop_back();
  Value u =
      warp::AgreeOp::create(b, loc, own[at], after->getArguments().back());
  Value isHere =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, own[at], u);
  auto branch = scf::IfOp::create(b, loc, own.getTypes(), isHere,
                                  /*withElseRegion=*/true);
  Value one = arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, 1));
  SmallVector<Value> passed(branch.getResults());
  passed.push_back(arith::AddIOp::create(b, loc, u, one));
  scf::YieldOp::create(b, loc, passed);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, own);

  Block *then = branch.thenBlock();
  then->getOperations().splice(then->begin(), body->getOperations(),
                               std::next(inner->getIterator()),
                               yield->getIterator());
  b.setInsertionPointToEnd(then);
  scf::YieldOp::create(b, loc, next);
  for (auto [i, number] : llvm::enumerate(changed)) {
    Value value = i == at ? u : own[i];
    run.argument(number).replaceUsesWithIf(value, [&](OpOperand &use) {
      return branch->isProperAncestor(use.getOwner());
    });
  }
  for (unsigned k = 0; k < yield->getNumOperands(); ++k) {
    unsigned i = unsigned(llvm::find(run.sources, k) - run.sources.begin());
    auto place = llvm::find(changed, i);
    yield->setOperand(k, place == changed.end()
                             ? run.argument(i)
                             : inner.getResult(place - changed.begin()));
  }
}

/// Whether threads that follow each other take points that do in a grid.
static bool followsGrid(FunctionOpInterface kernel,
                        const ThreadVariance &variance) {
  auto found = kernel->walk([&](warp::LoadComponentsOp load) {
    bool isOrder = warp::isGeometryMemory(load.getArray()) &&
                   variance.step(load.getIndices().back()) == 1;
    return isOrder ? WalkResult::interrupt() : WalkResult::advance();
  });
  return found.wasInterrupted();
}

bool warp::shareRuns(FunctionOpInterface kernel,
                     const ThreadVariance &variance) {
  if (!followsGrid(kernel, variance))
    return false;
  SmallVector<RunLoop> runs;
  kernel->walk([&](scf::WhileOp loop) {
    if (auto run = findRuns(loop); run && pays(*run, variance))
      runs.push_back(*run);
  });
  for (RunLoop &run : runs)
    share(run);
  return !runs.empty();
}
