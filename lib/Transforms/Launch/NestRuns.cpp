//===- NestRuns.cpp - Loop nests of neighbour runs ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// On a GPU
//
//     while (seek(place, end), place < end)     while (seek(..), place < end)
//       body(place)                         =>    for (; place < end; ++place)
//       place += 1                                  body(place)
//
// for a loop over neighbours: threads of a warp look for their next runs
// together, not whenever one of them has to, and an element costs no branches
// but the loop's. Each thread does what it did, in its order.
//
//===----------------------------------------------------------------------===//

#include "NestRuns.h"
#include "Choices.h"
#include "RunLoop.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Builders.h"

using namespace mlir;
using warp::RunLoop;

static void nest(RunLoop &run) {
  Location loc = run.loop.getLoc();
  Block *body = run.loop.getAfterBody();
  auto yield = cast<scf::YieldOp>(body->getTerminator());
  // Values that a run changes, but its position.
  SmallVector<unsigned> changed = run.changed();
  llvm::erase(changed, run.place);
  SmallVector<Value> inits, next;
  for (unsigned i : changed) {
    inits.push_back(run.argument(i));
    next.push_back(run.next(i));
  }
  Value place = run.argument(run.place), end = run.argument(run.end);
  OpBuilder b(body, body->begin());
  Value one =
      arith::ConstantOp::create(b, loc, b.getIntegerAttr(place.getType(), 1));
  auto loop = scf::ForOp::create(b, loc, place, end, one, inits);
  Block *inner = loop.getBody();
  if (inits.empty())
    inner->getTerminator()->erase();
  inner->getOperations().splice(inner->end(), body->getOperations(),
                                std::next(loop->getIterator()),
                                yield->getIterator());
  b.setInsertionPointToEnd(inner);
  scf::YieldOp::create(b, loc, next);
  auto replaceInside = [&](Value value, Value by) {
    value.replaceUsesWithIf(by, [&](OpOperand &use) {
      return loop->isProperAncestor(use.getOwner());
    });
  };
  replaceInside(place, loop.getInductionVar());
  for (auto [i, argument] : llvm::zip_equal(changed, loop.getRegionIterArgs()))
    replaceInside(run.argument(i), argument);
  for (unsigned k = 0; k < yield->getNumOperands(); ++k) {
    unsigned i = unsigned(llvm::find(run.sources, k) - run.sources.begin());
    auto where = llvm::find(changed, i);
    // The condition has seen that the run has an element.
    if (i == run.place)
      yield->setOperand(k, end);
    else if (where == changed.end())
      yield->setOperand(k, run.argument(i));
    else
      yield->setOperand(k, loop.getResult(where - changed.begin()));
  }
}

void warp::nestRuns(Operation *entry) {
  SmallVector<RunLoop> runs;
  entry->walk([&](scf::WhileOp loop) {
    if (auto run = findRuns(loop))
      runs.push_back(*run);
  });
  for (RunLoop &run : runs) {
    noteChoice(entry, "loop", "runs are loops of their own",
               "threads look for their next runs together", run.loop);
    nest(run);
  }
}
