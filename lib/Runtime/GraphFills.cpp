//===- GraphFills.cpp - Fills of a graph that are one node ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A GPU needs as long to start a fill of a few bytes as to start a kernel, and
// each fill is one more node for a launch to wait for, which then cannot start
// while its other predecessor ends. Fills that wait for nothing, or for nodes
// that are done as early, are one node.
//
// The level of a node is the length of the longest path that leads to it. Fills
// of a level are one, and later ones join if no node behind them gets a larger
// level: so no path through the graph becomes longer, and no cycle comes about.
//
//===----------------------------------------------------------------------===//

#include "GraphFuser.h"

#include <algorithm>
#include <set>
#include <utility>

using namespace warp;

/// Bytes of fills that are one node, at most: what is needed first would wait
/// for the rest.
static constexpr int64_t mostBytes = int64_t(4) << 20;

/// Nodes that would wait for one predecessor less if fills came first: fewer
/// do not make up for the time in which nothing else runs.
static constexpr size_t fewestJoins = 2;

std::optional<FillRegion> warp::fillRegionOf(const GraphOperation &fill) {
  const std::string &unit = fill.constant;
  auto arguments = fill.read<graphs::FillBytes>();
  constexpr size_t width = sizeof(FillRegion::pattern);
  FillRegion region;
  region.begin = reinterpret_cast<uintptr_t>(arguments.dst);
  region.end = region.begin + unit.size() * arguments.count;
  // Byte i of the fill and byte i + 16 are equal if all of a unit and of those
  // behind it are.
  for (size_t i = 0; i < unit.size(); ++i)
    if (unit[i] != unit[(i + width) % unit.size()])
      return std::nullopt;
  for (size_t i = 0; i < width; ++i)
    region.pattern[(region.begin + i) % width] = unit[i % unit.size()];
  return region;
}

void GraphFuser::joinFills() {
  std::vector<int> level(groups.size()), fills, joined;
  std::vector<int64_t> bytes(groups.size());
  std::vector<std::vector<int>> next(groups.size());
  for (int group : orderOfGroups()) {
    for (int other : before(group)) {
      next[other].push_back(group);
      level[group] = std::max(level[group], level[other] + 1);
    }
    const NodeRecord &record = records[groups[group].nodes.front()];
    if (record.fill && record.barrier.empty() && record.bytes <= mostBytes &&
        fillRegionOf(*record.fill)) {
      fills.push_back(group);
      bytes[group] = record.bytes;
    }
  }
  std::sort(fills.begin(), fills.end(), [&](int a, int b) {
    return std::pair(level[a], a) < std::pair(level[b], b);
  });
  // True if what comes behind a fill may come behind a level.
  auto mayWait = [&](int group, int wanted) {
    return std::all_of(next[group].begin(), next[group].end(),
                       [&](int other) { return level[other] > wanted; });
  };
  for (int own : fills) {
    auto hasRoom = [&](int group) {
      return groups[group].nodes.size() < mostFills &&
             bytes[group] + bytes[own] <= mostBytes;
    };
    auto found = std::find_if(joined.begin(), joined.end(), [&](int group) {
      return level[group] == level[own] && hasRoom(group);
    });
    // Fills that wait for nothing begin at once.
    if (found == joined.end())
      found = std::find_if(joined.begin(), joined.end(), [&](int group) {
        return level[group] > 0 && mayWait(group, level[own]) && hasRoom(group);
      });
    if (found == joined.end()) {
      joined.push_back(own);
      continue;
    }
    level[*found] = level[own];
    bytes[*found] += bytes[own];
    next[*found].insert(next[*found].end(), next[own].begin(), next[own].end());
    int node = groups[own].nodes.front();
    groups[*found].nodes.push_back(node);
    groups[own].nodes.clear();
    groupOf[node] = *found;
  }
  for (int group : joined) {
    std::sort(groups[group].nodes.begin(), groups[group].nodes.end());
    if (firstFills < 0 && saveJoins(group))
      firstFills = group;
  }
}

std::vector<FillRegion> GraphFuser::regionsOf(int group) const {
  std::vector<FillRegion> regions;
  for (int node : groups[group].nodes)
    regions.push_back(*fillRegionOf(*records[node].fill));
  return regions;
}

/// True if all else may come behind a group of fills: those that wait for
/// nothing, where that leaves launches with one predecessor less.
bool GraphFuser::saveJoins(int group) const {
  if (groups[group].nodes.size() < 2 || !before(group).empty())
    return false;
  std::set<int> joins;
  for (int node : groups[group].nodes)
    for (int follower : followers[node])
      if (int other = groupOf[follower]; before(other).size() > 1)
        joins.insert(other);
  return joins.size() >= fewestJoins;
}

/// All else comes behind fills that are the first node.
void GraphFuser::putFillsFirst(FusedNodes &nodes) {
  MemoryBlock token;
  token.start = fillsAddress;
  token.item = 1;
  for (NodeRecord &record : nodes.records)
    record.accesses.push_back(
        {{{token}}, &record == &nodes.records[0], "the fills"});
}
