//===- GraphRewrite.h - Edges of captured graphs by access ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_GRAPHREWRITE_H
#define WARP_LIB_RUNTIME_CUDA_GRAPHREWRITE_H

#include "GraphGroups.h"
#include "GraphTrace.h"
#include "warp/Device.h"
#include "warp/Graph.h"

#include <map>
#include <memory>
#include <vector>

namespace warp::cuda {

/// Exchanges edges of graphs, and launches for fused ones.
class GraphRewriter {
public:
  explicit GraphRewriter(int device) : device(device) {}

  /// Puts the nodes of a captured graph, where `steps` are, behind those alone
  /// that they depend on, and fuses launches. A graph that cannot be changed
  /// keeps its edges, and the schedule says why. `stream` is not captured now.
  std::shared_ptr<const GraphSchedule>
  rewrite(GraphHandle graph, const GraphTrace &trace,
          const std::vector<GraphStep> &steps, Stream &stream);
  /// A branch or loop has been put in order.
  void addBody(GraphNode node, std::shared_ptr<const GraphSchedule> body) {
    bodies[node] = std::move(body);
  }
  /// True if edges were exchanged.
  bool hasChanges() const { return !changes.empty(); }
  /// All graphs get the edges of their recording back; those with exchanged
  /// nodes keep theirs, but kernels no longer start early. Says what it did.
  std::string undo();
  /// The kernels that were made, which the graph keeps.
  std::vector<std::shared_ptr<Kernel>> kernels;

private:
  struct Change {
    GraphHandle graph;
    std::vector<GraphEdge> removed, added;
  };
  void apply(const Change &change);

  int device;
  /// Nodes were exchanged, too.
  bool hasFused = false;
  std::vector<Change> changes;
  std::map<GraphNode, std::shared_ptr<const GraphSchedule>> bodies;
};

/// The schedule of a graph that keeps the order of its recording.
std::shared_ptr<const GraphSchedule> keptSchedule(std::string why);

} // namespace warp::cuda

#endif // WARP_LIB_RUNTIME_CUDA_GRAPHREWRITE_H
