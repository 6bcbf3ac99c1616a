//===- Overlap.h - Overlap tests for boxes, spheres and rays --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An iterator has no memory: it is a place in the tree, eight bits per level
// for the children still to visit, and the primitives left in a block. Going up
// reads a node's parent.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_OVERLAP_H
#define WARP_DEVICELIB_GEOMETRY_OVERLAP_H

#include "Closest.h"
#include "Ray.h"

namespace warp::geometry {

/// The position of an iterator. `level` -1: at `node`, not entered yet.
struct Cursor {
  i32 node, level, block;
  u32 left;
  u64 lowTrail, highTrail;
  /// The number in the block of the one that was found last.
  int lane = 0;

  u32 remaining() const {
    u64 trail = level < 8 ? lowTrail : highTrail;
    return u32(trail >> (level % 8 * 8)) & 0xff;
  }
  void setRemaining(u32 bits) {
    u64 &trail = level < 8 ? lowTrail : highTrail;
    int shift = level % 8 * 8;
    trail = (trail & ~(u64(0xff) << shift)) | u64(bits) << shift;
  }
};

/// A closed box.
struct BoxShape {
  Point<f32> low, high;

  template <class Bounds> u32 test(const Bounds &bounds) const {
    auto axis = [&](Floats from, Floats to, f32 least, f32 greatest) {
      return (from <= Floats(greatest)) & (to >= Floats(least));
    };
    return bitsOf(axis(bounds.low(0), bounds.high(0), low.x, high.x) &
                  axis(bounds.low(1), bounds.high(1), low.y, high.y) &
                  axis(bounds.low(2), bounds.high(2), low.z, high.z));
  }
};

/// A closed ball.
struct SphereShape {
  Point<f32> center;
  f32 squared;

  template <class Bounds> u32 test(const Bounds &bounds) const {
    auto axis = [&](int i, f32 at) {
      return greatest(greatest(bounds.low(i) - at, at - bounds.high(i)),
                      Floats(0));
    };
    // For a NaN primitive `greatest` gives 0.
    Ints isThere = bounds.low(0) == bounds.low(0);
    Point<Floats> offset{axis(0, center.x), axis(1, center.y),
                         axis(2, center.z)};
    return bitsOf(isThere & (dot(offset, offset) <= Floats(squared)));
  }
};

/// A closed ball that finds the triangles that it touches, not their bounds.
struct TriangleSphereShape : SphereShape {
  using SphereShape::test;
  u32 test(const TriangleBlock &block) const {
    Point<Floats> p = spread(center);
    return bitsOf(closestOnTriangle(block.corner(0) - p, block.corner(1) - p,
                                    block.corner(2) - p)
                      .squared <= Floats(squared));
  }
};

/// Boxes that a ray meets at 0 <= t < limit.
struct RayShape {
  const Ray &ray;
  f32 limit;

  template <class Bounds> u32 test(const Bounds &bounds) const {
    Floats entry;
    return bitsOf(meet(bounds, entry) & (entry < Floats(limit)));
  }
  /// The boxes that the ray meets at 0 <= t, and where it enters them.
  template <class Bounds> Ints meet(const Bounds &bounds, Floats &entry) const {
    entry = Floats(0);
    Floats leave = Floats(infinity);
    Ints within = bounds.low(0) == bounds.low(0);
    for (int axis = 0; axis < 3; ++axis) {
      Floats low = bounds.low(axis) - ray.start[axis];
      Floats high = bounds.high(axis) - ray.start[axis];
      f32 direction = ray.direction[axis], inverse = ray.inverse[axis];
      if (direction == 0) {
        within &= (low <= Floats(0)) & (high >= Floats(0));
        continue;
      }
      entry = greatest(entry, (direction > 0 ? low : high) * inverse);
      leave = least(leave, (direction > 0 ? high : low) * inverse);
    }
    return within & (entry <= leave * 1.000001f);
  }
};

/// Boxes, grown by a radius, that a ray meets at 0 <= t <= limit.
struct CapsuleShape {
  RayShape ray;
  f32 radius;

  template <class Bounds> struct Grown {
    const Bounds &bounds;
    f32 radius;
    Floats low(int axis) const { return bounds.low(axis) - radius; }
    Floats high(int axis) const { return bounds.high(axis) + radius; }
  };
  template <class Bounds> u32 test(const Bounds &bounds) const {
    Floats entry;
    Ints met = ray.meet(Grown<Bounds>{bounds, radius}, entry);
    return bitsOf(met & (entry <= Floats(ray.limit)));
  }
};

/// Bounds of a node's children, as of a block.
struct ChildBounds {
  const Node &node;
  Floats low(int axis) const { return node.low[axis]; }
  Floats high(int axis) const { return node.high[axis]; }
};

/// Advances to the next primitive that the shape touches; -1 at the end.
template <class Block, class Shape>
inline i32 nextOverlap(const Tree &tree, const Shape &shape, Cursor &cursor) {
  auto *blocks = static_cast<const Block *>(tree.blocks);
  if (!tree.nodes || cursor.node < 0)
    return -1;
  auto enter = [&](i32 index) {
    const Node &node = tree.nodes[index];
    cursor.node = index;
    ++cursor.level;
    cursor.setRemaining(shape.test(ChildBounds{node}) & node.children());
  };
  if (cursor.level < 0)
    enter(cursor.node);
  while (!cursor.left) {
    u32 remaining = cursor.remaining();
    if (!remaining) {
      if (cursor.level == 0) {
        cursor.node = -1;
        return -1;
      }
      --cursor.level;
      cursor.node = tree.nodes[cursor.node].parent;
      continue;
    }
    int child = lowestBit(remaining);
    cursor.setRemaining(remaining & (remaining - 1));
    const Node &node = tree.nodes[cursor.node];
    if (node.blocks >> child & 1) {
      cursor.block = node.blockAt(child);
      cursor.left = shape.test(blocks[cursor.block]);
    } else {
      enter(node.nodeAt(child));
    }
  }
  cursor.lane = lowestBit(cursor.left);
  cursor.left &= cursor.left - 1;
  return blocks[cursor.block].id[cursor.lane];
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_OVERLAP_H
