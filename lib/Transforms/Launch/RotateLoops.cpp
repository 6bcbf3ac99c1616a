//===- RotateLoops.cpp - Sums that travel through a warp ------------------===//
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
// The order of iterations is open if the loop does nothing to memory but load
// and update in ways that commute, and what it carries are integer sums or such
// whose order is declared open (`reassoc`), as cotangents are.
//
// Runs on an entry. Of updates that have one address for all threads
// warp-privatize-atomics has made sums before.
//
//===----------------------------------------------------------------------===//

#include "Updates/Atomics.h"
#include "GpuBlock.h"
#include "KernelFunction.h"
#include "LoopSums.h"
#include "RotateLoops.h"
#include "Schedule.h"
#include "WarpDialect/TilePasses.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/IR/Matchers.h"

namespace warp {
#define GEN_PASS_DEF_ROTATELOOPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::Rotation;

/// Fewer iterations are not worth the code.
constexpr int64_t minTrips = 2 * Rotation::lanes;

/// Whether a value is the same for all lanes, and in all iterations.
bool Rotation::isUniform(Value value) {
  return variance.strideIfEqual(value, loop, compared) == 0;
}

/// Whether the loop surely has too few iterations.
bool Rotation::isShort() {
  APInt first, last;
  return matchPattern(loop.getLowerBound(), m_ConstantInt(&first)) &&
         matchPattern(loop.getUpperBound(), m_ConstantInt(&last)) &&
         last.getSExtValue() - first.getSExtValue() < minTrips;
}

static bool holdsUpdates(scf::ForOp loop) {
  return loop
      ->walk([](warp::AtomicComponentsOp) { return WalkResult::interrupt(); })
      .wasInterrupted();
}

/// Whether nothing in the loop does to memory what iterations could see of each
/// other. An array that a commuting update names is not accessed otherwise.
bool Rotation::isOrderOpen() {
  WalkResult result = loop.getBody()->walk([&](Operation *op) {
    auto update = dyn_cast<warp::AtomicComponentsOp>(op);
    bool open =
        update ? warp::commutes(update)
               : isa<warp::LoadComponentsOp>(op) ||
                     op->hasTrait<OpTrait::HasRecursiveMemoryEffects>() ||
                     isMemoryEffectFree(op);
    return open ? WalkResult::advance() : WalkResult::interrupt();
  });
  return !result.wasInterrupted();
}

/// Finds updates of one element per iteration, the same for all threads. Sums
/// of fewer than 32 bits would round. Of updates that depend on the thread and
/// the iteration, those of neighbours would no longer be neighbours.
bool Rotation::collectUpdates() {
  bool wouldScatter = false;
  loop.getBody()->walk([&](warp::AtomicComponentsOp op) {
    Operation *parent = op->getParentOp();
    while (isa<scf::IfOp>(parent))
      parent = parent->getParentOp();
    bool differs = false;
    auto isKnown = [&](Value index) {
      std::optional<int64_t> stride =
          variance.strideIfEqual(index, loop, compared);
      differs |= stride.value_or(0) != 0;
      return stride.has_value();
    };
    auto isWide = [](Type type) { return type.getIntOrFloatBitWidth() >= 32; };
    if (parent != loop || !isUniform(op.getArray()) ||
        !llvm::all_of(op.getResultTypes(), isWide) ||
        !llvm::all_of(op.getIndices(), isKnown) || !differs) {
      wouldScatter |= !llvm::all_of(op.getIndices(), [&](Value index) {
        return loop.isDefinedOutsideOfLoop(index);
      });
      return;
    }
    SmallVector<warp::Leaf> leaves;
    warp::collectLeaves(
        cast<warp::ArrayType>(op.getArray().getType()).getElementType(), 0,
        leaves);
    Update &update = updates.emplace_back(Update{op, {}, {}, {}});
    for (warp::Leaf leaf : leaves)
      update.types.push_back(leaf.type);
  });
  return !updates.empty() && !wouldScatter;
}

bool Rotation::qualifies() {
  return matchPattern(loop.getStep(), m_One()) && !isShort() &&
         isa<IntegerType>(counterType()) &&
         counterType().getIntOrFloatBitWidth() >= 32 &&
         isUniform(loop.getLowerBound()) && isUniform(loop.getUpperBound()) &&
         isOrderOpen() &&
         carriesSums(loop, warp::getVariant(entry).getFastMath()) &&
         collectUpdates();
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
    // A debugging launch names the thread that fails; in a deterministic one
    // sums keep their order, whichever lanes are there.
    if (!entry || entry->hasAttr(warp::attr::blockThreads) ||
        !warp::isGpu(entry) || warp::getVariant(entry).getDebug() ||
        warp::getVariant(entry).isDeterministic())
      return;
    SmallVector<scf::ForOp> loops;
    entry.walk([&](scf::ForOp loop) { loops.push_back(loop); });
    // Inner loops come first; one with tiles inside does not qualify.
    std::optional<warp::ThreadVariance> variance;
    for (scf::ForOp loop : loops) {
      if (!holdsUpdates(loop))
        continue;
      if (!variance)
        variance.emplace(entry);
      warp::Rotation rotation(loop, entry, *variance);
      if (!rotation.qualifies())
        continue;
      warp::noteChoice(entry, "loop", "each lane begins elsewhere",
                       "sums travel to the lane that adds to them next", loop);
      rotation.run();
      variance.reset();
    }
  }
};

} // namespace
