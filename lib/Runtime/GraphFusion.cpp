//===- GraphFusion.cpp - Launches of a graph that are one -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Launches are taken in the order of their recording. Each joins the group of a
// launch that it comes behind if both have the same extents, if no two threads
// share an element that one of them writes (ThreadElements.cpp), if no other
// node has to run in between, and if nothing else of the group's followers
// would have to wait for more. Short launches that wait for the same nodes and
// not for each other are joined likewise.
//
// On a GPU, launches that leave room for others run beside them at little cost,
// so that none becomes part of one that the longest path of the graph has.
//
//===----------------------------------------------------------------------===//

#include "GraphFusion.h"

#include "FusedKernel.h"
#include "KernelImpl.h"
#include "ThreadElements.h"
#include "warp/Fusion.h"

#include <algorithm>
#include <queue>

using namespace warp;

/// Launches of one kernel.
static constexpr size_t mostParts = 8;
/// Operations of a thread of launches that are joined without an edge between
/// them: less than what a launch costs.
static constexpr double shortThread = 256;
/// Threads that fill a GPU's multiprocessor by half.
static constexpr int halfOfMultiprocessor = 1024;
/// Launches before one that it is compared with, for such.
static constexpr int mostLooks = 8;

static thread_local bool isFusing = true;

bool warp::fusesLaunches() { return isFusing; }
void warp::setFusesLaunches(bool fuses) { isFusing = fuses; }

namespace {

class Fusing {
public:
  Fusing(std::vector<NodeRecord> &records, const GraphSchedule &schedule);
  FusedNodes run();

private:
  struct Launch {
    std::string why;
    std::vector<ThreadAccess> accesses;
  };

  void join(int node);
  std::string whyNot(int group, int node) const;
  std::string whyOrdered(int group, int node, bool hasEdge) const;
  bool isShort(int node) const;
  bool leavesRoom(int node) const;
  bool isOnLongest(int node) const {
    return depth[node] + height[node] == longest;
  }
  bool isLike(int node, int other) const;
  std::vector<int> before(int group) const;
  int readyOf(int group) const;
  bool reaches(int from, int to) const;
  std::vector<const GraphOperation *> launchesOf(int group) const;
  FusedLaunch fuseGroup(int group);
  void merge(const std::vector<int> &nodes, NodeRecord &record) const;

  std::vector<NodeRecord> &records;
  std::vector<std::vector<int>> edges, followers;
  /// The lengths of the longest paths to each node, from there on, and of all.
  std::vector<int> depth, height;
  int longest = 0;
  std::vector<Launch> launches;
  std::vector<int> groupOf;
  std::vector<std::vector<int>> groups;
};

} // namespace

Fusing::Fusing(std::vector<NodeRecord> &records, const GraphSchedule &schedule)
    : records(records), edges(records.size()), followers(records.size()),
      depth(records.size()), height(records.size()), launches(records.size()) {
  for (size_t i = 0; i < records.size(); ++i) {
    for (const GraphSchedule::Edge &edge : schedule.nodes[i].before) {
      edges[i].push_back(edge.from);
      followers[edge.from].push_back(int(i));
      depth[i] = std::max(depth[i], depth[edge.from] + 1);
    }
    groupOf.push_back(int(i));
    groups.push_back({int(i)});
    if (const GraphOperation *launch = records[i].launch) {
      launches[i].why =
          records[i].barrier.empty() ? whyApart(*launch) : records[i].barrier;
      if (launches[i].why.empty())
        launches[i].accesses = threadAccesses(*launch->kernel, launch->dim,
                                              launch->arguments.data());
    }
  }
  for (size_t i = records.size(); i-- > 0;) {
    for (int follower : followers[i])
      height[i] = std::max(height[i], height[follower] + 1);
    longest = std::max(longest, depth[i] + height[i]);
  }
}

/// True if others run beside a launch.
bool Fusing::leavesRoom(int node) const {
  int device = records[node].launch->plan.device;
  return !isHost(device) &&
         records[node].threads <
             int64_t(halfOfMultiprocessor) * deviceInfo(device).smCount;
}

