//===- GraphOrder.cpp - Dependency DAG of a graph's nodes -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Nodes are taken in the order of their recording. Each is compared with those
// before it, the last one first, unless an edge that it has leads there already
// by others: so no edge is ever superfluous. Accesses are compared with those
// of the same island alone, which is memory that overlaps, by its hulls.
//
// Two nodes that each fill the device gain nothing side by side and take the
// cache from each other: they keep their order. So do nodes behind more
// branches than the device runs at a time.
//
//===----------------------------------------------------------------------===//

#include "GraphOrder.h"

#include <algorithm>
#include <limits>
#include <optional>

using namespace warp;
using Edge = GraphSchedule::Edge;

namespace {

/// A set of nodes.
class NodeSet {
public:
  explicit NodeSet(size_t count) : words((count + 63) / 64) {}
  void add(size_t node) { words[node / 64] |= uint64_t(1) << node % 64; }
  void add(const NodeSet &other) {
    for (size_t i = 0; i < words.size(); ++i)
      words[i] |= other.words[i];
  }
  bool has(size_t node) const { return words[node / 64] >> node % 64 & 1; }

private:
  std::vector<uint64_t> words;
};

/// An access of a node, from its first byte to its last one.
struct Hull {
  uint64_t begin, end;
  int node;
  const NodeAccess *access;
};

class Order {
public:
  Order(const std::vector<NodeRecord> &records,
        const std::vector<std::vector<int>> &recorded,
        const GraphCapacity &capacity);
  std::vector<std::vector<Edge>> run();

private:
  void findIslands();
  void collect(int node);
  void connect(int node, int from, std::string reason);
  void limitBranches(int node);
  bool fills(const NodeRecord &record) const {
    return record.threads >= capacity.threads ||
           (!record.threads && record.bytes >= capacity.bytes);
  }
  std::optional<std::string> conflict(int node, int from) const;

  const std::vector<NodeRecord> &records;
  const GraphCapacity &capacity;
  /// The nodes before each one, as recorded and by the edges so far.
  std::vector<NodeSet> reached, behind;
  /// Accesses by the number of their island, in the order of nodes, and the
  /// accesses of each node in that list.
  std::vector<std::vector<Hull>> islands;
  std::vector<std::vector<std::pair<int, Hull>>> own;
  std::vector<std::vector<Edge>> edges;
  /// Nodes without a successor, and those that may touch anything.
  std::vector<int> tails, barriers;
  /// The last node that fills the device; -1 without.
  int lastFull = -1;
  std::vector<int> candidates;
};

} // namespace

Order::Order(const std::vector<NodeRecord> &records,
             const std::vector<std::vector<int>> &recorded,
             const GraphCapacity &capacity)
    : records(records), capacity(capacity), own(records.size()),
      edges(records.size()) {
  size_t count = records.size();
  for (size_t node = 0; node < count; ++node) {
    NodeSet set(count);
    for (int from : recorded[node]) {
      set.add(reached[from]);
      set.add(from);
    }
    reached.push_back(std::move(set));
  }
}

static Hull hullOf(int node, const NodeAccess &access) {
  Hull hull{std::numeric_limits<uint64_t>::max(), 0, node, &access};
  for (const MemoryBlock &block : access.region.blocks) {
    hull.begin = std::min(hull.begin, block.start);
    hull.end = std::max(hull.end, block.end());
  }
  return hull;
}

void Order::findIslands() {
  std::vector<Hull> hulls;
  for (size_t node = 0; node < records.size(); ++node)
    for (const NodeAccess &access : records[node].accesses)
      hulls.push_back(hullOf(int(node), access));
  std::sort(hulls.begin(), hulls.end(),
            [](const Hull &a, const Hull &b) { return a.begin < b.begin; });
  uint64_t end = 0;
  for (const Hull &hull : hulls) {
    if (islands.empty() || hull.begin >= end)
      islands.emplace_back();
    end = std::max(end, hull.end);
    islands.back().push_back(hull);
    own[hull.node].push_back({int(islands.size()) - 1, hull});
  }
  for (std::vector<Hull> &island : islands)
    std::sort(island.begin(), island.end(),
              [](const Hull &a, const Hull &b) { return a.node < b.node; });
}

