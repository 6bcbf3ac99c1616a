//===- HierarchyBuilder.cpp - BVH construction on the host ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Cuts.h"

#include "warp/ThreadPool.h"

#include <algorithm>
#include <cmath>
#include <utility>

using namespace warp;
using namespace warp::geometry;

bool Bounds::isProper() const {
  for (int i = 0; i < 3; ++i)
    if (!(low[i] <= high[i]))
      return false;
  return true;
}

Bounds Bounds::finite() const {
  Bounds result = *this;
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(low[i]))
      result.low[i] = std::isfinite(high[i]) ? high[i] : 0;
    if (!std::isfinite(high[i]))
      result.high[i] = result.low[i];
  }
  return result;
}

namespace {

/// Memory that one thread builds in.
struct Arena {
  std::vector<Node> nodes;
  std::vector<Ints> blocks;
  int depth = 0;
};

/// A subtree whose root is a node of the top.
struct Task {
  int32_t root;
  int levels;
  Range range;
  Arena arena;
};

class Builder {
public:
  Builder(std::vector<BuildPrimitive> &primitives, Splitting splitting)
      : sorted(primitives), splitting(splitting) {}

  Topology run(bool hasGroups);

private:
  void buildGroups(Arena &top, std::vector<Task> &tasks);
  void placeGroups(Arena &top, int32_t node, size_t begin, size_t end,
                   int levels, std::vector<Task> &tasks);
  std::vector<Range> setApart(const Range &range) const;
  std::pair<Range, Range> split(const Range &range, int64_t unit);
  std::vector<Range> divide(const Range &range, int levels);
  void build(Arena &arena, int32_t node, const Range &range, int levels,
             std::vector<Task> *tasks);
  Ints takeBlock(const Range &range) const;
  Topology join(Arena &top, std::vector<Task> &tasks) const;

  Sorted sorted;
  Splitting splitting;
  bool areAllProper = true;
  /// Smaller ranges are left to tasks.
  int64_t taskSize = 0;
  /// For each group its primitives, its number and its node.
  std::vector<Range> groups;
  std::vector<int32_t> groupNumbers, groupRoots;
};

} // namespace

/// Orders a range and gives its halves: by the heuristic, or from the middle of
/// the widest axis if `unit`, of which the first half is a multiple, is not 0.
std::pair<Range, Range> Builder::split(const Range &range, int64_t unit) {
  std::pair<Range, Range> halves;
  if (splitting == Splitting::Area && unit == 0 &&
      cutByArea(sorted, range, halves))
    return halves;
  unit = std::max<int64_t>(unit, width);
  int64_t units = (range.size() + unit - 1) / unit;
  int64_t middle = range.begin + (units + 1) / 2 * unit;
  int axis = 0;
  auto extent = [&](int i) { return -range.box[3 + i] - range.box[i]; };
  for (int i = 1; i < 3; ++i)
    axis = extent(i) > extent(axis) ? i : axis;
  auto first = sorted.primitives.begin();
  std::nth_element(first + range.begin, first + middle, first + range.end,
                   [&](const BuildPrimitive &a, const BuildPrimitive &b) {
                     float x = a.bounds.low[axis] + a.bounds.high[axis];
                     float y = b.bounds.low[axis] + b.bounds.high[axis];
                     return x != y ? x < y : a.id < b.id;
                   });
  return {makeRange(sorted, range.begin, middle),
          makeRange(sorted, middle, range.end)};
}

/// The proper and the improper primitives, if there are both.
std::vector<Range> Builder::setApart(const Range &range) const {
  auto first = sorted.primitives.begin() + range.begin;
  auto end = sorted.primitives.begin() + range.end;
  auto middle = std::partition_point(
      first, end, [](const BuildPrimitive &it) { return it.isProper(); });
  if (middle == first || middle == end)
    return {range};
  int64_t at = range.begin + (middle - first);
  return {makeRange(sorted, range.begin, at), makeRange(sorted, at, range.end)};
}

