//===- TreeFill.cpp - BVH nodes of ordered primitives, on CUDA ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Eight primitives that follow each other share a block, eight blocks a node,
// eight nodes the next one (Kamel and Faloutsos, "Hilbert R-tree: an improved
// R-tree using fractals", VLDB 1994). `tree_fill` writes blocks and the two
// levels of nodes above them, `tree_top` the other levels. The bits are those
// of a refit (python/warp/_src/geometry/device/refit.py).
//
//===----------------------------------------------------------------------===//

#include "Tree.h"

using namespace gpu;
using namespace tree;

/// Words of a node (lib/DeviceLib/geometry/Tree.h).
static constexpr int nodeWords = 64, highs = 24, childNodes = 48,
                     childBlocks = 49, parentAt = 50, masksAt = 51;
static constexpr uint32_t none = 0x7fc00000;

using treeShape::fillers;
static constexpr int subtree = 512;

namespace {
struct Levels {
  /// The root first; where the last one ends.
  int32_t count, starts[13];
  int32_t blocks;

  int number(int level) const { return starts[level + 1] - starts[level]; }
  /// Children of a node of a level.
  int children(int level, int node) const {
    int below = level + 1 == count ? blocks : number(level + 1);
    int rest = below - 8 * node;
    return rest < 8 ? rest : 8;
  }
  void link(float *nodes, int level, int node) const {
    auto *words = reinterpret_cast<int32_t *>(nodes) +
                  int64_t(starts[level] + node) * nodeWords;
    bool isLast = level + 1 == count;
    int mask = (1 << children(level, node)) - 1;
    words[childNodes] = isLast ? 0 : starts[level + 1] + 8 * node;
    words[childBlocks] = isLast ? 8 * node : 0;
    words[parentAt] = level == 0 ? -1 : starts[level - 1] + node / 8;
    words[masksAt] = isLast ? mask << 8 : mask;
  }
  void bound(float *nodes, int level, int node, int child,
             const Box &box) const {
    float *words = nodes + int64_t(starts[level] + node) * nodeWords;
    for (int axis = 0; axis < 3; ++axis) {
      words[8 * axis + child] = box.low[axis];
      words[highs + 8 * axis + child] = box.high[axis];
    }
  }
};
} // namespace

/// A block for the primitives of a node above a node, a thread for each. They
/// are as ordered, or as blocks already have them.
WARP_KERNEL(fillers, 2)
void tree_fill(Primitives all, const int *order, const float *scale,
               Levels levels, float *nodes, uint32_t *blocks) {
  WARP_SHARED Box boxes[fillers / warpSize];
  int place = block() * subtree + thread(), inBlock = thread() % 8;
  int index = place / 8, bottom = levels.count - 1;
  Box box = nothing();
  if (index < levels.blocks) {
    int corners = all.corners();
    uint32_t *words = blocks + int64_t(index) * (all.ofTriangles ? 80 : 56);
    uint32_t *ids = words + 24 * corners;
    int id = order == nullptr    ? int(ids[inBlock])
             : place < all.count ? order[place]
                                 : -1;
    float corner[3][3];
    bool isThere = id >= 0 && all.read(id, corner) == Primitives::Proper;
    ids[inBlock] = uint32_t(id);
#pragma unroll
    for (int k = 0; k < 3; ++k)
      for (int axis = 0; axis < 3 && k < corners; ++axis)
        words[24 * k + 8 * axis + inBlock] =
            isThere ? __builtin_bit_cast(uint32_t, corner[k][axis] * *scale)
                    : none;
    if (isThere)
      box = all.boundsOf(corner, *scale);
  }
  box.uniteLanes(1, 8);
  int parent = index / 8;
  bool isNode = parent < levels.number(bottom);
  if (inBlock == 0 && isNode)
    levels.bound(nodes, bottom, parent, index % 8, box);
  box.uniteLanes(8, warpSize);
  if (lane() == 0)
    boxes[thread() / warpSize] = box;
  if (thread() % 64 == 0 && isNode)
    levels.link(nodes, bottom, parent);
  if (bottom == 0)
    return;
  syncThreads();
  if (thread() >= warpSize)
    return;
  // The boxes of two warps are one node's.
  int child = thread() % 8;
  box = boxes[2 * child];
  box.include(boxes[2 * child + 1]);
  if (thread() < 8)
    levels.bound(nodes, bottom - 1, block(), child, box);
  box.uniteLanes(1, 8);
  if (thread() != 0)
    return;
  levels.link(nodes, bottom - 1, block());
  if (bottom > 1)
    levels.bound(nodes, bottom - 2, block() / 8, block() % 8, box);
}

/// The levels above those, in one block: bounds of their children are there.
WARP_KERNEL(treeShape::toppers, 1) void tree_top(Levels levels, float *nodes) {
  for (int level = levels.count - 3; level >= 0; --level) {
    int number = levels.number(level);
    for (int i = thread(); i < 6 * number; i += 1024) {
      int node = i / 6, plane = i % 6;
      float *words = nodes + int64_t(levels.starts[level] + node) * nodeWords;
      float *row = words + 8 * plane, empty = plane < 3 ? infinity : -infinity;
      int children = levels.children(level, node);
      float bound = empty;
      for (int child = 0; child < 8; ++child) {
        if (child >= children)
          row[child] = empty;
        else
          bound =
              plane < 3 ? lower(bound, row[child]) : upper(bound, row[child]);
      }
      if (plane == 0)
        levels.link(nodes, level, node);
      if (level > 0)
        nodes[int64_t(levels.starts[level - 1] + node / 8) * nodeWords +
              8 * plane + node % 8] = bound;
    }
    syncThreads();
  }
}
