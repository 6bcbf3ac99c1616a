//===- GraphFusionRules.cpp - Launches of a graph that may be one ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch joins a group if both have the same extents, if no two threads share
// an element that one of them writes (ThreadElements.cpp), if no other node has
// to run in between, and if nothing else of the group's followers would have to
// wait for more.
//
// On a GPU, launches that have the first extent in common alone, and share
// elements within its indices, rows, become one whose blocks run a row each.
//
// On a GPU, launches that leave room for others run beside them at little cost,
// so that none becomes part of one that the longest path of the graph has.
//
//===----------------------------------------------------------------------===//

#include "GraphFuser.h"

#include "KernelImpl.h"
#include "warp/Fusion.h"

#include <algorithm>

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

/// True if others run beside a launch.
bool GraphFuser::leavesRoom(int node) const {
  int device = records[node].launch->plan.device;
  return !isHost(device) &&
         records[node].threads <
             int64_t(halfOfMultiprocessor) * deviceInfo(device).smCount;
}

/// True if two launches have the same extents and are made in the same way.
bool GraphFuser::isLike(int node, int other) const {
  const GraphOperation *a = records[node].launch, *b = records[other].launch;
  return a && b && haveLikeOptions(*a, *b) &&
         a->kernel->options().blockDim == b->kernel->options().blockDim &&
         a->plan.openBlock == b->plan.openBlock &&
         a->plan.variant->key.blockDim == b->plan.variant->key.blockDim &&
         a->dim.rank == b->dim.rank &&
         std::equal(a->dim.extent, a->dim.extent + a->dim.rank, b->dim.extent);
}

/// True if a launch may run in blocks of a row each.
bool GraphFuser::mayBeRow(int node) const {
  const GraphOperation *launch = records[node].launch;
  return launch && launch->dim.rank > 0 &&
         (isHost(launch->plan.device) ? hasRowsOnHost : hasRowsOnGpu) &&
         launch->dim.extent[0] >= fewestRows &&
         rowThreads(launch->dim) <= mostRowThreads;
}

bool GraphFuser::mayBeOne(int node, int other) const {
  return isLike(node, other) ||
         (mayBeRow(node) && mayBeRow(other) &&
          haveLikeOptions(*records[node].launch, *records[other].launch));
}

/// The groups that a group comes behind.
std::vector<int> GraphFuser::before(int group) const {
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
bool GraphFuser::reaches(int from, int to) const {
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
int GraphFuser::readyOf(int group, int except) const {
  int ready = 0;
  for (int other : before(group))
    if (other != except)
      for (int node : groups[other].nodes)
        ready = std::max(ready, depth[node] + 1);
  return ready;
}

bool GraphFuser::isShort(int node) const {
  const Kernel::Plan &plan = records[node].launch->plan;
  return plan.variant->code.schedule.cost <= shortThread && isCheap(plan);
}

/// Why the order does not let a node join a group; empty if it does.
std::string GraphFuser::whyOrdered(int group, int node, bool hasEdge) const {
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
std::string GraphFuser::whyNoRows(int group, int node) const {
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
std::string GraphFuser::whyNot(int group, int node, bool &hasRows) const {
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
  // A launch that waits for the group and is as far from the end would wait for
  // this one, too.
  for (int member : members)
    for (int follower : followers[member])
      if (follower != node && groupOf[follower] != group &&
          height[follower] >= height[node])
        return "'" + records[follower].name + "' would have to wait";
  std::string whyRows = whyNoRows(group, node);
  // If blocks cannot run rows, the schedule says what keeps threads apart.
  bool areRows = mayBeRow(node) && mayBeRow(members.front());
  return whyRows.empty() || areRows ? whyRows : why;
}
