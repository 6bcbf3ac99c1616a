//===- PlanUpdates.cpp - Choice of atomic, plain or reduced updates -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A sum into one element, `atomic_add(loss, 0, e)`, has every thread of a
// launch update the same address: a locked instruction each on the CPU, and a
// contend for one address on a GPU. The order of atomic updates is
// open, so threads may make one update together. Which of them do is settled
// here for every update, by what the analysis knows of its address; a pass for
// each scope carries it out.
//
//   scope    the element is the same for            carried out by
//   group    all threads, in every iteration        warp-combine-over-groups;
//                                                   exact sums: warp-lower-sums
//   ring     all threads in one iteration of a      warp-apply-schedules (GPU)
//            loop, and another one in the next
//   lanes    the threads of a vector or a warp      warp-widen-threads,
//                                                   warp-combine-over-warps
//   thread   -                                      warp-lower-arrays
//
// An update is combined if its old value is unused, nothing in the kernel does
// anything else to the array than update it in a way that commutes, and its
// components have 32 bits or more, as partial sums would round. Short loops
// over a few such elements are unrolled first (UnrollUpdates.cpp). Which sums
// of a deterministic launch are exact says ExactUpdates.cpp.
//
// The remaining updates on the CPU are of elements that differ from thread to
// thread. An atomic instruction costs ten times a plain update, so it is
// quicker to do without, by one thread if only few would share the launch, or
// by all if each has copies of the arrays (CopiedArrays.h). The schedule is
// then exclusive. So it is in a deterministic launch if the order of updates
// would show, by one thread; on a GPU that is a launch of one block. And so it
// is in any launch on a CPU of a kernel that uses old values, unless the caller
// lets threads come in any order: slots of a counter follow the threads.
//
//===----------------------------------------------------------------------===//

#include "Analysis/CostModel.h"
#include "Analysis/ThreadVariance.h"
#include "Atomics.h"
#include "CarryOut.h"
#include "Choices.h"
#include "CopiedArrays.h"
#include "ExactUpdates.h"
#include "KernelFunction.h"
#include "Lanes/LanePlan.h"
#include "RowUpdates.h"
#include "Schedules/RingLoop.h"
#include "UnrollUpdates.h"
#include "UpdateCosts.h"
#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/TilePasses.h"
#include "warp/Schedule.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"

namespace warp {
#define GEN_PASS_DEF_PLANUPDATES
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::AtomicComponentsOp;
using warp::UpdateScope;

namespace {

/// Settles the scopes of one kernel's updates.
class UpdatePlanner {
public:
  UpdatePlanner(FunctionOpInterface kernel, warp::ThreadsOp threads)
      : variance(kernel), threads(threads),
        first(&kernel.getFunctionBody().front()),
        variant(warp::getVariant(kernel)), target(warp::getTarget(kernel)) {}

  /// Updates by the whole group. `exact`: also exact sums.
  void planGroups(bool exact);
  /// Among the rest, the updates by neighbours.
  void planNeighbours();
  /// After `planGroups`: whether all whose order shows are made by the group.
  bool coversOrder();
  /// Takes `planGroups` back.
  void dropGroups();

  warp::ThreadVariance variance;

private:
  bool isOnePlace(AtomicComponentsOp op);
  bool isForGroup(AtomicComponentsOp op);
  void planRings();
  void planRuns();
  static bool isForWarp(AtomicComponentsOp op,
                        const warp::ThreadVariance &variance);
  std::optional<int64_t> runOf(Value index, int depth = 6);
  std::optional<int64_t> runOf(AtomicComponentsOp op);
  bool isVarying(Value value) {
    return !variance.isUniform(value, warp::Scope::Lanes);
  }

