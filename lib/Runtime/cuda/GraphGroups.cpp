//===- GraphGroups.cpp - Nodes of a captured graph by calls ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The nodes between two positions of a stream belong to one call of the
// runtime, and so to one group. A node that no call has made, by another
// library say, is a group that keeps its order with all others.
//
// A fused launch (GraphFusion.cpp) is captured into the graph, behind nothing,
// and those that it stands for are destroyed. So is a kernel for several fills.
//
//===----------------------------------------------------------------------===//

#include "GraphGroups.h"

#include "Device.h"
#include "FillKernel.h"
#include "GraphClone.h"

#include <algorithm>
#include <optional>
#include <queue>

using namespace warp;
using namespace warp::cuda;

static std::string typeName(GraphNode node) {
  switch (typeOf(node)) {
  case nodeKernel:
    return "kernel";
  case nodeCopy:
    return "copy";
  case nodeFill:
    return "fill";
  case nodeGraph:
    return "graph";
  case nodeWait:
  case nodeRecord:
    return "event";
  default:
    return "node";
  }
}

/// Makes the nodes of a step a group. False if they do not lie between its two
/// positions alone.
bool NodeGroups::claim(const GraphStep &step, int number) {
  bool isAlone = true;
  std::vector<GraphNode> left;
  auto has = [](const std::vector<NodeId> &nodes, GraphNode node) {
    return std::find(nodes.begin(), nodes.end(), node) != nodes.end();
  };
  auto push = [&](GraphNode node) {
    if (has(step.before, node))
      return;
    auto [entry, isNew] = owner.try_emplace(node, number);
    if (isNew)
      left.push_back(node);
    else
      isAlone &= entry->second == number;
  };
  for (NodeId last : step.after) {
    auto node = static_cast<GraphNode>(const_cast<void *>(last));
    if (predecessors.count(node))
      push(node);
  }
  for (size_t i = 0; i < left.size(); ++i) {
    const std::vector<GraphNode> &next = predecessors.at(left[i]);
    isAlone &= !next.empty() || step.before.empty();
    for (GraphNode node : next)
      push(node);
  }
  members.push_back(std::move(left));
  return isAlone;
}

NodeGroups::NodeGroups(GraphHandle graph, const GraphTrace &trace,
                       const std::vector<GraphStep> &steps)
    : edges(edgesOf(graph)) {
  std::vector<GraphNode> nodes = nodesOf(graph);
  for (GraphNode node : nodes)
    predecessors[node];
  for (const GraphEdge &edge : edges)
    predecessors[edge.to].push_back(edge.from);
  for (const GraphStep &step : steps) {
    int number = int(members.size());
    bool isAlone = claim(step, number);
    if (members.back().empty()) {
      members.pop_back();
      continue;
    }
    records.push_back(recordOf(trace, step.first, step.last));
    if (!isAlone) {
      records.back().barrier = "it works on several streams";
      records.back().isOwn = false;
    }
  }
  for (GraphNode node : nodes)
    if (owner.try_emplace(node, int(members.size())).second) {
      members.push_back({node});
      records.push_back(unknownNode(typeName(node)));
    }
  sort();
  if (areOrdered())
    findEarly();
}

/// Brings groups into an order that keeps the edges, those made first first.
void NodeGroups::sort() {
  size_t count = members.size();
  std::vector<std::vector<int>> from(count), to(count);
  for (const GraphEdge &edge : edges) {
    int a = groupOf(edge.from), b = groupOf(edge.to);
    if (a == b || std::count(from[b].begin(), from[b].end(), a))
      continue;
    from[b].push_back(a);
    to[a].push_back(b);
  }
  std::vector<size_t> waits(count);
  std::priority_queue<int, std::vector<int>, std::greater<>> ready;
  for (size_t i = 0; i < count; ++i)
    if ((waits[i] = from[i].size()) == 0)
      ready.push(int(i));
  std::vector<int> place(count);
  while (!ready.empty()) {
    int group = ready.top();
    ready.pop();
    place[group] = int(order.size());
    order.push_back(group);
    for (int next : to[group])
      if (--waits[next] == 0)
        ready.push(next);
  }
  if (!areOrdered())
    return;
  std::vector<NodeRecord> sortedRecords;
  std::vector<std::vector<GraphNode>> sortedMembers;
  for (int group : order) {
    sortedRecords.push_back(std::move(records[group]));
    sortedMembers.push_back(std::move(members[group]));
    std::vector<int> &list = before.emplace_back();
    for (int other : from[group])
      list.push_back(place[other]);
  }
  records = std::move(sortedRecords);
  members = std::move(sortedMembers);
  for (auto &[node, group] : owner)
    group = place[group];
}

