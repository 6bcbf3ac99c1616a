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

#include "warp/Fusion.h"

#include <algorithm>
#include <utility>

using namespace warp;

/// Bytes of fills that are one node, at most: what is needed first would wait
/// for the rest.
static constexpr int64_t mostBytes = int64_t(4) << 20;

static thread_local FillChoice choice;

const FillChoice &warp::fillChoice() { return choice; }
void warp::setFusesFills(bool fuses, bool first, bool early, bool moves) {
  choice = {fuses, first, early, moves};
}

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
  for (int group : joined)
    std::sort(groups[group].nodes.begin(), groups[group].nodes.end());
}

std::vector<FillRegion> GraphFuser::regionsOf(int group) const {
  std::vector<FillRegion> regions;
  for (int node : groups[group].nodes)
    regions.push_back(*fillRegionOf(*records[node].fill));
  return regions;
}

/// All else comes behind fills that are the first node: one predecessor less of
/// each launch that reads what they write.
void GraphFuser::putFillsFirst(FusedNodes &nodes) {
  if (!choice.first || !nodes.fills.count(0))
    return;
  MemoryBlock token;
  token.start = fillsAddress;
  token.item = 1;
  for (NodeRecord &record : nodes.records)
    record.accesses.push_back(
        {{{token}}, &record == &nodes.records[0], "the fills"});
}
