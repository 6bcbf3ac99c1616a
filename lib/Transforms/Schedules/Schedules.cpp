//===- Schedules.cpp - List of launch schedules ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In the order in which they are asked: the first mapping that pays is made.
// To add a schedule is to add a file, its line here, and its field to Launch.td
// if the runtime has to know of it (docs/schedules.md).
//
//===----------------------------------------------------------------------===//

#include "Schedules.h"

using namespace mlir;

using MakeSchedule = std::unique_ptr<warp::LaunchRewrite>(warp::ScheduleSite &);
MakeSchedule makeCoarsenBlocks, makeSingleBlock, makeStageTransposes,
    makeCoarsenReductions, makeCoarsenThreads, makeSplitReduction,
    makeUnrollAndJam, makeMapToGrid, makeReverseOrder, makeRingReduction,
    makeStageRows, makeStageSharedLoads;

static bool onGpu(const warp::TargetInfo &target) { return target.isSimt(); }
/// Matrix instructions of warpgroups.
static bool withWarpgroups(const warp::TargetInfo &target) {
  return target.has(warp::Feature::Wgmma);
}

using warp::ScheduleStage;

static const warp::ScheduleEntry schedules[] = {
    {ScheduleStage::tiles, withWarpgroups, "tiles.py: product",
     makeCoarsenBlocks},
    // Mappings; the last is for all kernels.
    {ScheduleStage::threads, onGpu, "", makeSingleBlock},
    {ScheduleStage::threads, onGpu, "gpu.py: transposing kernel",
     makeStageTransposes},
    {ScheduleStage::threads, onGpu, "gpu.py: atomics, one address",
     makeCoarsenReductions},
    {ScheduleStage::threads, onGpu, "gpu.py: saxpy, stencil",
     makeCoarsenThreads},
    {ScheduleStage::threads, onGpu, "gpu.py: n-body, 4096 points, fast_math",
     makeSplitReduction},
    {ScheduleStage::threads, onGpu, "gpu.py: n-body, 131072 points",
     makeUnrollAndJam},
    {ScheduleStage::threads, onGpu, "", makeMapToGrid},
    // On top of a mapping.
    {ScheduleStage::threads, onGpu, "gpu.py: saxpy", makeReverseOrder},
    // Loops.
    {ScheduleStage::updates, onGpu, "autodiff.py: n-body", makeRingReduction},
    {ScheduleStage::updates, onGpu, "shapes.py: long_rows", makeStageRows},
    {ScheduleStage::loads, onGpu, "gpu.py: n-body, in order",
     makeStageSharedLoads},
};

ArrayRef<warp::ScheduleEntry> warp::getSchedules() { return schedules; }
