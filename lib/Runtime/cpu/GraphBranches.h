//===- GraphBranches.h - Nodes of CPU graphs on several threads -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CPU_GRAPHBRANCHES_H
#define WARP_LIB_RUNTIME_CPU_GRAPHBRANCHES_H

#include "warp/Graph.h"

#include <cstddef>
#include <functional>
#include <vector>

namespace warp {

/// Neighbouring nodes of a schedule, each of which runs on one thread. All
/// nodes before them have run.
class GraphBranches {
public:
  GraphBranches(const GraphSchedule &schedule, size_t first, size_t last);

  size_t first() const { return begin; }
  size_t last() const { return begin + followers.size(); }
  /// Threads that may have a node at a time; 1 if the nodes are a chain.
  int width() const { return most; }
  /// Runs the nodes, each behind those that it comes behind.
  void run(const std::function<void(size_t)> &runNode) const;

private:
  size_t begin;
  int most = 1;
  /// By node, counted from the first one.
  std::vector<std::vector<int>> followers;
  std::vector<int> waits;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_CPU_GRAPHBRANCHES_H
