//===- FillKernel.cpp - Fills of several regions by a kernel --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch of lib/DeviceLib/cuda/Fill.cpp.
//
//===----------------------------------------------------------------------===//

#include "FillKernel.h"

#include "DeviceLib/cuda/LaunchShapes.h"
#include "LibraryKernels.h"

using namespace warp;
using namespace fillShape;

static_assert(mostFills == mostRegions);

namespace {
/// The argument of the kernel.
struct Table {
  FillRegion regions[mostFills];
  int32_t firsts[mostFills] = {};
  int32_t count = 0;
};
} // namespace

void warp::fillByKernel(int device, const std::vector<FillRegion> &regions,
                        const Stream &stream) {
  Table table;
  int32_t blocks = 0;
  for (const FillRegion &region : regions) {
    table.regions[table.count] = region;
    table.firsts[table.count++] = blocks;
    uint64_t aligned = region.begin & ~uint64_t(15);
    blocks += int32_t((region.end - aligned + runBytes - 1) / runBytes);
  }
  QueuedWork work(device, &stream);
  LibraryKernel kernel = kernelOf(device, "Fill", "fill_regions");
  // A plain launch: it ends before anything behind it begins.
  kernel.waits = false;
  launchKernel(work, kernel, blocks, 1, threads, table);
}