/// The nodes before one that it may have to come behind.
void Order::collect(int node) {
  candidates.clear();
  if (!records[node].barrier.empty()) {
    for (int from = 0; from < node; ++from)
      candidates.push_back(from);
  } else {
    for (const auto &[island, hull] : own[node])
      for (const Hull &other : islands[island]) {
        if (other.node >= node)
          break;
        if ((hull.access->writes || other.access->writes) &&
            hull.begin < other.end && other.begin < hull.end)
          candidates.push_back(other.node);
      }
    candidates.insert(candidates.end(), barriers.begin(), barriers.end());
    if (fills(records[node]) && lastFull >= 0)
      candidates.push_back(lastFull);
  }
  std::sort(candidates.begin(), candidates.end(), std::greater<>());
  candidates.erase(std::unique(candidates.begin(), candidates.end()),
                   candidates.end());
}

static std::string reasonOf(const NodeAccess &before, const NodeAccess &after) {
  const std::string &name = after.name.empty() ? before.name : after.name;
  std::string text = name.empty() ? "" : "'" + name + "' ";
  if (!after.writes)
    return text + "is read";
  return text + (before.writes ? "is written again" : "is overwritten");
}

/// Why a node comes behind another one.
std::optional<std::string> Order::conflict(int node, int from) const {
  const NodeRecord &after = records[node], &before = records[from];
  if (!after.barrier.empty())
    return after.barrier;
  if (!before.barrier.empty())
    return before.barrier;
  for (const NodeAccess &a : after.accesses)
    for (const NodeAccess &b : before.accesses)
      if ((a.writes || b.writes) && a.region.overlaps(b.region))
        return reasonOf(b, a);
  if (fills(after) && fills(before))
    return "both fill the device";
  return std::nullopt;
}

void Order::connect(int node, int from, std::string reason) {
  behind[node].add(behind[from]);
  behind[node].add(from);
  edges[node].push_back({from, std::move(reason)});
  tails.erase(std::remove(tails.begin(), tails.end(), from), tails.end());
}

void Order::limitBranches(int node) {
  if (tails.size() < capacity.branches)
    return;
  // The oldest one is the likeliest to be done.
  for (int tail : tails)
    if (reached[node].has(tail) && !behind[node].has(tail))
      return connect(node, tail, "there are enough branches");
}

std::vector<std::vector<Edge>> Order::run() {
  findIslands();
  for (size_t i = 0; i < records.size(); ++i) {
    int node = int(i);
    behind.emplace_back(records.size());
    collect(node);
    for (int from : candidates) {
      if (behind[node].has(from) || !reached[node].has(from))
        continue;
      if (std::optional<std::string> reason = conflict(node, from))
        connect(node, from, std::move(*reason));
    }
    limitBranches(node);
    tails.push_back(node);
    if (!records[node].barrier.empty())
      barriers.push_back(node);
    if (fills(records[node]))
      lastFull = node;
  }
  return std::move(edges);
}

std::vector<std::vector<Edge>>
warp::orderNodes(const std::vector<NodeRecord> &records,
                 const std::vector<std::vector<int>> &recorded,
                 const GraphCapacity &capacity) {
  return Order(records, recorded, capacity).run();
}

//===----------------------------------------------------------------------===//
// Branches
//===----------------------------------------------------------------------===//

std::shared_ptr<GraphSchedule>
warp::makeSchedule(const std::vector<NodeRecord> &records,
                   const std::vector<std::vector<int>> &recorded,
                   const GraphCapacity &capacity) {
  auto schedule = std::make_shared<GraphSchedule>();
  std::vector<std::vector<Edge>> edges =
      orderNodes(records, recorded, capacity);
  std::vector<bool> continued(records.size());
  for (size_t i = 0; i < records.size(); ++i) {
    GraphSchedule::Node &node = schedule->nodes.emplace_back();
    node.name = records[i].name;
    node.barrier = records[i].barrier;
    node.threads = records[i].threads;
    node.bytes = records[i].bytes;
    node.parts = records[i].parts;
    node.apart = records[i].apart;
    node.before = std::move(edges[i]);
    schedule->recordedEdges += recorded[i].size();
    schedule->edges += node.before.size();
    // The branch of a node that no other one has gone on with.
    node.branch = -1;
    for (const Edge &edge : node.before)
      if (node.branch < 0 && !continued[edge.from]) {
        continued[edge.from] = true;
        node.branch = schedule->nodes[edge.from].branch;
      }
    if (node.branch < 0)
      node.branch = schedule->branches++;
  }
  return schedule;
}
