//===- GraphForks.cpp - Branches that begin behind one node ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The height of a node is the length of the longest path from there to the end;
// its slack behind another node is what its height falls short of that of the
// highest follower. The k-th of a chain of followers begins k short nodes late,
// so that its slack is k or more.
//
//===----------------------------------------------------------------------===//

#include "GraphOrder.h"

#include <algorithm>

using namespace warp;
using Edge = GraphSchedule::Edge;

/// Operations of a thread, and bytes of a copy or fill, that take less time
/// than two launches.
static constexpr double shortCost = 512;
static constexpr int64_t shortBytes = int64_t(1) << 20;

/// True if others may wait for a node.
static bool isShort(const NodeRecord &record, const GraphCapacity &capacity) {
  return record.threads < capacity.threads && record.cost <= shortCost &&
         (record.threads || record.bytes <= shortBytes);
}

void warp::limitForks(const std::vector<NodeRecord> &records,
                      const GraphCapacity &capacity,
                      std::vector<std::vector<Edge>> &edges) {
  size_t count = records.size();
  std::vector<std::vector<int>> followers(count);
  for (size_t node = 0; node < count; ++node)
    for (const Edge &edge : edges[node])
      followers[edge.from].push_back(int(node));
  if (std::none_of(followers.begin(), followers.end(), [&](const auto &list) {
        return list.size() > capacity.forks;
      }))
    return;
  std::vector<int> height(count);
  for (size_t node = count; node-- > 0;)
    for (int follower : followers[node])
      height[node] = std::max(height[node], height[follower] + 1);
  for (size_t node = 0; node < count; ++node) {
    const std::vector<int> &list = followers[node];
    if (list.size() <= capacity.forks)
      continue;
    int last = -1, place = 0;
    for (int follower : list) {
      int slack = height[node] - 1 - height[follower];
      if (edges[follower].size() != 1 || slack <= place ||
          !records[follower].isOwn || !records[follower].barrier.empty())
        continue;
      if (last >= 0)
        edges[follower] = {{last, "branches begin one by one"}};
      if (!isShort(records[follower], capacity))
        continue;
      last = follower;
      ++place;
    }
  }
}
