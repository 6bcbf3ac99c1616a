//===- RingReduction.cpp - Skewed loops: 32 atomics in place of 1,024 -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In a loop over all pairs, and in its adjoint, every thread adds to element j
// in iteration j. The 32 threads of a warp go through the iterations side by
// side, so their updates queue at one address. Where the iterations may run in
// any order, each lane begins at another one of a tile of 32, and what was
// summed up for an iteration travels to the lane that runs it next:
//
//   step      0     1     2        31
//   lane 0    j     j+1   j+2 ...  j+31      after 32 steps lane r holds the
//   lane 1    j+1   j+2   j+3 ...  j         warp's sum for iteration j + r
//   ...                                      and makes one update with it
//
// 32 updates of 32 different elements remain of 1024. Shuffles need all lanes
// of the warp, with the same tiles: bounds and indices must be the same for all
// threads (lanes compare counters of outer loops that these depend on), and a
// warp with a lane missing goes through no tile. What is not in a tile runs in
// the loop as it was, which comes after.
//
// Runs on an entry, on loops that warp-plan-updates has chosen
// (RingLoop.cpp).
//
//===----------------------------------------------------------------------===//

#include "Choices.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "Rotation.h"
#include "Updates/Atomics.h"

namespace warp {
#define GEN_PASS_DEF_ROTATELOOPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

static bool isInRing(warp::AtomicComponentsOp op) {
  return warp::getUpdate(op).getScope() == warp::UpdateScope::ring;
}

/// Loops of the entry with updates in rings, inner ones first: one with tiles
/// inside does not qualify.
static SmallVector<scf::ForOp> findRings(FunctionOpInterface entry) {
  SmallVector<scf::ForOp> loops;
  entry->walk([&](scf::ForOp loop) {
    WalkResult result = loop->walk([](warp::AtomicComponentsOp op) {
      return isInRing(op) ? WalkResult::interrupt() : WalkResult::advance();
    });
    if (result.wasInterrupted())
      loops.push_back(loop);
  });
  return loops;
}

namespace {

struct RotateLoops : warp::impl::RotateLoopsBase<RotateLoops> {
  void getDependentDialects(DialectRegistry &registry) const override {
    RotateLoopsBase::getDependentDialects(registry);
    warp::registerGpuDialect(registry);
  }

  void runOnOperation() override {
    FunctionOpInterface found = warp::findEntry(getOperation());
    if (!found)
      return signalPassFailure();
    auto entry = dyn_cast<LLVM::LLVMFuncOp>(found.getOperation());
    if (!entry)
      return;
    bool anyOrder = warp::getVariant(entry).getFastMath();
    for (scf::ForOp loop : findRings(entry)) {
      warp::ThreadVariance variance(entry);
      warp::RingLoop ring(loop, variance, anyOrder);
      if (!ring.qualifies())
        continue;
      warp::noteChoice(entry, "loop", "each lane begins elsewhere",
                       "sums travel to the lane that adds to them next", loop);
      warp::Rotation(loop, entry, ring).run();
    }
    // What is not in a tile meets in its iteration still.
    entry.walk([](warp::AtomicComponentsOp op) {
      if (isInRing(op))
        warp::setUpdate(op, warp::UpdateScope::lanes);
    });
  }
};

} // namespace
