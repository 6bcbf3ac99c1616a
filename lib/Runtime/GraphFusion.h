//===- GraphFusion.h - Launches of a graph that are one ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHFUSION_H
#define WARP_LIB_RUNTIME_GRAPHFUSION_H

#include "GraphFills.h"
#include "GraphNodes.h"
#include "GraphOrder.h"

#include <map>
#include <memory>
#include <vector>

namespace warp {

/// A launch that takes the place of several.
struct FusedLaunch {
  std::shared_ptr<Kernel> kernel;
  Kernel::Plan plan;
  /// The parameter block.
  std::vector<uint64_t> params;
};

/// The nodes of a graph once launches are fused, in an order that keeps the
/// edges of the schedule.
struct FusedNodes {
  std::vector<NodeRecord> records;
  /// The former nodes of each one, and the launch if they are fused.
  std::vector<std::vector<int>> members;
  std::map<size_t, FusedLaunch> launches;
  /// The memory that a node with several fills writes.
  std::map<size_t, std::vector<FillRegion>> fills;
};

/// Fuses launches of nodes that were recorded in a chain. Says in `records` of
/// each launch why it is not fused with another one. With `joinsFills`, fills
/// become one node where that delays nothing.
FusedNodes fuseLaunches(std::vector<NodeRecord> &records,
                        const GraphSchedule &schedule, bool joinsFills = false);

/// Edges from each node to the next.
std::vector<std::vector<int>> chainOf(size_t count);

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHFUSION_H
