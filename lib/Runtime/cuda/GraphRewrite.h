//===- GraphRewrite.h - Edges of captured graphs by access ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_GRAPHREWRITE_H
#define WARP_LIB_RUNTIME_CUDA_GRAPHREWRITE_H

#include "GraphFuser.h"
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

  /// A branch or loop whose body has been captured; `begin` is the operation of
  /// the trace that begins it.
  void addBody(GraphNode node, GraphHandle graph, size_t begin) {
    captured.push_back({node, graph, begin});
  }
  /// Puts the nodes of a captured graph and those of its bodies behind those
  /// alone that they depend on, and fuses launches. A graph that cannot be
  /// changed keeps its edges, and the schedule says why. `stream` is not
  /// captured now.
  std::shared_ptr<const GraphSchedule>
  rewrite(GraphHandle graph, const GraphTrace &trace, Stream &stream);
  /// True if edges were exchanged.
  bool hasChanges() const { return !changes.empty(); }
  /// All graphs get the edges of their recording back; those with exchanged
  /// nodes keep theirs, but kernels no longer start early. Says what it did.
  std::string undo();
  /// The kernels that were made, which the graph keeps.
  std::vector<std::shared_ptr<Kernel>> kernels;

private:
  struct Body {
    GraphNode node;
    GraphHandle graph;
    size_t begin;
  };
  /// A graph whose launches that may be one are known.
  struct Part {
    /// Null for the graph itself.
    GraphNode node = nullptr;
    GraphHandle graph = nullptr;
    /// Why it is not changed, or empty.
    std::string kept;
    std::unique_ptr<NodeGroups> groups;
    /// Null if launches stay as they are.
    std::unique_ptr<GraphFuser> fuser;
    size_t recordedEdges = 0;
  };
  struct Change {
    GraphHandle graph;
    std::vector<GraphEdge> removed, added;
  };
  void apply(const Change &change);
  static Part prepare(GraphNode node, GraphHandle graph,
                      const GraphTrace &trace,
                      const std::vector<GraphStep> &steps,
                      std::vector<FusionPlan> &plans);
  std::shared_ptr<const GraphSchedule> finish(Part &part, Stream &stream);

  int device;
  /// Nodes were exchanged, too.
  bool hasFused = false;
  std::vector<Change> changes;
  std::vector<Body> captured;
  std::map<GraphNode, std::shared_ptr<const GraphSchedule>> bodies;
};

/// The schedule of a graph that keeps the order of its recording.
std::shared_ptr<const GraphSchedule> keptSchedule(std::string why);

} // namespace warp::cuda

#endif // WARP_LIB_RUNTIME_CUDA_GRAPHREWRITE_H
