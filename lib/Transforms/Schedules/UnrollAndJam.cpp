//===- UnrollAndJam.cpp - Register tiling of a shared inner loop ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In a loop with the same bounds in all threads, each thread loads the same
// elements:
//
//   for j in range(n): sum += f(x[i], x[j])
//
// The launch dimension is unrolled by two and jammed (unroll-and-jam): a thread
// runs the loop once for two indices i and loads x[j] once for both, and the
// latency of one is hidden by the other:
//
//   for j in range(n): a += f(x[i], x[j]); b += f(x[i + block], x[j])
//
// That takes half as many threads, so launches that would not fill the GPU
// (`underfilled`) stay as they are. Every index keeps the order of its own
// operations. A thread with one index left computes it twice and stores once.
// SCF's loopUnrollJamByFactor is for loops; here the outer "loop" is the
// launch.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"

#include "warp/Schedule.h"

using namespace mlir;
using namespace warp;

/// Indices of a thread.
constexpr int64_t count = 2;
/// Operations of a loop that are worth two copies, and words that the copies
/// may carry.
constexpr int64_t mostOperations = 64, mostCarried = 24;

namespace {

class UnrollAndJam : public GridMapping {
public:
  using GridMapping::GridMapping;

  bool applies() override;
  bool profit() override { return !variant.getUnderfilled(); }
  Description describe(bool isMade) override {
    if (!isMade)
      return {"coarsening", "1", "the launch has too few threads"};
    return {"coarsening", std::to_string(count),
            "register tiling of a shared loop", loop};
  }
  int sizeFacts() const override { return underfilledFact; }
  bool needsRegisters(bool) const override { return true; }

private:
  Values build() override;

  /// The loop that the indices share.
  scf::ForOp loop;
};

} // namespace

/// True if a loop has the same bounds in all threads, and loads an element that
/// they share.
static bool isShared(scf::ForOp loop, const ThreadVariance &variance) {
  auto isFixed = [&](Value value) {
    return variance.isUniform(value, Scope::Launch);
  };
  if (!isFixed(loop.getLowerBound()) || !isFixed(loop.getUpperBound()) ||
      !isFixed(loop.getStep()))
    return false;
  int64_t operations = 0, words = 0;
  bool simple = true, loads = false;
  for (Operation &op : loop.getBody()->without_terminator()) {
    simple &= onlyLoads(op, /*loops=*/false);
    op.walk([&](Operation *) { ++operations; });
    if (auto load = dyn_cast<LoadComponentsOp>(op))
      loads |= llvm::all_of(load.getIndices(), [&](Value index) {
        return variance.isUniform(index, Scope::Lanes);
      });
  }
  for (Type type : loop.getResultTypes()) {
    // Arrays, for one.
    if (!type.isIntOrFloat())
      return false;
    words += llvm::divideCeil(type.getIntOrFloatBitWidth(), 32);
  }
  return simple && loads && operations <= mostOperations &&
         2 * words <= mostCarried;
}

/// The loop is the only one of the kernel, and around it is nothing but loads,
/// arithmetic and stores.
bool UnrollAndJam::applies() {
  if (rank != 1 || !hasPlainThreads() || threads.getNumResults() != 0)
    return false;
  for (Operation &op : thread->without_terminator()) {
    auto found = dyn_cast<scf::ForOp>(op);
    if (found && !loop)
      loop = found;
    else if (!isa<StoreComponentsOp>(op) && !onlyLoads(op, /*loops=*/false))
      return false;
  }
  return loop && isShared(loop, site.getVariance());
}

/// Jams the loops of all indices: one loop that carries their values.
static void cloneJammed(OpBuilder &b, scf::ForOp loop,
                        MutableArrayRef<IRMapping> clones) {
  IRMapping &first = clones.front();
  SmallVector<Value> inits;
  for (IRMapping &map : clones)
    for (Value init : loop.getInitArgs())
      inits.push_back(map.lookupOrDefault(init));
  auto jammed = scf::ForOp::create(b, loop.getLoc(),
                                   first.lookupOrDefault(loop.getLowerBound()),
                                   first.lookupOrDefault(loop.getUpperBound()),
                                   first.lookupOrDefault(loop.getStep()), inits,
                                   nullptr, loop.getUnsignedCmp());
  size_t count = loop.getNumResults();
  for (auto [i, map] : llvm::enumerate(clones)) {
    map.map(loop.getInductionVar(), jammed.getInductionVar());
    map.map(loop.getRegionIterArgs(),
            jammed.getRegionIterArgs().slice(i * count, count));
    map.map(loop.getResults(), jammed.getResults().slice(i * count, count));
  }
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(jammed.getBody());
  for (Operation &op : loop.getBody()->without_terminator())
    cloneShared(b, op, clones);
  SmallVector<Value> yielded;
  for (IRMapping &map : clones)
    for (Value value : loop.getYieldedValues())
      yielded.push_back(map.lookupOrDefault(value));
  if (count != 0)
    scf::YieldOp::create(b, loop.getLoc(), yielded);
}

UnrollAndJam::Values UnrollAndJam::build() {
  setSchedule(site.function, getSchedule(site.function).withCoarsening(count));
  Value width = read(GridValue::blockDim);
  Value block = read(GridValue::blockId);
  Value lane = read(GridValue::threadId);
  Value first = add(mul(mul(block, width), constant32(count)), lane);
  Value second = add(first, width);
  enterIf(isLess(first, dims[0]));
  Value hasSecond = isLess(second, dims[0]);
  IRMapping clones[count];
  clones[0].map(indices()[0], first);
  Value other = arith::SelectOp::create(b, loc, hasSecond, second, first);
  clones[1].map(indices()[0], other);
  for (Operation &op : thread->without_terminator()) {
    if (auto loop = dyn_cast<scf::ForOp>(op)) {
      cloneJammed(b, loop, clones);
    } else if (isa<StoreComponentsOp>(op)) {
      b.clone(op, clones[0]);
      OpBuilder::InsertionGuard guard(b);
      enterIf(hasSecond);
      b.clone(op, clones[1]);
    } else {
      cloneInterleaved(b, op, clones);
    }
  }
  return {};
}

WARP_MAKE_SCHEDULE(UnrollAndJam)
