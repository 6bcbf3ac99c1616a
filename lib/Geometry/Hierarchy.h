//===- Hierarchy.h - A tree in host memory ----------------------*- C++ -*-===//
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

namespace warp::geometry {

/// A power of two that brings the largest extent near 1. Coordinates far from
/// the origin bound it, as they resolve nothing smaller.
float chooseScale(const Bounds &bounds);

template <class Block> class Hierarchy {
public:
  /// Fills a block with primitives of these ids, scaled; NaN for -1 and for
  /// what is not finite.
  template <class Fill>
  void build(std::vector<BuildPrimitive> primitives, Splitting splitting,
             bool hasGroups, Fill &&fill) {
    topology = buildTopology(primitives, splitting, hasGroups);
    primitives = {};
    blocks.resize(topology.blocks.size());
    for (size_t i = 0; i < blocks.size(); ++i)
      blocks[i].id = topology.blocks[i];
    topology.blocks = {};
    refit(fill);
  }

  template <class Fill> void refit(Fill &&fill) {
    auto update = [&](int32_t firstNode, int32_t endNode, int32_t firstBlock,
                      int32_t endBlock) {
      for (int32_t i = firstBlock; i < endBlock; ++i)
        fill(blocks[i]);
      for (int32_t i = endNode - 1; i >= firstNode; --i)
        bound(topology.nodes[i]);
    };
    ThreadPool::parallelFor(
        0, int64_t(topology.parts.size()), 1, [&](int64_t from, int64_t to) {
          for (int64_t i = from; i < to; ++i) {
            const Topology::Part &part = topology.parts[i];
            update(part.firstNode, part.endNode, part.firstBlock,
                   part.endBlock);
          }
        });
    update(0, topology.topNodes, 0, topology.topBlocks);
  }

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
  static Bounds reduce(const Floats (&low)[3], const Floats (&high)[3],
                       u32 lanes) {
    Bounds bounds;
    for (int axis = 0; axis < 3; ++axis) {
      Ints isThere = lanesOf(lanes) & (low[axis] == low[axis]);
      bounds.low[axis] =
          leastOf(choose(isThere, low[axis], Floats(infinity)));
      bounds.high[axis] =
          -leastOf(choose(isThere, -high[axis], Floats(infinity)));
    }
    return bounds;
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
};

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_HIERARCHY_H
