//===- GraphRefresh.h - Tier-1 code for captured launches -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A capture records launches of tier-0 code as it finds them. Once the tier-1
// code of all of them is there, the graph gets it, and the executable graph is
// updated. Both tiers compute the same bits.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_GRAPHREFRESH_H
#define WARP_LIB_RUNTIME_CUDA_GRAPHREFRESH_H

#include "GraphDriver.h"
#include "GraphImpl.h"

#include <map>

namespace warp::cuda {

/// The launches of tier-0 code in a graph.
class ProvisionalNodes {
public:
  explicit ProvisionalNodes(std::vector<ProvisionalLaunch> launches)
      : launches(std::move(launches)) {}

  /// Launches whose tier-1 code the graph does not have.
  size_t size() const { return launches.size(); }
  const std::vector<ProvisionalLaunch> &all() const { return launches; }
  /// True if there are some, and the tier-1 code of each has been made.
  bool areReady();
  /// Gives the code to the nodes of a graph and updates its executable. A
  /// driver that refuses an update keeps running tier-0 code.
  void exchange(GraphHandle graph, GraphExec exec);

private:
  using Functions = std::map<Function, Function>;
  static void exchange(GraphHandle graph, const Functions &functions);

  std::vector<ProvisionalLaunch> launches;
  /// The launches before it have their code.
  size_t next = 0;
};

/// True if the driver can exchange code in graphs.
bool canRefreshGraphs();

} // namespace warp::cuda

#endif // WARP_LIB_RUNTIME_CUDA_GRAPHREFRESH_H
