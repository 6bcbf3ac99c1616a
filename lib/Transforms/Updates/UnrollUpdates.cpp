//===- UnrollUpdates.cpp - Short loops over sums --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The gradient of a few parameters, `for k in range(8): y += w[k] * f(k)`, is a
// loop with an update of `w[k]` by every thread. Unrolled, it is eight updates
// of fixed addresses, each of which can be accumulated privately, where else
// all threads would contend for eight elements.
//
//===----------------------------------------------------------------------===//

#include "UnrollUpdates.h"

#include "Analysis/CostModel.h"
#include "Analysis/ThreadVariance.h"
#include "Atomics.h"
#include "Launch/UnrollLoop.h"

using namespace mlir;
namespace cost = warp::cost;

/// Operations of all iterations together.
constexpr int64_t maxOperations = 1024;

/// True if an element is one in each iteration of a loop, for all threads, and
/// another one in the next. Outer loops do not count: those are longer.
static bool followsCounter(warp::AtomicComponentsOp update, scf::ForOp loop,
                           const warp::ThreadVariance &variance) {
  llvm::SetVector<Value> counters;
  return llvm::all_of(update.getIndices(),
                      [&](Value index) {
                        return variance.isUniformIfEqual(index, counters);
                      }) &&
         counters.size() == 1 && counters.front() == loop.getInductionVar();
}

static bool shouldUnroll(scf::ForOp loop,
                         const warp::ThreadVariance &variance) {
  std::optional<int64_t> trips = warp::getConstantTrips(loop);
  if (!trips || *trips > cost::mostSums)
    return false;
  int64_t operations = 0, sums = 0;
  loop.getBody()->walk([&](Operation *op) {
    ++operations;
    auto update = dyn_cast<warp::AtomicComponentsOp>(op);
    if (!update || !warp::commutes(update))
      return;
    if (followsCounter(update, loop, variance))
      sums += update.getComponents().size();
  });
  return sums > 0 && sums * *trips <= cost::mostSums &&
         operations * *trips <= maxOperations;
}

void warp::unrollUpdates(FunctionOpInterface kernel) {
  // Inner loops come first.
  SmallVector<scf::ForOp> loops;
  kernel->walk([&](scf::ForOp loop) { loops.push_back(loop); });
  std::optional<ThreadVariance> variance;
  for (scf::ForOp loop : loops) {
    if (!getConstantTrips(loop))
      continue;
    if (!variance)
      variance.emplace(kernel);
    if (!shouldUnroll(loop, *variance))
      continue;
    unroll(loop);
    variance.reset();
  }
}
