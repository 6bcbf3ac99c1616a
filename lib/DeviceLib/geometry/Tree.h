//===- Tree.h - BVH layout for queries --------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A node has up to eight children: nodes, or blocks of up to eight primitives.
// Its nodes are neighbours in memory and so are its blocks, so the place of a
// child is a base plus the number of children of its kind before it. No branch
// is deeper than `maxDepth` nodes (the builder's promise), so a traversal keeps
// a level of its own for each, and an iterator eight bits.
//
// Primitives that are not there are NaN, which no comparison finds. Coordinates
// of blocks and nodes are the user's times a power of two that brings their
// extent near 1, so that squares neither overflow nor vanish.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_TREE_H
#define WARP_DEVICELIB_GEOMETRY_TREE_H

#include "Vectors.h"

namespace warp::geometry {

constexpr int maxDepth = 16;

struct alignas(64) Node {
  Floats low[3], high[3];
  u32 firstNode, firstBlock;
  i32 parent;
  /// Bits of the children that are nodes, and of those that are blocks.
  u8 nodes, blocks;
  u8 unused[50];

  u32 children() const { return u32(nodes) | blocks; }
  i32 nodeAt(int child) const {
    return i32(firstNode) + countBits(nodes & ((1u << child) - 1));
  }
  i32 blockAt(int child) const {
    return i32(firstBlock) + countBits(blocks & ((1u << child) - 1));
  }
};
static_assert(sizeof(Node) == 256);

/// Vertices of triangles.
struct alignas(64) TriangleBlock {
  Floats vertex[3][3];
  Ints id;

  Point<Floats> corner(int i) const {
    return {vertex[i][0], vertex[i][1], vertex[i][2]};
  }
  Floats low(int axis) const {
    return least(least(vertex[0][axis], vertex[1][axis]), vertex[2][axis]);
  }
  Floats high(int axis) const {
    return greatest(greatest(vertex[0][axis], vertex[1][axis]),
                    vertex[2][axis]);
  }
};
static_assert(sizeof(TriangleBlock) == 320);

/// Boxes, the primitives of a hierarchy without a mesh.
struct alignas(32) BoxBlock {
  Floats bounds[6];
  Ints id;

  Floats low(int axis) const { return bounds[axis]; }
  Floats high(int axis) const { return bounds[3 + axis]; }
};
static_assert(sizeof(BoxBlock) == 224);

/// Starts the slot of a Bvh and of a Mesh; Python's kernel language reads the
/// same bytes. Null nodes: nothing is in it.
struct Tree {
  /// Kind, device and generation of the handle.
  u64 tag;
  const Node *nodes;
  const void *blocks;
  /// From the user's coordinates to those of nodes.
  f32 scale;
  i32 count;
};
static_assert(sizeof(Tree) == 32);

struct Moments;

/// Ends the slot of a Bvh and of a Mesh: what only some of them have.
struct TreeExtras {
  /// One per node, for winding numbers.
  const Moments *moments;
  /// Numbers of groups in ascending order, then the nodes that hold them.
  const i32 *groups;
  i32 groupCount;
  /// Queries begin at one of so many nodes.
  i32 nodeCount;
};
constexpr int extrasOffset = 200;
static_assert(extrasOffset + sizeof(TreeExtras) <= 256);

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_TREE_H
