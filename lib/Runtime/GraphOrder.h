//===- GraphOrder.h - Dependency DAG of a graph's nodes ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHORDER_H
#define WARP_LIB_RUNTIME_GRAPHORDER_H

#include "GraphNodes.h"
#include "warp/Graph.h"

#include <cstdint>
#include <vector>

namespace warp {

/// Limits of a device on work side by side.
struct GraphCapacity {
  /// A launch of so many threads, or a copy or fill of so many bytes, leaves no
  /// room for another one of the kind.
  int64_t threads = INT64_MAX, bytes = INT64_MAX;
  /// Branches that run at a time.
  size_t branches = SIZE_MAX;
};

/// The nodes that each comes behind, the last ones first: those with whose
/// regions its own meet while one of both writes, and none of these before
/// another. `records` are in an order that keeps `recorded`, the nodes that
/// each came behind when it was recorded; no order is added to that.
std::vector<std::vector<GraphSchedule::Edge>>
orderNodes(const std::vector<NodeRecord> &records,
           const std::vector<std::vector<int>> &recorded,
           const GraphCapacity &capacity);

/// The schedule of such nodes, with branches.
std::shared_ptr<GraphSchedule>
makeSchedule(const std::vector<NodeRecord> &records,
             const std::vector<std::vector<int>> &recorded,
             const GraphCapacity &capacity);

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHORDER_H