/// The children of a node with `levels` levels of nodes, its own included.
std::vector<Range> Builder::divide(const Range &range, int levels) {
  // A child has one level less, and eight times as many places per level.
  int64_t capacity = levels > 20 ? INT64_MAX : int64_t(1) << (3 * levels);
  int64_t unit = range.size() > capacity ? capacity : 0;
  std::vector<Range> children{range};
  if (!areAllProper && unit == 0)
    children = setApart(range);
  while (children.size() < size_t(width)) {
    auto weight = [&](const Range &child) {
      if (child.size() <= std::max<int64_t>(unit, width))
        return -1.0f;
      return unit ? float(child.size()) : child.area();
    };
    auto largest = std::max_element(
        children.begin(), children.end(),
        [&](const Range &a, const Range &b) { return weight(a) < weight(b); });
    if (weight(*largest) < 0)
      break;
    auto [first, second] = split(*largest, unit);
    *largest = first;
    children.insert(largest + 1, second);
  }
  return children;
}

Ints Builder::takeBlock(const Range &range) const {
  Ints ids = -1;
  for (int64_t i = range.begin; i < range.end; ++i) {
    const BuildPrimitive &it = sorted.primitives[i];
    ids[i - range.begin] = it.isProper() ? it.id : ~it.id;
  }
  return ids;
}

void Builder::build(Arena &arena, int32_t node, const Range &range, int levels,
                    std::vector<Task> *tasks) {
  arena.depth = std::max(arena.depth, maxDepth - levels + 1);
  std::vector<Range> children = divide(range, levels);
  auto firstNode = int32_t(arena.nodes.size());
  u8 nodes = 0, blocks = 0;
  arena.nodes[node].firstNode = firstNode;
  arena.nodes[node].firstBlock = u32(arena.blocks.size());
  for (size_t i = 0; i < children.size(); ++i) {
    if (children[i].size() > width) {
      nodes |= 1 << i;
      Node &child = arena.nodes.emplace_back();
      child.parent = node;
    } else {
      blocks |= 1 << i;
      arena.blocks.push_back(takeBlock(children[i]));
    }
  }
  arena.nodes[node].nodes = nodes;
  arena.nodes[node].blocks = blocks;
  for (size_t i = 0; i < children.size(); ++i) {
    if (!(nodes >> i & 1))
      continue;
    int32_t child = firstNode++;
    if (tasks && children[i].size() <= taskSize)
      tasks->push_back({child, levels - 1, children[i], {}});
    else
      build(arena, child, children[i], levels - 1, tasks);
  }
}

/// Puts the parts behind the top. Node 0 of a part is the one that the top has.
Topology Builder::join(Arena &top, std::vector<Task> &tasks) const {
  Topology all;
  all.topNodes = int32_t(top.nodes.size());
  all.topBlocks = int32_t(top.blocks.size());
  all.depth = top.depth;
  all.nodes = std::move(top.nodes);
  all.blocks = std::move(top.blocks);
  int32_t nodes = all.topNodes, blocks = all.topBlocks;
  for (Task &task : tasks) {
    all.depth = std::max(all.depth, task.arena.depth);
    Topology::Part part{task.root, nodes, 0, blocks, 0};
    nodes = part.endNode = nodes + int32_t(task.arena.nodes.size()) - 1;
    blocks = part.endBlock = blocks + int32_t(task.arena.blocks.size());
    all.parts.push_back(part);
  }
  all.nodes.resize(nodes);
  all.blocks.resize(blocks);
  auto place = [&](int64_t from, int64_t to) {
    for (int64_t i = from; i < to; ++i) {
      const Arena &arena = tasks[i].arena;
      const Topology::Part &part = all.parts[i];
      int32_t parent = all.nodes[part.root].parent;
      auto indexOf = [&](int32_t local) {
        return local ? part.firstNode + local - 1 : part.root;
      };
      for (size_t local = 0; local < arena.nodes.size(); ++local) {
        Node &node = all.nodes[indexOf(int32_t(local))];
        node = arena.nodes[local];
        node.parent = local ? indexOf(node.parent) : parent;
        node.firstNode += part.firstNode - 1;
        node.firstBlock += part.firstBlock;
      }
      std::copy(arena.blocks.begin(), arena.blocks.end(),
                all.blocks.begin() + part.firstBlock);
    }
  };
  ThreadPool::parallelFor(0, int64_t(tasks.size()), 1, place);
  return all;
}

