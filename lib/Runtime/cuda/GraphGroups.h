//===- GraphGroups.h - Nodes of a captured graph by calls -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_GRAPHGROUPS_H
#define WARP_LIB_RUNTIME_CUDA_GRAPHGROUPS_H

#include "GraphDriver.h"
#include "Runtime/GraphFusion.h"
#include "warp/Graph.h"

#include <map>
#include <set>
#include <string>
#include <vector>

namespace warp::cuda {

struct GraphEdge {
  GraphNode from, to;
  EdgeData data;

  auto operator<=>(const GraphEdge &) const = default;
};

std::vector<GraphEdge> edgesOf(GraphHandle graph);

/// The nodes of a graph, in groups of those that one call of the runtime made.
class NodeGroups {
public:
  NodeGroups(GraphHandle graph, const GraphTrace &trace,
             const std::vector<GraphStep> &steps);

  bool areOrdered() const { return order.size() == records.size(); }
  /// True if each group comes behind the one before.
  bool isChain() const;
  /// Keeps launches of several nodes from being fused.
  void keepApart();
  /// Puts fused launches, and fills that are one, in the place of those that
  /// were recorded; false if the driver does not take them.
  bool fuse(GraphHandle graph, FusedNodes fused, int device, Stream &stream);
  void exchange(const GraphSchedule &schedule, std::vector<GraphEdge> &removed,
                std::vector<GraphEdge> &added) const;
  /// The only node of a group, or null.
  GraphNode only(size_t group) const {
    return members[group].size() == 1 ? members[group].front() : nullptr;
  }

  /// By the position in an order that keeps the edges.
  std::vector<NodeRecord> records;
  std::vector<std::vector<int>> before;

private:
  bool claim(const GraphStep &step, int number);
  void sort();
  int groupOf(GraphNode node) const { return owner.at(node); }
  std::vector<GraphNode> firstOf(size_t group) const;
  std::vector<GraphNode> lastOf(size_t group) const;
  EdgeData dataOf(GraphNode to, size_t from, size_t group) const;
  void findEarly();
  void remove(const std::set<GraphNode> &nodes);

  std::vector<GraphEdge> edges;
  /// Attributes of edges that let a node start early.
  std::map<GraphNode, EdgeData> early;
  /// Kernels that stand for fills.
  std::set<GraphNode> fills;
  std::map<GraphNode, int> owner;
  std::map<GraphNode, std::vector<GraphNode>> predecessors;
  std::vector<std::vector<GraphNode>> members;
  std::vector<int> order;
};

} // namespace warp::cuda

#endif // WARP_LIB_RUNTIME_CUDA_GRAPHGROUPS_H
