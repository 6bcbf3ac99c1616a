//===- ClosestSearch.h - The closest triangle, by one thread of a GPU -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds what wide/ClosestSearch.h finds: triangles are compared with the same
// roundings. Those of a block that are too far for sure are left out first.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H

#include "../Closest.h"
#include "Steps.h"

namespace warp::geometry::scalar {

/// The squared distance of a segment from the origin, a little too large.
inline f32 squareToSegment(Point<f32> start, Point<f32> along, f32 length2) {
  f32 t = lower(upper(-dot(start, along) * roughInverse(length2), 0), 1);
  Point<f32> at = start.along(t, along);
  return dot(at, at);
}

/// Whether `closestOnTriangle` may give this squared distance or less; in a
/// third of its time. Feet are found with rough quotients, so that points of
/// edges are off by 2^-20 of the triangle's size, and its plane's distance by
/// as much of that of its corners. The foot in the plane counts as inside when
/// roundings may have moved it out: it is never too far.
inline bool mayBeWithin(Point<f32> a, Point<f32> b, Point<f32> c, f32 best) {
  Point<f32> ab = b - a, ac = c - a, bc = c - b;
  f32 ab2 = dot(ab, ab), ac2 = dot(ac, ac);
  f32 squared = lower(squareToSegment(a, ab, ab2), squareToSegment(a, ac, ac2));
  squared = lower(squared, squareToSegment(b, bc, dot(bc, bc)));
  Point<f32> normal = cross(ab, ac);
  f32 area2 = dot(normal, normal), height = dot(normal, a);
  f32 abac = dot(ab, ac), aab = dot(a, ab), aac = dot(a, ac);
  f32 second = abac * aac - ac2 * aab, third = abac * aab - ab2 * aac;
  f32 sizes = __builtin_elementwise_abs(abac) + ac2 + ab2;
  f32 slack = sizes * 0x1p-18f *
              (__builtin_elementwise_abs(aac) + __builtin_elementwise_abs(aab));
  bool isInside =
      second >= -slack && third >= -slack && second + third <= area2 + slack;
  f32 plane = height * height * roughInverse(area2);
  squared = isInside ? lower(squared, plane) : squared;
  // Not `>`: what is no number is looked at.
  return !(squared * 0x1.fffcp-1f > fma(ab2 + ac2, 0x1p-26f, best));
}

class ClosestSearch {
public:
  ClosestSearch(const Tree &tree, Point<f32> p, f32 bound2)
      : nodes((Bytes)tree.nodes), blocks((Bytes)tree.blocks), p{p.x, p.y, p.z},
        best(bound2), rests(nodes) {
    setFarthest();
  }

  /// A face with a smaller squared distance than the bound, or -1; `lane` of
  /// `block` is its triangle.
  i32 run(i32 root) {
    rests.search(
        root, [this](i32 node) { return enter(node); },
        [this](i32 block) { return visit(block), true; });
    return face;
  }

  i32 block = 0, lane = 0;

private:
  void setFarthest() { rests.farthest = __builtin_bit_cast(u32, best) | 7; }

  /// The squared distance from bounds that are this far below and above.
  template <class Offset> static f32 squareOf(Offset offset) {
    f32 x = offset(0), y = offset(1), z = offset(2);
    return fma(x, x, fma(y, y, z * z));
  }

  /// Leaves the children that may be closer for later, but the nearest, which
  /// it gives.
  i32 enter(i32 index) {
    Bytes node = nodes + i64(index) * i64(sizeof(Node));
    Links links(node);
    u32 children = links.children(), key[width];
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      Four low[3], high[3];
#pragma unroll
      for (int axis = 0; axis < 3; ++axis) {
        Bytes plane = node + axis * int(sizeof(Floats)) + 16 * half;
        low[axis] = load<Four>(plane);
        high[axis] = load<Four>(plane + 3 * int(sizeof(Floats)));
      }
#pragma unroll
      for (int lane = 0; lane < 4; ++lane) {
        f32 squared = squareOf([&](int axis) {
          return upper(
              upper(low[axis][lane] - p[axis], p[axis] - high[axis][lane]), 0);
        });
        int child = 4 * half + lane;
        key[child] = children >> child & 1 ? keyOf(squared, child) : noKey;
      }
    }
    sortKeys(key);
    if (key[0] > rests.farthest)
      return rests.next();
#pragma unroll
    for (int i = width - 1; i > 0; --i)
      if (key[i] <= rests.farthest)
        rests.leave(key[i], index);
    return links.follow(key[0] & 7);
  }

  /// The triangles of a block that may be close enough.
  u32 candidates(Bytes at) const {
    u32 found = 0;
#pragma unroll 1
    for (int half = 0; half < 2; ++half, at += 16) {
      Four corner[3][3];
#pragma unroll
      for (int i = 0; i < 9; ++i)
        corner[i / 3][i % 3] = load<Four>(at + i * int(sizeof(Floats)));
#pragma unroll
      for (int lane = 0; lane < 4; ++lane) {
        auto offset = [&](int i) -> Point<f32> {
          return {corner[i][0][lane] - p[0], corner[i][1][lane] - p[1],
                  corner[i][2][lane] - p[2]};
        };
        bool isNear = mayBeWithin(offset(0), offset(1), offset(2), best);
        found |= u32(isNear) << (4 * half + lane);
      }
    }
    return found;
  }

  void visit(i32 index) {
    Bytes at = blocks + i64(index) * i64(sizeof(TriangleBlock));
    for (u32 left = candidates(at); left; left &= left - 1) {
      int lane = lowestBit(left);
      auto corner = [&](int i) -> Point<f32> {
        Bytes from = at + 3 * i * int(sizeof(Floats)) + 4 * lane;
        return {load<f32>(from) - p[0],
                load<f32>(from + int(sizeof(Floats))) - p[1],
                load<f32>(from + 2 * int(sizeof(Floats))) - p[2]};
      };
      f32 squared = closestOnTriangle(corner(0), corner(1), corner(2)).squared;
      if (!(squared <= best))
        continue;
      i32 id = load<i32>(at + 9 * int(sizeof(Floats)) + 4 * lane);
      if (squared == best && !(id < face))
        continue;
      best = squared;
      face = id;
      block = index;
      this->lane = lane;
    }
    setFarthest();
  }

  Bytes nodes, blocks;
  f32 p[3];
  f32 best;
  i32 face = -1;
  Rests rests;
};

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H
