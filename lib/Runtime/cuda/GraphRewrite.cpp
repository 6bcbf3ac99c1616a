//===- GraphRewrite.cpp - Edges of captured graphs by access --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The nodes between two positions of a stream belong to one call of the
// runtime, and so to one group. Edges within a group stay; those between groups
// are replaced by edges of the dependency DAG (GraphOrder.cpp). A node that no
// call has made, by another library say, is a group that keeps its order with
// all others.
//
// A kernel that may start while the one before it ends, and waits for it in its
// first instruction, keeps such an edge if it is the only one that leads to it:
// its predecessor has waited likewise, so all that comes before has ended.
//
// A fused launch (GraphFusion.cpp) is captured into the graph, behind nothing,
// and those that it stands for are destroyed.
//
//===----------------------------------------------------------------------===//

#include "GraphRewrite.h"

#include "Device.h"
#include "GraphClone.h"
#include "GraphFusion.h"
#include "GraphOrder.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <queue>

using namespace warp;
using namespace warp::cuda;

/// Bytes that a copy or fill moves in the time of a few launches.
static constexpr int64_t manyBytes = int64_t(4) << 20;
/// More branches cost more to start than they save.
static constexpr size_t mostBranches = 16;
/// Larger graphs keep the order of their recording: sets of nodes would take
/// too much memory.
static constexpr size_t mostNodes = 8000;

namespace {

class Groups {
public:
  Groups(GraphHandle graph, const GraphTrace &trace,
         const std::vector<GraphStep> &steps);

  bool areOrdered() const { return order.size() == records.size(); }
  /// True if each group comes behind the one before.
  bool isChain() const;
  /// Keeps launches of several nodes from being fused.
  void keepApart();
  /// Puts fused launches in the place of those that were recorded; false if the
  /// driver does not take them.
  bool fuse(GraphHandle graph, FusedNodes fused, Stream &stream);
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
  EdgeData dataOf(GraphNode to, size_t from, size_t group, bool isOnly) const;
  void remove(GraphNode node);

  std::vector<GraphEdge> edges;
  /// Attributes of edges that let a node start early, once launches are fused.
  std::map<GraphNode, EdgeData> early;
  std::map<GraphNode, int> owner;
  std::map<GraphNode, std::vector<GraphNode>> predecessors;
  std::vector<std::vector<GraphNode>> members;
  std::vector<int> order;
};

} // namespace

