//===- GraphRewrite.cpp - Edges of captured graphs by access --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The nodes of a captured graph form groups (GraphGroups.cpp), some of which
// become one (GraphFusion.cpp); then the edges between them are exchanged
// (GraphEdges.cpp).
//
//===----------------------------------------------------------------------===//

#include "GraphRewrite.h"

#include "Device.h"
#include "GraphClone.h"
#include "GraphOrder.h"

using namespace warp;
using namespace warp::cuda;

/// Bytes that a copy or fill moves in the time of a few launches.
static constexpr int64_t manyBytes = int64_t(4) << 20;
/// More branches cost more to start than they save.
static constexpr size_t mostBranches = 16;
/// Larger graphs keep the order of their recording: sets of nodes would take
/// too much memory.
static constexpr size_t mostNodes = 8000;

using Call = Result (*)(GraphHandle, const GraphNode *, const GraphNode *,
                        const EdgeData *, size_t);

namespace {
struct EdgeLists {
  std::vector<GraphNode> from, to;
  std::vector<EdgeData> data;
};
} // namespace

/// A call has edges of equal attributes alone: the driver takes those of the
/// first one for all.
static void callWith(Call call, const char *name, GraphHandle graph,
                     const std::vector<GraphEdge> &edges) {
  std::map<EdgeData, EdgeLists> lists;
  for (const GraphEdge &edge : edges) {
    EdgeLists &list = lists[edge.data];
    list.from.push_back(edge.from);
    list.to.push_back(edge.to);
    list.data.push_back(edge.data);
  }
  for (const auto &[data, list] : lists)
    check(call(graph, list.from.data(), list.to.data(), list.data.data(),
               list.from.size()),
          name);
}

void GraphRewriter::apply(const Change &change) {
  callWith(graphDriver().removeEdges, "cuGraphRemoveDependencies", change.graph,
           change.removed);
  callWith(graphDriver().addEdges, "cuGraphAddDependencies", change.graph,
           change.added);
}

std::string GraphRewriter::undo() {
  if (!hasFused) {
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
  NodeGroups groups(graph, trace, steps);
  if (!groups.areOrdered())
    return keptSchedule("calls of several threads are mixed in it");
  std::shared_ptr<GraphSchedule> schedule;
  size_t recordedEdges = 0;
  for (const std::vector<int> &list : groups.before)
    recordedEdges += list.size();
  if (driver.destroyNode && driver.beginCaptureTo && groups.isChain()) {
    groups.keepApart();
    FusedNodes fused = fuseLaunches(
        groups.records, *makeSchedule(groups.records, groups.before, {}),
        /*joinsFills=*/true);
    std::vector<std::shared_ptr<Kernel>> made;
    for (const auto &[number, launch] : fused.launches)
      made.push_back(launch.kernel);
    bool changes = !made.empty() || !fused.fills.empty();
    if (changes && groups.fuse(graph, std::move(fused), device, stream)) {
      kernels.insert(kernels.end(), made.begin(), made.end());
      hasFused = true;
    }
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