  warp::ThreadsOp threads;
  Block *first;
  warp::VariantAttr variant;
  const warp::TargetInfo &target;
};

} // namespace

//===----------------------------------------------------------------------===//
// Scopes
//===----------------------------------------------------------------------===//

/// True if all threads update the same element, which can be found again after
/// them.
bool UpdatePlanner::isOnePlace(AtomicComponentsOp op) {
  return warp::isInvariant(op.getArray(), first) &&
         llvm::all_of(op.getIndices(), [&](Value index) {
           return warp::isInvariant(index, first);
         });
}

bool UpdatePlanner::isForGroup(AtomicComponentsOp op) {
  if (!isOnePlace(op))
    return false;
  if (warp::getUpdate(op).isExact())
    return op.getNumResults() <= warp::cost::mostSums;
  return warp::canCombine(op) &&
         warp::canCarryOut(op->getBlock(), threads.getThread());
}

void UpdatePlanner::planGroups(bool exact) {
  threads.walk([&](AtomicComponentsOp op) {
    if ((exact || !warp::getUpdate(op).isExact()) && isForGroup(op))
      warp::setUpdate(op, UpdateScope::group);
  });
}

bool UpdatePlanner::coversOrder() {
  WalkResult result = threads.walk([&](Operation *op) {
    bool isLeft = warp::dependsOnOrder(op) &&
                  warp::getUpdate(op).getScope() != UpdateScope::group;
    return isLeft ? WalkResult::interrupt() : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

void UpdatePlanner::dropGroups() {
  threads.walk(
      [](AtomicComponentsOp op) { warp::setUpdate(op, UpdateScope::thread); });
}

void UpdatePlanner::planRings() {
  threads.walk([&](scf::ForOp loop) {
    warp::RingLoop ring(loop, variant.getFastMath());
    if (ring.qualifies(variance))
      for (AtomicComponentsOp op : ring.updates)
        warp::setUpdate(op, UpdateScope::ring);
  });
}

/// True if threads of a warp may be expected to update the same element: they
/// agree if they are in the same iteration.
bool UpdatePlanner::isForWarp(AtomicComponentsOp op,
                              const warp::ThreadVariance &variance) {
  llvm::SetVector<Value> compared;
  auto isKnown = [&](Value value) {
    return variance.isUniformIfEqual(value, compared);
  };
  if (!isKnown(op.getArray()))
    return false;
  if (llvm::all_of(op.getIndices(), isKnown))
    return !compared.empty();
  return llvm::all_of(op.getIndices(), [&](Value index) {
    return variance.isUniform(index, warp::Scope::Lanes);
  });
}

/// How many threads that follow each other have the same index for the most
/// part: that of a quotient of what goes on by a step, and of what is made of
/// such. 0 if all lanes share it; none if nothing is known.
std::optional<int64_t> UpdatePlanner::runOf(Value index, int depth) {
  if (!isVarying(index))
    return 0;
  Operation *op = index.getDefiningOp();
  if (!op || depth == 0 || op->getNumRegions() != 0 || !isMemoryEffectFree(op))
    return std::nullopt;
  if (isa<arith::DivSIOp, arith::DivUIOp, arith::ShRSIOp, arith::ShRUIOp>(op) &&
      variance.step(op->getOperand(0)) && !isVarying(op->getOperand(1))) {
    APInt by;
    if (!matchPattern(op->getOperand(1), m_ConstantInt(&by)))
      return warp::cost::unknownRun;
    if (isa<arith::ShRSIOp, arith::ShRUIOp>(op))
      return int64_t(1) << by.getLimitedValue(30);
    return by.isStrictlyPositive() ? std::optional(by.getSExtValue())
                                   : std::nullopt;
  }
  // A choice that all lanes make together: one of the two may be meant for
  // divisors that there never are.
  auto choice = dyn_cast<arith::SelectOp>(op);
  if (choice && !isVarying(choice.getCondition())) {
    auto then = runOf(choice.getTrueValue(), depth - 1);
    auto otherwise = runOf(choice.getFalseValue(), depth - 1);
    if (!then || !otherwise)
      return then ? then : otherwise;
    return std::max(*then, *otherwise);
  }
  std::optional<int64_t> least = warp::cost::unknownRun;
  for (Value operand : op->getOperands()) {
    if (operand.getType().isInteger(1))
      continue;
    std::optional<int64_t> run = runOf(operand, depth - 1);
    if (!run)
      return std::nullopt;
    if (*run != 0)
      least = std::min(*least, *run);
  }
  return least;
}

std::optional<int64_t> UpdatePlanner::runOf(AtomicComponentsOp op) {
  int64_t least = 0;
  for (Value index : op.getIndices()) {
    std::optional<int64_t> run = runOf(index);
    if (!run)
      return std::nullopt;
    if (*run != 0)
      least = least == 0 ? *run : std::min(least, *run);
  }
  return least;
}

void UpdatePlanner::planNeighbours() {
  bool gpu = target.isSimt();
  if (gpu)
    planRings();
  threads.walk([&](AtomicComponentsOp op) {
    if (warp::getUpdate(op).getScope() != UpdateScope::thread ||
        !warp::canCombine(op))
      return;
    std::optional<int64_t> run;
    if (gpu)
      run = isForWarp(op, variance) ? std::optional<int64_t>(0) : std::nullopt;
    else
      run = runOf(op);
    if (run)
      warp::setUpdate(op, UpdateScope::lanes, *run);
  });
  if (gpu)
    planRuns();
}

/// Among the rest, the updates of elements that runs of threads share: those of
/// a tile of pixels have its number, `x / 16`.
void UpdatePlanner::planRuns() {
  int64_t run =
      std::min<int64_t>(llvm::bit_floor(uint64_t(variance.getLongestRun())),
                        target.getSubgroupSize());
  if (run < warp::cost::leastCombined)
    return;
  SmallVector<AtomicComponentsOp> rest;
  threads.walk([&](AtomicComponentsOp op) {
    if (warp::getUpdate(op).getScope() == UpdateScope::thread &&
        warp::canCombine(op))
      rest.push_back(op);
  });
  if (rest.empty())
    return;
  warp::ThreadVariance aligned(threads->getParentOfType<FunctionOpInterface>(),
                               std::nullopt, run);
  for (AtomicComponentsOp op : rest)
    if (isForWarp(op, aligned))
      warp::setUpdate(op, UpdateScope::lanes, run);
}

//===----------------------------------------------------------------------===//
// Kernels
//===----------------------------------------------------------------------===//

/// Why one thread runs a launch whose threads look at old values.
static constexpr llvm::StringLiteral turnReason =
    "who comes first shows, and is who has the lower index";

namespace {

struct PlanUpdates : warp::impl::PlanUpdatesBase<PlanUpdates> {
  void runOnOperation() override {
    warp::ThreadsOp threads = warp::findThreads(getOperation());
    if (!threads)
      return signalPassFailure();
    auto kernel = threads->getParentOfType<FunctionOpInterface>();
    warp::VariantAttr variant = warp::getVariant(kernel);
    if (warp::getTarget(kernel).isSimt() && !variant.getDebug() &&
        !variant.isDeterministic() &&
        !kernel->hasAttr(warp::attr::blockThreads))
      warp::addAlongRows(kernel, threads);
    bool any = kernel
                   ->walk([](Operation *op) {
                     return isa<AtomicComponentsOp>(op) || warp::mayTellTurn(op)
                                ? WalkResult::interrupt()
                                : WalkResult::advance();
                   })
                   .wasInterrupted();
    if (!any)
      return;
    warp::markExactUpdates(kernel);
    // One variant is in order, the other for launches that do not ask for it.
    if (!warp::getTarget(kernel).isSimt() &&
        !warp::getVariant(kernel).isDeterministic() &&
        warp::mayTellTurns(kernel))
      warp::setSchedule(kernel, warp::getSchedule(kernel).withSizeFacts(
                                    warp::threadOrderFact));
    // Functions that are called may access the same elements.
    if (kernel->hasAttr(warp::attr::keepsCalls)) {
      if (!warp::getTarget(kernel).isSimt() && warp::keepsTurns(kernel))
        makeInTurn(kernel);
      return;
    }
    // Threads that work together on tiles have settled who makes an update.
    if (kernel->hasAttr(warp::attr::blockThreads)) {
      if (failed(orderBlocks(kernel)))
        signalPassFailure();
      return;
    }
    // A debugging launch names the thread that fails, so each does its own.
    debug = warp::getVariant(kernel).getDebug();
    if (!debug && !warp::getTarget(kernel).isSimt())
      warp::foldViews(kernel);
    if (!debug)
      warp::unrollUpdates(kernel);
    if (warp::getTarget(kernel).isSimt())
      planGpu(kernel, threads);
    else
      planCpu(kernel, threads);
  }

  static void makeInTurn(FunctionOpInterface kernel) {
    warp::noteChoice(kernel, "updates", "plain, by one thread", turnReason);
    warp::setSchedule(kernel, warp::getSchedule(kernel).withExclusive(true));
  }

  /// Blocks that work on tiles make updates in one order on a CPU; on a GPU
  /// nothing but exact sums has the same bits in every run.
  LogicalResult orderBlocks(FunctionOpInterface kernel) {
    bool inTurn = warp::keepsTurns(kernel);
    warp::VariantAttr variant = warp::getVariant(kernel);
    bool isOrdered =
        variant.isDeterministic() && warp::hasOrderedUpdates(kernel);
    if (!inTurn && !isOrdered)
      return success();
    if (warp::getTarget(kernel).isSimt())
      return kernel->emitError(
          "deterministic updates by blocks with tiles are sums of 32 or 64 "
          "bits in an array that the launch does not read or store to");
    warp::noteChoice(kernel, "updates", "by one thread",
                     inTurn ? turnReason : "sums are in one order");
    warp::setSchedule(kernel, warp::getSchedule(kernel).withExclusive(true));
    return success();
  }

  void planCpu(FunctionOpInterface kernel, warp::ThreadsOp threads) {
    warp::VariantAttr variant = warp::getVariant(kernel);
    bool inTurn = warp::keepsTurns(kernel);
    bool exclusive = inTurn || (variant.isDeterministic() &&
                                warp::hasOrderedUpdates(kernel));
    if (exclusive)
      warp::noteChoice(kernel, "updates", "plain, by one thread",
                       inTurn ? turnReason : "sums are in one order");
    if (!debug) {
      UpdatePlanner planner(kernel, threads);
      planner.planGroups(/*exact=*/true);
      planner.planNeighbours();
      // Copies are for several threads.
      if (!inTurn)
        exclusive |= planPlainUpdates(kernel, threads, planner.variance);
    }
    if (exclusive)
      warp::setSchedule(kernel, warp::getSchedule(kernel).withExclusive(true));
  }

  /// True if updates are made without atomic instructions, as that is quicker.
  bool planPlainUpdates(FunctionOpInterface kernel, warp::ThreadsOp threads,
                        const warp::ThreadVariance &variance) {
    warp::VariantAttr variant = warp::getVariant(kernel);
    int64_t lanes = warp::planLanes(kernel, threads, variance).lanes;
    warp::UpdateCosts costs(threads, warp::getSchedule(kernel).getCost(),
                            lanes);
    if (!costs.any())
      return false;
    bool alone = costs.plain < costs.atomic / double(variant.getThreads());
    if (alone)
      warp::noteChoice(kernel, "updates", "plain, by one thread",
                       "atomic ones by several would take longer");
    bool copies = !variant.isDeterministic() && variant.getThreads() > 1 &&
                  variant.getDisjoint() && warp::offerCopies(kernel, costs);
    if (copies)
      warp::noteChoice(kernel, "updates", "plain, in copies of arrays",
                       "where a launch is large enough to merge them");
    return alone || copies;
  }

  void planGpu(FunctionOpInterface kernel, warp::ThreadsOp threads) {
    warp::VariantAttr variant = warp::getVariant(kernel);
    UpdatePlanner planner(kernel, threads);
    if (variant.isDeterministic() && warp::hasOrderedUpdates(kernel))
      return planOneBlock(kernel, planner);
    if (debug)
      return;
    if (variant.hasWholeWarps())
      planner.planGroups(/*exact=*/true);
    if (!variant.isDeterministic())
      planner.planNeighbours();
  }

  /// The block combines its threads' results in a fixed order; where they
  /// cannot be combined, it has a single thread. They are not all there at its
  /// end, so each adds to exact sums.
  void planOneBlock(FunctionOpInterface kernel, UpdatePlanner &planner) {
    int64_t threads = warp::getVariant(kernel).getBlockDim();
    if (!debug && warp::getTarget(kernel).hasFullSubgroups(threads))
      planner.planGroups(/*exact=*/false);
    if (!planner.coversOrder()) {
      threads = 1;
      planner.dropGroups();
    }
    warp::setSchedule(kernel,
                      warp::getSchedule(kernel).withSingleBlock(threads));
  }

  bool debug = false;
};

} // namespace
