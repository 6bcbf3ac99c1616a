//===- ApplySchedules.cpp - Choose and apply launch schedules -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Runs at four points of the pipeline, with the schedules of that stage. All
// schedules of a kernel are asked about it as it is, in the order of the list;
// those that pay then rewrite it in that order. Loops are sites of their own,
// inner ones first.
//
//===----------------------------------------------------------------------===//

#include "Choices.h"
#include "GridMapping.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

namespace warp {
#define GEN_PASS_DEF_APPLYSCHEDULES
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::LaunchRewrite;
using warp::ScheduleSite;
using warp::ScheduleStage;

/// ptxas limits registers to maximise occupancy; a minimum of one block per
/// multiprocessor lifts the limit. A launch of few threads, or of threads that
/// work on much at a time, is faster with more registers (H200: forces of 16 k
/// bodies 1.77 times as fast with 54 as with 32).
static void liftRegisterLimit(Operation *kernel) {
  kernel->setAttr(warp::attr::leastBlocks,
                  Builder(kernel->getContext()).getI64IntegerAttr(1));
}

/// Asks one schedule; true if it is to be applied.
static bool choose(ScheduleSite &site, LaunchRewrite &schedule) {
  warp::GridMapping *mapping = schedule.asMapping();
  if ((mapping && site.mapping) || !schedule.applies())
    return false;
  Operation *function = site.function;
  if (int facts = schedule.sizeFacts())
    warp::setSchedule(function,
                      warp::getSchedule(function).withSizeFacts(facts));
  bool pays = schedule.profit();
  LaunchRewrite::Description text = schedule.describe(pays);
  if (mapping) {
    if (mapping->needsRegisters(pays))
      liftRegisterLimit(function);
    if (pays)
      site.mapping = mapping;
    else if (site.whyNotMapping.empty())
      site.whyNotMapping = text.reason;
  }
  if (!text.what.empty() && (pays || !mapping))
    warp::noteChoice(function, text.what, text.value, text.reason, text.place);
  return pays;
}

static void applySchedules(ScheduleSite &site, ScheduleStage stage) {
  SmallVector<std::unique_ptr<LaunchRewrite>> chosen;
  for (const warp::ScheduleEntry &entry : warp::getSchedules()) {
    if (entry.stage != stage || !entry.isSupported(site.target))
      continue;
    // Schedules do not see what a function that is called touches, and code
    // that they are checked against has none that only gains.
    if ((site.function->hasAttr(warp::attr::keepsCalls) ||
         site.variant.getLanes() == 1) &&
        !entry.benchmark.empty())
      continue;
    std::unique_ptr<LaunchRewrite> schedule = entry.make(site);
    if (choose(site, *schedule))
      chosen.push_back(std::move(schedule));
  }
  for (auto &schedule : chosen)
    schedule->rewrite();
  if (!chosen.empty())
    site.invalidate();
}

namespace {

struct ApplySchedules : warp::impl::ApplySchedulesBase<ApplySchedules> {
  using ApplySchedulesBase::ApplySchedulesBase;

  void getDependentDialects(DialectRegistry &registry) const override {
    ApplySchedulesBase::getDependentDialects(registry);
    warp::registerGpuDialect(registry);
  }

  void runOnOperation() override {
    switch (stage) {
    case ScheduleStage::tiles:
      return applyToKernel(warp::findKernel(getOperation()));
    case ScheduleStage::threads:
      return applyToThreads(warp::findThreads(getOperation()));
    case ScheduleStage::updates:
    case ScheduleStage::loads:
      return applyToLoops(warp::findEntry(getOperation()));
    }
  }

  void applyToKernel(FunctionOpInterface kernel) {
    if (!kernel)
      return signalPassFailure();
    ScheduleSite site(kernel);
    applySchedules(site, stage);
  }

  void applyToThreads(warp::ThreadsOp threads) {
    if (!threads)
      return signalPassFailure();
    ScheduleSite site(threads->getParentOfType<FunctionOpInterface>());
    site.threads = threads;
    applySchedules(site, stage);
  }

  void applyToLoops(FunctionOpInterface entry) {
    if (!entry)
      return signalPassFailure();
    if (!warp::getTarget(entry).isSimt())
      return;
    SmallVector<scf::ForOp> loops;
    entry->walk([&](scf::ForOp loop) { loops.push_back(loop); });
    ScheduleSite site(entry);
    for (scf::ForOp loop : loops) {
      site.loop = loop;
      applySchedules(site, stage);
    }
  }
};

} // namespace
