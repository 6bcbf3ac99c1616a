//===- GraphEdges.cpp - Edges between groups of a graph's nodes -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Edges within a group stay; those between groups are replaced by edges of the
// dependency DAG (GraphOrder.cpp).
//
// A kernel that may start while the one before it ends, and waits for it in its
// first instruction, keeps such an edge if it is the only one that leads to it:
// its predecessor has waited likewise, so all that comes before has ended.
// That holds for the runtime's own kernels alone. A kernel of another library
// may end without a wait, and then what comes behind it would not come behind
// its predecessors; it may also let others start before it has written. Edges
// from and to such kernels wait for the end, as do those of kernels that stand
// for fills.
//
//===----------------------------------------------------------------------===//

#include "GraphClone.h"
#include "GraphGroups.h"
#include "Kernel.h"

#include <algorithm>
#include <iterator>

using namespace warp;
using namespace warp::cuda;

std::vector<GraphEdge> cuda::edgesOf(GraphHandle graph) {
  size_t count = 0;
  WARP_CUDA_GRAPH(allEdges, graph, nullptr, nullptr, nullptr, &count);
  std::vector<GraphNode> from(count), to(count);
  std::vector<EdgeData> data(count);
  if (count)
    WARP_CUDA_GRAPH(allEdges, graph, from.data(), to.data(), data.data(),
                    &count);
  std::vector<GraphEdge> edges;
  for (size_t i = 0; i < count; ++i)
    edges.push_back({from[i], to[i], data[i]});
  return edges;
}

/// Finds the nodes that may start before the kernel before them has ended:
/// those that were recorded so, and launches of code that waits first.
void NodeGroups::findEarly() {
  for (const GraphEdge &edge : edges)
    if (edge.data.isProgrammatic())
      early[edge.to] = edge.data;
  for (size_t i = 0; i < records.size(); ++i)
    if (GraphNode node = only(i); node && records[i].launch &&
                                  typeOf(node) == nodeKernel &&
                                  waitsFirst(records[i].launch->plan))
      early.try_emplace(node, programmaticEdge);
}

/// The attributes of an edge to a node, if it may start early.
EdgeData NodeGroups::dataOf(GraphNode to, size_t from, size_t group) const {
  if (!records[from].isOwn || !records[group].isOwn)
    return {};
  std::vector<GraphNode> last = lastOf(from);
  if (last.size() != 1 || typeOf(last.front()) != nodeKernel ||
      fills.count(last.front()))
    return {};
  auto known = early.find(to);
  return known != early.end() ? known->second : EdgeData();
}

void NodeGroups::exchange(const GraphSchedule &schedule,
                          std::vector<GraphEdge> &removed,
                          std::vector<GraphEdge> &added) const {
  std::vector<GraphEdge> wanted;
  for (size_t group = 0; group < members.size(); ++group) {
    const auto &list = schedule.nodes[group].before;
    if (list.empty())
      continue;
    std::vector<GraphNode> first = firstOf(group);
    for (const GraphSchedule::Edge &edge : list)
      for (GraphNode to : first) {
        EdgeData data =
            list.size() == 1 ? dataOf(to, edge.from, group) : EdgeData();
        for (GraphNode from : lastOf(edge.from))
          wanted.push_back({from, to, data});
      }
  }
  std::vector<GraphEdge> old;
  for (const GraphEdge &edge : edges)
    if (groupOf(edge.from) != groupOf(edge.to))
      old.push_back(edge);
  std::sort(old.begin(), old.end());
  std::sort(wanted.begin(), wanted.end());
  std::set_difference(old.begin(), old.end(), wanted.begin(), wanted.end(),
                      std::back_inserter(removed));
  std::set_difference(wanted.begin(), wanted.end(), old.begin(), old.end(),
                      std::back_inserter(added));
}
