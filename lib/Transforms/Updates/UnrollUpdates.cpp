//===- UnrollUpdates.cpp - Short loops over sums --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The gradient of a few parameters, `for k in range(8): y += w[k] * f(k)`, is a
// loop with an update of `w[k]` by every thread. Unrolled, it is eight updates
// of fixed addresses, each of which can be accumulated privately, where else
// all threads would queue at eight elements.
//
//===----------------------------------------------------------------------===//

#include "UnrollUpdates.h"

#include "Atomics.h"
#include "Launch/UnrollLoop.h"

using namespace mlir;

/// Partial sums that a thread can keep in registers.
constexpr int64_t maxSums = 16;
/// Operations of all iterations together.
constexpr int64_t maxOperations = 1024;

/// Whether a value depends on the counter of a loop, and else on nothing that
/// threads do not share.
static bool followsCounter(Value value, scf::ForOp loop, Block *first,
                           bool &depends) {
  if (value == loop.getInductionVar())
    return depends = true;
  if (warp::isInvariant(value, first))
    return true;
  Operation *op = value.getDefiningOp();
  return op && isPure(op) && op->getNumRegions() == 0 &&
         llvm::all_of(op->getOperands(), [&](Value operand) {
           return followsCounter(operand, loop, first, depends);
         });
}

static bool shouldUnroll(scf::ForOp loop, Block *first) {
  std::optional<int64_t> trips = warp::getConstantTrips(loop);
  if (!trips || *trips > maxSums)
    return false;
  int64_t operations = 0, sums = 0;
  loop.getBody()->walk([&](Operation *op) {
    ++operations;
    auto update = dyn_cast<warp::AtomicComponentsOp>(op);
    if (!update || !warp::commutes(update))
      return;
    bool depends = false;
    if (llvm::all_of(update.getIndices(), [&](Value index) {
          return followsCounter(index, loop, first, depends);
        }) && depends)
      sums += update.getComponents().size();
  });
  return sums > 0 && sums * *trips <= maxSums &&
         operations * *trips <= maxOperations;
}

void warp::unrollUpdates(FunctionOpInterface kernel) {
  Block *first = &kernel.getFunctionBody().front();
  // Inner loops come first.
  SmallVector<scf::ForOp> loops;
  kernel->walk([&](scf::ForOp loop) { loops.push_back(loop); });
  for (scf::ForOp loop : loops)
    if (shouldUnroll(loop, first))
      unroll(loop);
}
