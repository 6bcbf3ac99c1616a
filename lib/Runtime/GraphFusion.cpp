//===- GraphFusion.cpp - Launches of a graph that are one -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Launches are taken in the order of their recording. Each joins the group of a
// launch that it comes behind if the two may be one (GraphFusionRules.cpp).
// Short launches that wait for the same nodes and not for each other are joined
// likewise. The groups come in an order that keeps the edges.
//
//===----------------------------------------------------------------------===//

#include "GraphFuser.h"

#include "warp/Fusion.h"

#include <algorithm>
#include <deque>
#include <queue>
#include <tuple>

using namespace warp;

/// Short launches before one that it is compared with, if no edge joins them.
static constexpr int mostLooks = 8;

GraphFuser::GraphFuser(std::vector<NodeRecord> &records,
                       const GraphSchedule &schedule)
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

/// Puts a launch into a group before it if one fits.
void GraphFuser::join(int node) {
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

/// Makes the record of launches or fills that are one.
void GraphFuser::merge(const std::vector<int> &nodes,
                       NodeRecord &record) const {
  bool areFills = records[nodes.front()].fill;
  if (areFills)
    record.name = std::to_string(nodes.size()) + " fills";
  for (int node : nodes) {
    const NodeRecord &part = records[node];
    if (!areFills) {
      record.name += (record.name.empty() ? "" : " + ") + part.name;
      record.parts.push_back(part.name);
    }
    record.accesses.insert(record.accesses.end(), part.accesses.begin(),
                           part.accesses.end());
    record.threads = std::max(record.threads, part.threads);
    record.bytes += part.bytes;
  }
}

/// How the launches of a group are made one.
FusionPlan GraphFuser::planOf(int group) const {
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
FusedLaunch GraphFuser::fuseGroup(int group) {
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
std::vector<int> GraphFuser::orderOfGroups() const {
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
  // Fills begin with the first of them.
  auto placeOf = [&](int group) {
    const std::vector<int> &nodes = groups[group].nodes;
    int place = records[nodes.front()].fill ? nodes.front() : nodes.back();
    return std::tuple(group != firstFills, -path[group], place);
  };
  auto later = [&](int a, int b) { return placeOf(a) > placeOf(b); };
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

FusedNodes GraphFuser::run(bool joinsFills) {
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
  if (joinsFills && fusesLaunches())
    joinFills();
  FusedNodes result;
  for (int group : orderOfGroups()) {
    NodeRecord record;
    if (auto fused = made.find(group); fused != made.end()) {
      merge(groups[group].nodes, record);
      result.launches[result.records.size()] = std::move(fused->second);
    } else if (groups[group].nodes.size() > 1) {
      merge(groups[group].nodes, record);
      result.fills[result.records.size()] = regionsOf(group);
    } else {
      record = records[groups[group].nodes.front()];
    }
    result.records.push_back(std::move(record));
    result.members.push_back(groups[group].nodes);
  }
  if (firstFills >= 0)
    putFillsFirst(result);
  return result;
}

FusedNodes warp::fuseLaunches(std::vector<NodeRecord> &records,
                              const GraphSchedule &schedule, bool joinsFills) {
  return GraphFuser(records, schedule).run(joinsFills);
}

std::vector<std::vector<int>> warp::chainOf(size_t count) {
  std::vector<std::vector<int>> chain(count);
  for (size_t i = 1; i < count; ++i)
    chain[i] = {int(i) - 1};
  return chain;
}