/// Sorts primitives by their groups, over which the top levels are. In a group
/// those that are not proper stay last.
void Builder::buildGroups(Arena &top, std::vector<Task> &tasks) {
  std::vector<BuildPrimitive> &primitives = sorted.primitives;
  std::stable_sort(primitives.begin(), primitives.end(),
                   [](const BuildPrimitive &a, const BuildPrimitive &b) {
                     return a.group < b.group;
                   });
  auto count = int64_t(primitives.size());
  for (int64_t begin = 0, end = 0; begin < count; begin = end) {
    while (end < count && primitives[end].group == primitives[begin].group)
      ++end;
    groups.push_back(makeRange(sorted, begin, end));
    groupNumbers.push_back(primitives[begin].group);
  }
  groupRoots.resize(groups.size());
  placeGroups(top, 0, 0, groups.size(), maxDepth, tasks);
}

void Builder::placeGroups(Arena &top, int32_t node, size_t begin, size_t end,
                          int levels, std::vector<Task> &tasks) {
  if (end - begin == 1) {
    groupRoots[begin] = node;
    if (groups[begin].size() <= taskSize)
      tasks.push_back({node, levels, groups[begin], {}});
    else
      build(top, node, groups[begin], levels, &tasks);
    return;
  }
  size_t children = std::min<size_t>(end - begin, width);
  auto firstNode = int32_t(top.nodes.size());
  top.nodes[node].firstNode = firstNode;
  top.nodes[node].firstBlock = 0;
  top.nodes[node].nodes = u8((1u << children) - 1);
  for (size_t i = 0; i < children; ++i)
    top.nodes.emplace_back().parent = node;
  top.depth = std::max(top.depth, maxDepth - levels + 1);
  for (size_t i = 0; i < children; ++i)
    placeGroups(top, firstNode + int32_t(i),
                begin + (end - begin) * i / children,
                begin + (end - begin) * (i + 1) / children, levels - 1, tasks);
}

Topology Builder::run(bool hasGroups) {
  auto count = int64_t(sorted.primitives.size());
  if (count == 0)
    return {};
  taskSize = std::max<int64_t>(1024, count / 64);
  auto improper = std::stable_partition(
      sorted.primitives.begin(), sorted.primitives.end(),
      [](const BuildPrimitive &it) { return it.isProper(); });
  areAllProper = improper == sorted.primitives.end();
  Range whole = makeRange(sorted, 0, improper - sorted.primitives.begin());
  Bounds bounds = whole.bounds();
  if (!areAllProper)
    whole = makeRange(sorted, 0, count);
  Arena top;
  top.nodes.emplace_back().parent = -1;
  std::vector<Task> tasks;
  if (hasGroups)
    buildGroups(top, tasks);
  else
    build(top, 0, whole, maxDepth, &tasks);
  auto work = [&](int64_t from, int64_t to) {
    for (int64_t i = from; i < to; ++i) {
      Task &task = tasks[i];
      task.arena.nodes.reserve(task.range.size() / 16 + 1);
      task.arena.blocks.reserve(task.range.size() / 4 + 1);
      task.arena.nodes.emplace_back().parent = -1;
      build(task.arena, 0, task.range, task.levels, nullptr);
    }
  };
  ThreadPool::parallelFor(0, int64_t(tasks.size()), 1, work);
  Topology all = join(top, tasks);
  all.bounds = bounds;
  all.groups = std::move(groupNumbers);
  all.groupRoots = std::move(groupRoots);
  return all;
}

Topology warp::geometry::buildTopology(std::vector<BuildPrimitive> &primitives,
                                       Splitting splitting, bool hasGroups) {
  return Builder(primitives, splitting).run(hasGroups);
}
