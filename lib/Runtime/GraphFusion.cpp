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
// On a GPU, launches that have the first extent in common alone, and share
// elements within its indices, rows, become one whose blocks run a row each.
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
#include <deque>
#include <queue>
#include <tuple>

using namespace warp;

/// Launches of one kernel.
static constexpr size_t mostParts = 8;
/// Operations of a thread of launches that are joined without an edge between
/// them: less than what a launch costs.
static constexpr double shortThread = 256;
/// The same of launches that may begin later than they could, to be one with
/// another: next to nothing.
static constexpr double briefThread = 64;
/// Threads that fill a GPU's multiprocessor by half.
static constexpr int halfOfMultiprocessor = 1024;
/// Launches before one that it is compared with, for such.
static constexpr int mostLooks = 8;
/// Threads of a row that is one block, and the least number of rows: fewer do
/// not fill the multiprocessors by a warp each.
static constexpr int64_t mostRowThreads = 128;
static constexpr int64_t fewestRows = 64;

static thread_local bool isFusing = true, hasRowsOnGpu = false,
                         hasRowsOnHost = false;

bool warp::fusesLaunches() { return isFusing; }
void warp::setFusesLaunches(bool fuses) { isFusing = fuses; }
void warp::setFusesRows(bool fuses) { hasRowsOnGpu = fuses; }
void warp::setFusesRowsOnHost(bool fuses) { hasRowsOnHost = fuses; }

/// True if the kernels of two launches have the same options, for a device.
static bool haveLikeOptions(const GraphOperation &a, const GraphOperation &b) {
  KernelOptions options = a.kernel->options();
  options.blockDim = b.kernel->options().blockDim;
  return a.plan.variant && b.plan.variant && a.plan.device == b.plan.device &&
         options == b.kernel->options();
}

namespace {

class Fusing {
public:
  Fusing(std::vector<NodeRecord> &records, const GraphSchedule &schedule);
  FusedNodes run();

private:
  struct Launch {
    std::string why;
    /// Threads cannot run it one after the other with others.
    bool isTogether = false;
    std::vector<ThreadAccess> accesses;
  };

  /// Launches that are one.
  struct Group {
    std::vector<int> nodes;
    /// Blocks run rows.
    bool hasRows = false;
  };

  void join(int node);
  std::string whyNot(int group, int node, bool &hasRows) const;
  std::string whyNoRows(int group, int node) const;
  std::string whyOrdered(int group, int node, bool hasEdge) const;
  bool isShort(int node) const;
  bool leavesRoom(int node) const;
  bool isOnLongest(int node) const {
    return depth[node] + height[node] == longest;
  }
  bool isLike(int node, int other) const;
  bool mayBeRow(int node) const;
  bool mayBeOne(int node, int other) const {
    return isLike(node, other) ||
           (mayBeRow(node) && mayBeRow(other) &&
            haveLikeOptions(*records[node].launch, *records[other].launch));
  }
  std::vector<int> before(int group) const;
  int readyOf(int group, int except = -1) const;
  bool reaches(int from, int to) const;
  FusionPlan planOf(int group) const;
  std::vector<int> orderOfGroups() const;
  FusedLaunch fuseGroup(int group);
  void merge(const std::vector<int> &nodes, NodeRecord &record) const;

