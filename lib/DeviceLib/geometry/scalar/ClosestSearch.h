//===- ClosestSearch.h - The closest triangle, by one thread of a GPU -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds what wide/ClosestSearch.h finds: triangles are compared with the same
// roundings. Those of a block whose bounds are too far are left out first.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H

#include "../Closest.h"
#include "Steps.h"

namespace warp::geometry::scalar {

class ClosestSearch {
public:
  ClosestSearch(const Tree &tree, Point<f32> p, f32 bound2)
      : nodes((Bytes)tree.nodes), blocks((Bytes)tree.blocks), p{p.x, p.y, p.z},
        best(bound2) {
    setFarthest();
  }

  /// A face with a smaller squared distance than the bound, or -1; `lane` of
  /// `block` is its triangle.
  i32 run(i32 root) {
    i32 at = root;
    for (;;) {
      // Threads of a warp wait here until each is at a block.
      while (at >= 0)
        at = enter(at);
      if (at == nowhere)
        return face;
      visit(~at);
      at = next();
    }
  }

  i32 block = 0, lane = 0;

private:
  void setFarthest() { farthest = __builtin_bit_cast(u32, best) | 7; }

  /// The squared distance from bounds that are this far below and above.
  template <class Offset> static f32 squareOf(Offset offset) {
    f32 x = offset(0), y = offset(1), z = offset(2);
    return fma(x, x, fma(y, y, z * z));
  }

  /// The nearest child of those that were left; `nowhere` after the last one.
  i32 next() {
    while (count)
      if (stack[--count].key <= farthest)
        return stack[count].follow(nodes);
    return nowhere;
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
    if (key[0] > farthest)
      return next();
#pragma unroll
    for (int i = width - 1; i > 0; --i)
      if (key[i] <= farthest)
        stack[count++] = {key[i], index};
    return links.follow(key[0] & 7);
  }

  /// The triangles of a block whose bounds are close enough.
  u32 candidates(Bytes at) const {
    u32 found = 0;
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      Four corner[3][3];
#pragma unroll
      for (int i = 0; i < 9; ++i)
        corner[i / 3][i % 3] =
            load<Four>(at + i * int(sizeof(Floats)) + 16 * half);
#pragma unroll
      for (int lane = 0; lane < 4; ++lane) {
        f32 squared = squareOf([&](int axis) {
          f32 a = corner[0][axis][lane], b = corner[1][axis][lane],
              c = corner[2][axis][lane];
          f32 below = lower(lower(a, b), c) - p[axis];
          f32 above = p[axis] - upper(upper(a, b), c);
          return upper(upper(below, above), 0);
        });
        // The distance of a triangle is rounded differently.
        found |= u32(squared * 0.99999f <= best) << (4 * half + lane);
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
  u32 farthest;
  i32 face = -1;
  int count = 0;
  Rest stack[maxRests];
};

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H