static std::vector<GraphEdge> edgesOf(GraphHandle graph) {
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
bool Groups::claim(const GraphStep &step, int number) {
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

Groups::Groups(GraphHandle graph, const GraphTrace &trace,
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
    if (!isAlone)
      records.back().barrier = "it works on several streams";
  }
  for (GraphNode node : nodes)
    if (owner.try_emplace(node, int(members.size())).second) {
      members.push_back({node});
      records.push_back(unknownNode(typeName(node)));
    }
  sort();
}

/// Brings groups into an order that keeps the edges, those made first first.
void Groups::sort() {
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
std::vector<GraphNode> Groups::firstOf(size_t group) const {
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
std::vector<GraphNode> Groups::lastOf(size_t group) const {
  std::vector<GraphNode> last = members[group];
  for (GraphNode node : members[group])
    for (GraphNode other : predecessors.at(node))
      if (groupOf(other) == int(group))
        last.erase(std::remove(last.begin(), last.end(), other), last.end());
  return last;
}

/// The attributes of an edge to a node.
EdgeData Groups::dataOf(GraphNode to, size_t from, size_t group,
                        bool isOnly) const {
  std::vector<GraphNode> last = lastOf(from);
  if (!isOnly || last.size() != 1 || typeOf(last.front()) != nodeKernel)
    return {};
  for (const GraphEdge &edge : edges) {
    if (edge.to != to || !edge.data.isProgrammatic())
      continue;
    // Kernels of others may wait later.
    if (edge.from == last.front() ||
        (records[from].barrier.empty() && records[group].barrier.empty()))
      return edge.data;
  }
  auto known = early.find(to);
  if (known != early.end() && records[from].barrier.empty() &&
      records[group].barrier.empty())
    return known->second;
  return {};
}

//===----------------------------------------------------------------------===//
// Fused launches
//===----------------------------------------------------------------------===//

bool Groups::isChain() const {
  for (size_t i = 1; i < before.size(); ++i)
    if (std::find(before[i].begin(), before[i].end(), int(i) - 1) ==
        before[i].end())
      return false;
  return true;
}

void Groups::keepApart() {
  for (size_t i = 0; i < records.size(); ++i)
    if (!only(i) || typeOf(only(i)) != nodeKernel)
      records[i].launch = nullptr;
}

/// The node of a launch, behind nothing.
static GraphNode addLaunch(GraphHandle graph, FusedLaunch &launch,
                           Stream &stream) {
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
    launch.kernel->runAtOnce(launch.plan, launch.params.data(), &stream);
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

void Groups::remove(GraphNode node) {
  edges.erase(std::remove_if(edges.begin(), edges.end(),
                             [&](const GraphEdge &edge) {
                               return edge.from == node || edge.to == node;
                             }),
              edges.end());
  owner.erase(node);
  predecessors.erase(node);
  for (auto &[other, list] : predecessors)
    list.erase(std::remove(list.begin(), list.end(), node), list.end());
  WARP_CUDA_GRAPH(destroyNode, node);
}

bool Groups::fuse(GraphHandle graph, FusedNodes fused, Stream &stream) {
  for (const GraphEdge &edge : edges)
    if (edge.data.isProgrammatic())
      early[edge.to] = edge.data;
  // All or none: a launch that fails leaves the graph as it was.
  std::map<size_t, GraphNode> nodes;
  try {
    for (auto &[i, launch] : fused.launches)
      nodes[i] = addLaunch(graph, launch, stream);
  } catch (const Error &) {
    for (const auto &[i, node] : nodes)
      WARP_CUDA_GRAPH(destroyNode, node);
    return false;
  }
  std::vector<std::vector<GraphNode>> made;
  for (size_t i = 0; i < fused.members.size(); ++i) {
    const std::vector<int> &parts = fused.members[i];
    auto added = nodes.find(i);
    if (added == nodes.end()) {
      made.push_back(std::move(members[parts.front()]));
    } else {
      GraphNode node = added->second;
      for (int part : parts) {
        GraphNode old = members[part].front();
        if (auto known = early.find(old); known != early.end())
          early[node] = EdgeData(known->second);
        remove(old);
      }
      predecessors[node];
      made.push_back({node});
    }
    for (GraphNode node : made.back())
      owner[node] = int(i);
  }
  members = std::move(made);
  records = std::move(fused.records);
  before = chainOf(records.size());
  return true;
}

void Groups::exchange(const GraphSchedule &schedule,
                      std::vector<GraphEdge> &removed,
                      std::vector<GraphEdge> &added) const {
  std::vector<GraphEdge> wanted;
  for (size_t group = 0; group < members.size(); ++group) {
    const auto &list = schedule.nodes[group].before;
    if (list.empty())
      continue;
    std::vector<GraphNode> first = firstOf(group);
    bool isOnly = list.size() == 1;
    for (const GraphSchedule::Edge &edge : list)
      for (GraphNode to : first)
        for (GraphNode from : lastOf(edge.from))
          wanted.push_back({from, to, dataOf(to, edge.from, group, isOnly)});
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

//===----------------------------------------------------------------------===//
// Changes
//===----------------------------------------------------------------------===//

using Call = Result (*)(GraphHandle, const GraphNode *, const GraphNode *,
                        const EdgeData *, size_t);

static void callWith(Call call, const char *name, GraphHandle graph,
                     const std::vector<GraphEdge> &edges) {
  std::vector<GraphNode> from, to;
  std::vector<EdgeData> data;
  for (const GraphEdge &edge : edges) {
    from.push_back(edge.from);
    to.push_back(edge.to);
    data.push_back(edge.data);
  }
  if (!edges.empty())
    check(call(graph, from.data(), to.data(), data.data(), edges.size()), name);
}

void GraphRewriter::apply(const Change &change) {
  callWith(graphDriver().removeEdges, "cuGraphRemoveDependencies", change.graph,
           change.removed);
  callWith(graphDriver().addEdges, "cuGraphAddDependencies", change.graph,
           change.added);
}

std::string GraphRewriter::undo() {
  if (kernels.empty()) {
    for (const Change &change : changes)
      apply({change.graph, change.added, change.removed});
    changes.clear();
    return "the CUDA driver refuses its edges";
  }
  for (Change &change : changes) {
    Change plain{change.graph, {}, {}};
    for (GraphEdge edge : edgesOf(change.graph)) {
      if (!edge.data.isProgrammatic())
        continue;
      plain.removed.push_back(edge);
      edge.data = {};
      plain.added.push_back(edge);
    }
    apply(plain);
  }
  changes.clear();
  return "";
}

static GraphCapacity capacityOf(int device) {
  int threads = 0;
  WARP_CUDA(deviceGetAttribute, &threads, maxThreadsPerMultiprocessor,
            cudaDevice(device).ordinal);
  GraphCapacity capacity;
  if (threads > 0)
    capacity.threads = int64_t(threads) * deviceInfo(device).smCount;
  capacity.bytes = manyBytes;
  capacity.branches = mostBranches;
  return capacity;
}

std::shared_ptr<const GraphSchedule> cuda::keptSchedule(std::string why) {
  auto schedule = std::make_shared<GraphSchedule>();
  schedule->kept = std::move(why);
  return schedule;
}

std::shared_ptr<const GraphSchedule>
GraphRewriter::rewrite(GraphHandle graph, const GraphTrace &trace,
                       const std::vector<GraphStep> &steps, Stream &stream) {
  const GraphDriver &driver = graphDriver();
  if (!driver.allEdges || !driver.addEdges || !driver.removeEdges ||
      !driver.nodeType || !driver.captureInfo)
    return keptSchedule("the CUDA driver is older than 12.3");
  if (nodesOf(graph).size() > mostNodes)
    return keptSchedule("it has more than " + std::to_string(mostNodes) +
                        " nodes");
  Groups groups(graph, trace, steps);
  if (!groups.areOrdered())
    return keptSchedule("calls of several threads are mixed in it");
  std::shared_ptr<GraphSchedule> schedule;
  size_t recordedEdges = 0;
  for (const std::vector<int> &list : groups.before)
    recordedEdges += list.size();
  if (driver.destroyNode && driver.beginCaptureTo && groups.isChain()) {
    groups.keepApart();
    FusedNodes fused = fuseLaunches(
        groups.records, *makeSchedule(groups.records, groups.before, {}));
    std::vector<std::shared_ptr<Kernel>> made;
    for (const auto &[number, launch] : fused.launches)
      made.push_back(launch.kernel);
    if (!made.empty() && groups.fuse(graph, std::move(fused), stream))
      kernels.insert(kernels.end(), made.begin(), made.end());
  }
  schedule = makeSchedule(groups.records, groups.before, capacityOf(device));
  schedule->recordedEdges = recordedEdges;
  for (size_t i = 0; i < schedule->nodes.size(); ++i)
    if (auto body = bodies.find(groups.only(i)); body != bodies.end())
      schedule->nodes[i].body = body->second;
  Change change{graph, {}, {}};
  groups.exchange(*schedule, change.removed, change.added);
  if (change.removed.empty() && change.added.empty())
    return schedule;
  apply(change);
  changes.push_back(std::move(change));
  return schedule;
}