/// The nodes of a group that come behind none of it.
std::vector<GraphNode> NodeGroups::firstOf(size_t group) const {
  std::vector<GraphNode> first;
  for (GraphNode node : members[group]) {
    const std::vector<GraphNode> &list = predecessors.at(node);
    if (std::none_of(list.begin(), list.end(), [&](GraphNode other) {
          return groupOf(other) == int(group);
        }))
      first.push_back(node);
  }
  return first;
}

/// The nodes of a group that none of it comes behind.
std::vector<GraphNode> NodeGroups::lastOf(size_t group) const {
  std::vector<GraphNode> last = members[group];
  for (GraphNode node : members[group])
    for (GraphNode other : predecessors.at(node))
      if (groupOf(other) == int(group))
        last.erase(std::remove(last.begin(), last.end(), other), last.end());
  return last;
}

//===----------------------------------------------------------------------===//
// Fused launches
//===----------------------------------------------------------------------===//

bool NodeGroups::isChain() const {
  for (size_t i = 1; i < before.size(); ++i)
    if (std::find(before[i].begin(), before[i].end(), int(i) - 1) ==
        before[i].end())
      return false;
  return true;
}

void NodeGroups::keepApart() {
  for (size_t i = 0; i < records.size(); ++i)
    if (!only(i) || typeOf(only(i)) != nodeKernel)
      records[i].launch = nullptr;
}

/// The node of a launch that `queue` makes, behind nothing.
template <typename Queue>
static GraphNode addLaunch(GraphHandle graph, Stream &stream, Queue queue) {
  auto raw = static_cast<StreamHandle>(stream.handle());
  WARP_CUDA_GRAPH(beginCaptureTo, raw, graph, nullptr, nullptr, 0,
                  captureRelaxed);
  CaptureStatus status = captureNone;
  uint64_t id;
  GraphHandle current = nullptr;
  const GraphNode *last = nullptr;
  size_t count = 0;
  GraphNode node = nullptr;
  std::optional<Error> failure;
  try {
    queue();
    WARP_CUDA_GRAPH(captureInfo, raw, &status, &id, &current, &last, &count);
    if (count == 1)
      node = last[0];
  } catch (const Error &error) {
    failure = error;
  }
  WARP_CUDA_GRAPH(endCapture, raw, &current);
  if (failure)
    throw *failure;
  if (!node)
    throw Error(Error::Kind::Runtime, "the driver names no node");
  return node;
}

void NodeGroups::remove(const std::set<GraphNode> &nodes) {
  auto isGone = [&](GraphNode node) { return nodes.count(node) != 0; };
  std::erase_if(edges, [&](const GraphEdge &edge) {
    return isGone(edge.from) || isGone(edge.to);
  });
  std::erase_if(predecessors,
                [&](const auto &entry) { return isGone(entry.first); });
  for (auto &[other, list] : predecessors)
    std::erase_if(list, isGone);
  for (GraphNode node : nodes) {
    owner.erase(node);
    WARP_CUDA_GRAPH(destroyNode, node);
  }
}

bool NodeGroups::fuse(GraphHandle graph, FusedNodes fused, int device,
                      Stream &stream) {
  // All or none: a launch that fails leaves the graph as it was.
  std::map<size_t, GraphNode> nodes;
  try {
    for (auto &[i, launch] : fused.launches)
      nodes[i] = addLaunch(graph, stream, [&, &launch = launch] {
        launch.kernel->runAtOnce(launch.plan, launch.params.data(), &stream);
      });
    for (const auto &[i, regions] : fused.fills)
      fills.insert(nodes[i] = addLaunch(graph, stream, [&, &regions = regions] {
                     fillByKernel(device, regions, stream);
                   }));
  } catch (const Error &) {
    for (const auto &[i, node] : nodes)
      WARP_CUDA_GRAPH(destroyNode, node);
    return false;
  }
  std::vector<std::vector<GraphNode>> made;
  std::set<GraphNode> replaced;
  for (size_t i = 0; i < fused.members.size(); ++i) {
    const std::vector<int> &parts = fused.members[i];
    auto added = nodes.find(i);
    if (added == nodes.end()) {
      made.push_back(std::move(members[parts.front()]));
    } else {
      GraphNode node = added->second;
      for (int part : parts)
        for (GraphNode old : members[part]) {
          if (auto known = early.find(old); known != early.end())
            early[node] = EdgeData(known->second);
          replaced.insert(old);
        }
      predecessors[node];
      made.push_back({node});
    }
    for (GraphNode node : made.back())
      owner[node] = int(i);
  }
  remove(replaced);
  members = std::move(made);
  records = std::move(fused.records);
  before = chainOf(records.size());
  return true;
}