  std::vector<NodeRecord> &records;
  std::vector<std::vector<int>> edges, followers;
  /// The lengths of the longest paths to each node, from there on, and of all.
  std::vector<int> depth, height;
  int longest = 0;
  std::vector<Launch> launches;
  std::vector<int> groupOf;
  std::vector<Group> groups;
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
    groups.push_back({{int(i)}});
    if (const GraphOperation *launch = records[i].launch) {
      launches[i].why =
          records[i].barrier.empty() ? whyApart(*launch) : records[i].barrier;
      launches[i].isTogether = worksTogether(*launch);
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
  return a && b && haveLikeOptions(*a, *b) &&
         a->kernel->options().blockDim == b->kernel->options().blockDim &&
         a->plan.openBlock == b->plan.openBlock &&
         a->plan.variant->key.blockDim == b->plan.variant->key.blockDim &&
         a->dim.rank == b->dim.rank &&
         std::equal(a->dim.extent, a->dim.extent + a->dim.rank, b->dim.extent);
}

/// Threads of one index of the first extent.
static int64_t rowThreads(const LaunchDim &dim) {
  int64_t count = 1;
  for (int i = 1; i < dim.rank; ++i)
    count *= dim.extent[i];
  return count;
}

/// True if a launch may run in blocks of a row each.
bool Fusing::mayBeRow(int node) const {
  const GraphOperation *launch = records[node].launch;
  return launch && launch->dim.rank > 0 &&
         (isHost(launch->plan.device) ? hasRowsOnHost : hasRowsOnGpu) &&
         launch->dim.extent[0] >= fewestRows &&
         rowThreads(launch->dim) <= mostRowThreads;
}

/// The groups that a group comes behind.
std::vector<int> Fusing::before(int group) const {
  std::vector<int> found;
  for (int node : groups[group].nodes)
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

/// The depth at which all that a group waits for is done, but for another one.
int Fusing::readyOf(int group, int except) const {
  int ready = 0;
  for (int other : before(group))
    if (other != except)
      for (int node : groups[other].nodes)
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
      return "'" + records[groups[other].nodes.front()].name +
             "' comes between";
  if (!hasEdge)
    return readyOf(own) == readyOf(group) ? "" : "they wait for other nodes";
  // The group would begin when the node can.
  if (readyOf(own, group) <= readyOf(group))
    return "";
  // Rows that run beside what comes between are better than a later group.
  double cost = 0;
  for (int member : groups[group].nodes)
    cost += records[member].launch->plan.variant->code.schedule.cost;
  if (!isLike(node, groups[group].nodes.front()) && cost > briefThread)
    return "the others would have to wait";
  for (int member : groups[group].nodes)
    for (int follower : followers[member])
      if (follower != node && groupOf[follower] != group)
        return "'" + records[follower].name + "' would have to wait";
  return "";
}

/// Why a group with a launch can be no launch of rows; empty if it can.
std::string Fusing::whyNoRows(int group, int node) const {
  const LaunchDim &dim = records[node].launch->dim;
  for (int member : groups[group].nodes) {
    const LaunchDim &other = records[member].launch->dim;
    if (!mayBeRow(member) || !mayBeRow(node) ||
        dim.extent[0] != other.extent[0])
      return "they have other extents";
    // Blocks that work together have as many threads as the whole.
    bool areBlocks = hasBlocksOfRows(*records[node].launch),
         otherAreBlocks = hasBlocksOfRows(*records[member].launch);
    if ((areBlocks && rowThreads(dim) < rowThreads(other)) ||
        (otherAreBlocks && rowThreads(other) < rowThreads(dim)))
      return "its blocks have other threads";
    if (auto name = findRowCrossing(launches[member].accesses, other,
                                    launches[node].accesses, dim))
      return "rows share elements of '" + *name + "'";
  }
  return "";
}

/// Why a launch cannot be part of a group; empty if it can, of one with rows
/// if `hasRows` is set.
std::string Fusing::whyNot(int group, int node, bool &hasRows) const {
  const std::vector<int> &members = groups[group].nodes;
  hasRows = groups[group].hasRows;
  if (!launches[node].why.empty())
    return launches[node].why;
  if (members.size() >= mostParts)
    return "enough launches are one";
  auto prints = [&](int one) {
    return Kernel::prints(records[one].launch->plan);
  };
  for (int member : members) {
    // The output of one launch stays before that of the next one.
    if (prints(node) && prints(member))
      return "both of them print";
    if (leavesRoom(node) && isOnLongest(node) != isOnLongest(member))
      return "only one of them is on the longest path";
    if (!launches[member].why.empty())
      return "of '" + records[member].name + "': " + launches[member].why;
  }
  std::string why;
  for (int member : members) {
    if (hasRows)
      break;
    const LaunchDim &dim = records[node].launch->dim;
    if (launches[node].isTogether || launches[member].isTogether)
      why = "threads of its blocks work together";
    else if (!isLike(node, member))
      why = "they have other extents";
    else if (auto name = findCrossing(launches[member].accesses,
                                      launches[node].accesses, dim))
      why = "threads share elements of '" + *name + "'";
    hasRows = !why.empty();
  }
  if (!hasRows)
    return "";
  // It would delay what is as far from the end.
  for (int member : members)
    for (int follower : followers[member])
      if (follower != node && groupOf[follower] != group &&
          height[follower] >= height[node])
        return "'" + records[follower].name + "' would have to wait";
  std::string whyRows = whyNoRows(group, node);
  // The reason of threads, where rows are out of the question.
  bool areRows = mayBeRow(node) && mayBeRow(members.front());
  return whyRows.empty() || areRows ? whyRows : why;
}

/// Puts a launch into a group before it if one fits.
void Fusing::join(int node) {
  std::vector<int> tried;
  auto attempt = [&](int other, bool hasEdge) {
    int group = groupOf[other];
    if (!mayBeOne(node, other) ||
        std::find(tried.begin(), tried.end(), group) != tried.end())
      return false;
    tried.push_back(group);
    bool hasRows = false;
    std::string why = whyNot(group, node, hasRows);
    if (why.empty())
      why = whyOrdered(group, node, hasEdge);
    if (!why.empty()) {
      if (hasEdge && records[node].apart.empty())
        records[node].apart = why;
      return false;
    }
    groups[group].nodes.push_back(node);
    groups[group].hasRows = hasRows;
    groups[groupOf[node]].nodes.clear();
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
    if (!mayBeOne(node, other) || !isShort(other) ||
        !launches[other].why.empty())
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
    record.threads = std::max(record.threads, part.threads);
    record.bytes += part.bytes;
    record.parts.push_back(part.name);
  }
}

/// How the launches of a group are made one.
FusionPlan Fusing::planOf(int group) const {
  const std::vector<int> &nodes = groups[group].nodes;
  FusionPlan plan;
  int64_t threads = 1;
  for (int node : nodes) {
    plan.launches.push_back(records[node].launch);
    threads = std::max(threads, rowThreads(records[node].launch->dim));
  }
  if (!groups[group].hasRows)
    return plan;
  constexpr int64_t warp = 32;
  plan.blockThreads = int((threads + warp - 1) / warp * warp);
  // The first launch since threads have waited.
  size_t first = 0;
  for (size_t i = 0; i < nodes.size(); ++i) {
    bool waits = false;
    for (size_t j = first; j < i && !waits; ++j) {
      const std::vector<ThreadAccess> &a = launches[nodes[j]].accesses,
                                      &b = launches[nodes[i]].accesses;
      waits =
          isLike(nodes[j], nodes[i])
              ? findCrossing(a, b, records[nodes[i]].launch->dim).has_value()
              : mayMeet(a, b);
    }
    plan.waits.push_back(waits);
    if (waits)
      first = i;
  }
  return plan;
}

/// Makes a group's launch of as many of its first launches as have good code
/// together; the others are launches of their own.
FusedLaunch Fusing::fuseGroup(int group) {
  std::vector<int> &nodes = groups[group].nodes;
  while (nodes.size() > 1) {
    std::string why;
    FusedLaunch fused = fuse(planOf(group), why);
    if (fused.kernel)
      return fused;
    int last = nodes.back();
    nodes.pop_back();
    groupOf[last] = last;
    groups[last].nodes = {last};
    records[last].apart = why;
  }
  return {};
}

/// An order of groups that keeps the edges, near that of the recording. With
/// rows, by the longest path from each group to the end: nodes that fill the
/// device, which keep that order, come by their urgency, and what is needed
/// late begins late, so that branches are few.
std::vector<int> Fusing::orderOfGroups() const {
  std::vector<size_t> waits(groups.size());
  std::vector<std::vector<int>> next(groups.size());
  std::vector<int> first, order;
  bool hasRows = false;
  for (size_t group = 0; group < groups.size(); ++group) {
    if (groups[group].nodes.empty())
      continue;
    hasRows |= groups[group].hasRows;
    std::vector<int> list = before(int(group));
    waits[group] = list.size();
    for (int other : list)
      next[other].push_back(int(group));
    if (list.empty())
      first.push_back(int(group));
  }
  auto visit = [&](auto &&ready, auto &&take, std::vector<size_t> counts) {
    while (!ready.empty()) {
      int group = take();
      order.push_back(group);
      for (int other : next[group])
        if (--counts[other] == 0)
          ready.push(other);
    }
  };
  std::vector<int> path(groups.size());
  if (hasRows) {
    std::queue<int> ready(std::deque<int>(first.begin(), first.end()));
    auto take = [&] {
      int group = ready.front();
      ready.pop();
      return group;
    };
    visit(ready, take, waits);
    for (size_t i = order.size(); i-- > 0;)
      for (int other : next[order[i]])
        path[order[i]] = std::max(path[order[i]], path[other] + 1);
    order.clear();
  }
  auto later = [&](int a, int b) {
    return std::tuple(-path[a], groups[a].nodes.back()) >
           std::tuple(-path[b], groups[b].nodes.back());
  };
  std::priority_queue<int, std::vector<int>, decltype(later)> ready(
      later, std::vector<int>(first));
  auto take = [&] {
    int group = ready.top();
    ready.pop();
    return group;
  };
  visit(ready, take, waits);
  return order;
}

FusedNodes Fusing::run() {
  for (size_t i = 0; i < records.size() && fusesLaunches(); ++i)
    if (records[i].launch)
      join(int(i));
  std::vector<FusionPlan> plans;
  for (size_t group = 0; group < groups.size(); ++group)
    if (groups[group].nodes.size() > 1)
      plans.push_back(planOf(int(group)));
  prepareCode(plans);
  std::map<int, FusedLaunch> made;
  for (size_t group = 0; group < groups.size(); ++group)
    if (FusedLaunch fused = fuseGroup(int(group)); fused.kernel)
      made[int(group)] = std::move(fused);
  FusedNodes result;
  for (int group : orderOfGroups()) {
    NodeRecord record;
    if (auto fused = made.find(group); fused != made.end()) {
      merge(groups[group].nodes, record);
      result.launches[result.records.size()] = std::move(fused->second);
    } else {
      record = records[groups[group].nodes.front()];
    }
    result.records.push_back(std::move(record));
    result.members.push_back(groups[group].nodes);
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
