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

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;

/// Partial sums that a thread can keep in registers.
constexpr int64_t maxSums = 16;
/// Operations of all iterations together.
constexpr int64_t maxOperations = 1024;

/// The number of iterations if it is known and small, else 0.
static int64_t countTrips(scf::ForOp loop) {
  APInt begin, end, step;
  if (!matchPattern(loop.getLowerBound(), m_ConstantInt(&begin)) ||
      !matchPattern(loop.getUpperBound(), m_ConstantInt(&end)) ||
      !matchPattern(loop.getStep(), m_ConstantInt(&step)) ||
      !step.isStrictlyPositive() || begin.sge(end) ||
      (loop.getUnsignedCmp() && begin.isNegative()))
    return 0;
  int64_t length = end.getSExtValue() - begin.getSExtValue();
  int64_t trips = llvm::divideCeil(length, step.getSExtValue());
  return trips <= maxSums ? trips : 0;
}

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
  int64_t trips = countTrips(loop), operations = 0, sums = 0;
  if (trips == 0)
    return false;
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
  return sums > 0 && sums * trips <= maxSums &&
         operations * trips <= maxOperations;
}

static void unroll(scf::ForOp loop) {
  OpBuilder b(loop);
  Value counter = loop.getInductionVar();
  APInt begin, step;
  matchPattern(loop.getLowerBound(), m_ConstantInt(&begin));
  matchPattern(loop.getStep(), m_ConstantInt(&step));
  SmallVector<Value> carried(loop.getInitArgs());
  for (int64_t i = 0, trips = countTrips(loop); i < trips; ++i) {
    IRMapping map;
    int64_t number = begin.getSExtValue() + i * step.getSExtValue();
    map.map(counter, arith::ConstantOp::create(
                         b, loop.getLoc(),
                         b.getIntegerAttr(counter.getType(), number)));
    map.map(loop.getRegionIterArgs(), carried);
    for (Operation &op : loop.getBody()->without_terminator())
      b.clone(op, map);
    carried.clear();
    for (Value next : loop.getYieldedValues())
      carried.push_back(map.lookupOrDefault(next));
  }
  loop.replaceAllUsesWith(carried);
  loop.erase();
}

void warp::unrollUpdates(LLVM::LLVMFuncOp entry) {
  Block *first = &entry.getBody().front();
  // Inner loops come first.
  SmallVector<scf::ForOp> loops;
  entry.walk([&](scf::ForOp loop) { loops.push_back(loop); });
  for (scf::ForOp loop : loops)
    if (shouldUnroll(loop, first))
      unroll(loop);
}
