//===- ShareRuns.cpp - Reconvergence in neighbour loops -------------------===//
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
#include "RunLoop.h"

#include "Analysis/GeometryMemory.h"
#include "Analysis/ThreadVariance.h"
#include "WarpDialect/LaneOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using warp::RunLoop;
using warp::ThreadVariance;

/// True if it pays: lanes have places of their own, and read the list there.
static bool pays(RunLoop &run, const ThreadVariance &variance) {
  Value place = run.argument(run.place);
  auto reads = [&](Operation *user) {
    auto access = dyn_cast<warp::AccessOp>(user);
    return access && !access.mayWrite();
  };
  return !variance.isUniform(place, warp::Scope::Lanes) &&
         llvm::any_of(place.getUsers(), reads);
}

static void share(RunLoop &run) {
  Location loc = run.loop.getLoc();
  Block *body = run.loop.getAfterBody();
  auto yield = cast<scf::YieldOp>(body->getTerminator());
  // Values that the runs change; the rest stays in the outer loop.
  SmallVector<unsigned> changed = run.changed();
  SmallVector<Value> inits, next;
  for (unsigned i : changed) {
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

/// True if threads that follow each other take points that do in a grid.
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
    if (auto run = warp::findRuns(loop); run && pays(*run, variance))
      runs.push_back(*run);
  });
  for (RunLoop &run : runs)
    share(run);
  return !runs.empty();
}
