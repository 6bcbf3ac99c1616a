//===- Hierarchy.h - BVH in host memory -------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Nodes and blocks of primitives with their bounds. The kind of primitive is a
// parameter: how to fill a block, given ids and a scale.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_HIERARCHY_H
#define WARP_LIB_GEOMETRY_HIERARCHY_H

#include "HierarchyBuilder.h"

#include "warp/ThreadPool.h"

#include <algorithm>
#include <atomic>

namespace warp::geometry {

/// A power of two that brings the largest extent near 1. Coordinates far from
/// the origin bound it, as they resolve nothing smaller.
float chooseScale(const Bounds &bounds);

template <class Block> class Hierarchy {
public:
  /// `see` gets the bounds of all proper primitives; `fill` then fills a block
  /// with primitives of these ids, scaled; NaN for -1 and for what is not
  /// proper, of which it gives the number.
  template <class See, class Fill>
  void build(std::vector<BuildPrimitive> primitives, Splitting splitting,
             bool hasGroups, See &&see, Fill &&fill) {
    topology = buildTopology(primitives, splitting, hasGroups);
    see(topology.bounds);
    primitives = {};
    blocks.resize(topology.blocks.size());
    for (size_t i = 0; i < blocks.size(); ++i)
      blocks[i].id = topology.blocks[i];
    topology.blocks = {};
    refit(fill);
  }

  template <class Fill> void refit(Fill &&fill) {
    std::atomic<int64_t> improper = 0;
    auto update = [&](int32_t firstNode, int32_t endNode, int32_t firstBlock,
                      int32_t endBlock) {
      int64_t found = 0;
      for (int32_t i = firstBlock; i < endBlock; ++i)
        found += fill(blocks[i]);
      improper += found;
      for (int32_t i = endNode - 1; i >= firstNode; --i)
        bound(topology.nodes[i]);
    };
    ThreadPool::parallelFor(0, int64_t(topology.parts.size()), 1,
                            [&](int64_t from, int64_t to) {
                              for (int64_t i = from; i < to; ++i) {
                                const Topology::Part &part = topology.parts[i];
                                update(part.firstNode, part.endNode,
                                       part.firstBlock, part.endBlock);
                              }
                            });
    update(0, topology.topNodes, 0, topology.topBlocks);
    skippedCount = improper;
  }

  /// Primitives that nothing finds, as they are not proper.
  int64_t skipped() const { return skippedCount; }

  const std::vector<Node> &nodes() const { return topology.nodes; }
  const std::vector<Block> &leaves() const { return blocks; }
  int depth() const { return topology.depth; }
  /// As TreeExtras has them.
  std::vector<int32_t> groups() const {
    std::vector<int32_t> all = topology.groups;
    all.insert(all.end(), topology.groupRoots.begin(),
               topology.groupRoots.end());
    return all;
  }
  size_t bytes() const {
    return topology.nodes.size() * sizeof(Node) + blocks.size() * sizeof(Block);
  }

private:
  /// The least of the lanes of each of eight.
  static Floats leastOfEach(const Floats (&x)[8]) {
    auto halves = [](Floats a, Floats b) {
      return least(__builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11),
                   __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15));
    };
    auto quarters = [](Floats a, Floats b) {
      return least(__builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13),
                   __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15));
    };
    Floats front = quarters(halves(x[0], x[1]), halves(x[2], x[3]));
    Floats back = quarters(halves(x[4], x[5]), halves(x[6], x[7]));
    Floats all =
        least(__builtin_shufflevector(front, back, 0, 2, 8, 10, 4, 6, 12, 14),
              __builtin_shufflevector(front, back, 1, 3, 9, 11, 5, 7, 13, 15));
    return __builtin_shufflevector(all, all, 0, 4, 1, 5, 2, 6, 3, 7);
  }
  /// The bounds in lanes that are there and no NaN.
  static Bounds reduce(const Floats (&low)[3], const Floats (&high)[3],
                       u32 lanes) {
    Floats all[8];
    all[6] = all[7] = Floats(infinity);
    for (int axis = 0; axis < 3; ++axis) {
      Ints isThere = lanesOf(lanes) & (low[axis] == low[axis]);
      all[axis] = choose(isThere, low[axis], Floats(infinity));
      all[3 + axis] = choose(isThere, -high[axis], Floats(infinity));
    }
    Floats box = leastOfEach(all);
    return {{box[0], box[1], box[2]}, {-box[3], -box[4], -box[5]}};
  }
  Bounds boundsOf(const Block &block) const {
    Floats low[3], high[3];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = block.low(axis);
      high[axis] = block.high(axis);
    }
    return reduce(low, high, 0xff);
  }
  Bounds boundsOf(const Node &node) const {
    return reduce(node.low, node.high, node.children());
  }
  void bound(Node &node) {
    for (int child = 0; child < width; ++child) {
      Bounds bounds;
      if (node.nodes >> child & 1)
        bounds = boundsOf(topology.nodes[node.nodeAt(child)]);
      else if (node.blocks >> child & 1)
        bounds = boundsOf(blocks[node.blockAt(child)]);
      for (int axis = 0; axis < 3; ++axis) {
        node.low[axis][child] = bounds.low[axis];
        node.high[axis][child] = bounds.high[axis];
      }
    }
  }

  Topology topology;
  std::vector<Block> blocks;
  int64_t skippedCount = 0;
};

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_HIERARCHY_H