/// True if two launches have the same extents and are made in the same way.
bool Fusing::isLike(int node, int other) const {
  const GraphOperation *a = records[node].launch, *b = records[other].launch;
  return a && b && a->plan.variant && b->plan.variant &&
         a->plan.device == b->plan.device && a->dim.rank == b->dim.rank &&
         std::equal(a->dim.extent, a->dim.extent + a->dim.rank,
                    b->dim.extent) &&
         a->plan.openBlock == b->plan.openBlock &&
         a->plan.variant->key.blockDim == b->plan.variant->key.blockDim &&
         a->kernel->options() == b->kernel->options();
}

/// The groups that a group comes behind.
std::vector<int> Fusing::before(int group) const {
  std::vector<int> found;
  for (int node : groups[group])
    for (int from : edges[node])
      if (groupOf[from] != group)
        found.push_back(groupOf[from]);
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

/// True if `to` comes behind `from`.
bool Fusing::reaches(int from, int to) const {
  std::vector<int> left{to};
  std::vector<bool> seen(groups.size());
  while (!left.empty()) {
    int group = left.back();
    left.pop_back();
    if (group == from)
      return true;
    for (int next : before(group))
      if (!seen[next]) {
        seen[next] = true;
        left.push_back(next);
      }
  }
  return false;
}

/// The depth at which all that a group waits for is done.
int Fusing::readyOf(int group) const {
  int ready = 0;
  for (int other : before(group))
    for (int node : groups[other])
      ready = std::max(ready, depth[node] + 1);
  return ready;
}

bool Fusing::isShort(int node) const {
  const Kernel::Plan &plan = records[node].launch->plan;
  return plan.variant->code.schedule.cost <= shortThread && isCheap(plan);
}

/// Why the order does not let a node join a group; empty if it does.
std::string Fusing::whyOrdered(int group, int node, bool hasEdge) const {
  int own = groupOf[node];
  for (int other : before(own))
    if (other != group && reaches(group, other))
      return "'" + records[groups[other].front()].name + "' comes between";
  if (!hasEdge)
    return readyOf(own) == readyOf(group) ? "" : "they wait for other nodes";
  // The group would begin when the node can.
  int ready = 0;
  for (int other : before(own))
    if (other != group)
      for (int one : groups[other])
        ready = std::max(ready, depth[one] + 1);
  if (ready <= readyOf(group))
    return "";
  for (int member : groups[group])
    for (int follower : followers[member])
      if (follower != node && groupOf[follower] != group)
        return "'" + records[follower].name + "' would have to wait";
  return "";
}

std::string Fusing::whyNot(int group, int node) const {
  if (!launches[node].why.empty())
    return launches[node].why;
  if (groups[group].size() >= mostParts)
    return "enough launches are one";
  const LaunchDim &dim = records[node].launch->dim;
  for (int member : groups[group]) {
    if (leavesRoom(node) && isOnLongest(node) != isOnLongest(member))
      return "only one of them is on the longest path";
    if (!launches[member].why.empty())
      return "of '" + records[member].name + "': " + launches[member].why;
    if (auto name = findCrossing(launches[member].accesses,
                                 launches[node].accesses, dim))
      return "threads share elements of '" + *name + "'";
  }
  return "";
}

/// Puts a launch into a group before it if one fits.
void Fusing::join(int node) {
  std::vector<int> tried;
  auto attempt = [&](int other, bool hasEdge) {
    int group = groupOf[other];
    if (!isLike(node, other) ||
        std::find(tried.begin(), tried.end(), group) != tried.end())
      return false;
    tried.push_back(group);
    std::string why = whyNot(group, node);
    if (why.empty())
      why = whyOrdered(group, node, hasEdge);
    if (!why.empty()) {
      if (hasEdge && records[node].apart.empty())
        records[node].apart = why;
      return false;
    }
    groups[group].push_back(node);
    groups[groupOf[node]].clear();
    groupOf[node] = group;
    records[node].apart.clear();
    return true;
  };
  // The nearest first.
  std::vector<int> nearest = edges[node];
  std::sort(nearest.begin(), nearest.end(), std::greater<>());
  for (int other : nearest)
    if (attempt(other, true))
      return;
  if (!launches[node].why.empty() || !isShort(node))
    return;
  for (int other = node - 1, looks = 0; other >= 0 && looks < mostLooks;
       --other) {
    if (!isLike(node, other) || !isShort(other) || !launches[other].why.empty())
      continue;
    ++looks;
    int group = groupOf[other];
    if (!reaches(group, groupOf[node]) && attempt(other, false))
      return;
  }
}

/// Makes the record of launches that are one.
void Fusing::merge(const std::vector<int> &nodes, NodeRecord &record) const {
  for (int node : nodes) {
    const NodeRecord &part = records[node];
    record.name += (record.name.empty() ? "" : " + ") + part.name;
    record.accesses.insert(record.accesses.end(), part.accesses.begin(),
                           part.accesses.end());
    record.threads = part.threads;
    record.bytes += part.bytes;
    record.parts.push_back(part.name);
  }
}

std::vector<const GraphOperation *> Fusing::launchesOf(int group) const {
  std::vector<const GraphOperation *> launches;
  for (int node : groups[group])
    launches.push_back(records[node].launch);
  return launches;
}

/// Makes a group's launch of as many of its first launches as have good code
/// together; the others are launches of their own.
FusedLaunch Fusing::fuseGroup(int group) {
  while (groups[group].size() > 1) {
    std::string why;
    FusedLaunch fused = fuse(launchesOf(group), why);
    if (fused.kernel)
      return fused;
    int last = groups[group].back();
    groups[group].pop_back();
    groupOf[last] = last;
    groups[last] = {last};
    records[last].apart = why;
  }
  return {};
}

FusedNodes Fusing::run() {
  for (size_t i = 0; i < records.size() && fusesLaunches(); ++i)
    if (records[i].launch)
      join(int(i));
  std::vector<std::vector<const GraphOperation *>> parts;
  for (size_t group = 0; group < groups.size(); ++group)
    if (groups[group].size() > 1)
      parts.push_back(launchesOf(int(group)));
  prepareCode(parts);
  std::map<int, FusedLaunch> made;
  for (size_t group = 0; group < groups.size(); ++group)
    if (FusedLaunch fused = fuseGroup(int(group)); fused.kernel)
      made[int(group)] = std::move(fused);
  // An order that keeps the edges, near that of the recording.
  std::vector<size_t> waits(groups.size());
  std::vector<std::vector<int>> next(groups.size());
  auto later = [&](int a, int b) {
    return groups[a].back() > groups[b].back();
  };
  std::priority_queue<int, std::vector<int>, decltype(later)> ready(later);
  for (size_t group = 0; group < groups.size(); ++group) {
    if (groups[group].empty())
      continue;
    std::vector<int> list = before(int(group));
    waits[group] = list.size();
    for (int other : list)
      next[other].push_back(int(group));
    if (list.empty())
      ready.push(int(group));
  }
  FusedNodes result;
  while (!ready.empty()) {
    int group = ready.top();
    ready.pop();
    for (int other : next[group])
      if (--waits[other] == 0)
        ready.push(other);
    NodeRecord record;
    if (auto fused = made.find(group); fused != made.end()) {
      merge(groups[group], record);
      result.launches[result.records.size()] = std::move(fused->second);
    } else {
      record = records[groups[group].front()];
    }
    result.records.push_back(std::move(record));
    result.members.push_back(groups[group]);
  }
  return result;
}

FusedNodes warp::fuseLaunches(std::vector<NodeRecord> &records,
                              const GraphSchedule &schedule) {
  return Fusing(records, schedule).run();
}

std::vector<std::vector<int>> warp::chainOf(size_t count) {
  std::vector<std::vector<int>> chain(count);
  for (size_t i = 1; i < count; ++i)
    chain[i] = {int(i) - 1};
  return chain;
}
