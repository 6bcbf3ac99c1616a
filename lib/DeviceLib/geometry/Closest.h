//===- Closest.h - Closest-point queries of a mesh --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Triangles are moved so that the query point is the origin. The closest point
// is the best of four points of the triangle: one on each edge, and the foot of
// the perpendicular if its weights say that it is inside. Each is a point of
// the triangle whatever was rounded, so no distance is too small; a triangle
// without area is its edges.
//
// Weights of the foot are quotients of products of squared lengths. For a thin
// triangle those cancel, the foot slides along it, and its distance is too
// large. There weights are areas of the triangles at the foot: cross products
// whose components are rounded once, so the foot is that of a triangle whose
// corners moved by their rounding.
//
// Blocks compare in f32. The weights of the winner are computed once more in
// f64: a weight is zero exactly where the closest point is on an edge.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_CLOSEST_H
#define WARP_DEVICELIB_GEOMETRY_CLOSEST_H

#include "Tree.h"

#include "DeviceLib/Prototypes.h"

namespace warp::geometry {

/// A point of a triangle: weights of its second and third corner, and what it
/// is when the query point is the origin.
template <class V> struct OnTriangle {
  V second, third, squared;
};

/// The squared sine of the angle at the first corner below which a triangle is
/// thin. Above, the foot is off by a few times 2^-24 / `thinness` of its edges.
constexpr f32 thinness = 0.1f;

template <class V, class Mask>
inline void keep(OnTriangle<V> &best, Mask where, V second, V third,
                 V squared) {
  best.second = choose(where, second, best.second);
  best.third = choose(where, third, best.third);
  best.squared = choose(where, squared, best.squared);
}

/// The parameter on the segment from a point in a direction at which the origin
/// is closest.
template <class V> inline V foot(V toStart, V length2) {
  V t = -toStart / length2;
  // 0 / 0 of a segment without length compares with nothing.
  t = choose(t > V(0), t, V(0));
  return choose(t < V(1), t, V(1));
}

/// Weights of a point of a triangle, times the square of its normal.
template <class V> struct Foot {
  V second, third;
};

/// A triangle, moved, whose plane has the foot of the origin.
template <class V> struct Plane {
  Point<V> a, ab, ac, normal;
  V ab2, ac2, aab, aac, area2;

  auto isThin() const { return area2 < ab2 * (ac2 * V(thinness)); }
  Foot<V> byLengths() const {
    V abac = dot(ab, ac);
    return {differenceOfProducts(abac, aac, ac2, aab),
            differenceOfProducts(abac, aab, ab2, aac)};
  }
  Foot<V> byAreas() const {
    return {dot(normal, cross(ac, a)), dot(normal, cross(a, ab))};
  }
};

/// The point of triangle a b c that is closest to the origin; `findFoot` gives
/// the foot in its plane.
template <class V, class Find>
__attribute__((always_inline)) inline OnTriangle<V>
closestOnTriangle(Point<V> a, Point<V> b, Point<V> c, Find findFoot) {
  Point<V> ab = b - a, ac = c - a, bc = c - b;
  V ab2 = dot(ab, ab), ac2 = dot(ac, ac), bc2 = dot(bc, bc);
  V aab = dot(a, ab), aac = dot(a, ac), bbc = dot(b, bc);
  auto squareAt = [&](Point<V> start, V t, Point<V> direction) {
    Point<V> p = start.along(t, direction);
    return dot(p, p);
  };
  V t = foot(aab, ab2);
  OnTriangle<V> best{t, V(0), squareAt(a, t, ab)};
  t = foot(aac, ac2);
  V squared = squareAt(a, t, ac);
  keep(best, squared < best.squared, V(0), t, squared);
  t = foot(bbc, bc2);
  squared = squareAt(b, t, bc);
  keep(best, squared < best.squared, V(1) - t, t, squared);

  Point<V> normal = cross(ab, ac);
  V area2 = dot(normal, normal);
  Foot<V> at = findFoot(Plane<V>{a, ab, ac, normal, ab2, ac2, aab, aac, area2});
  V second = at.second / area2, third = at.third / area2;
  Point<V> inner = a.along(second, ab).along(third, ac);
  squared = dot(inner, inner);
  auto inside = both(both(second > V(0), third > V(0)), second + third < V(1));
  keep(best, both(inside, squared < best.squared), second, third, squared);
  return best;
}

template <class V>
__attribute__((always_inline)) inline OnTriangle<V>
closestOnTriangle(Point<V> a, Point<V> b, Point<V> c) {
  return closestOnTriangle(a, b, c, [](const Plane<V> &plane) {
    Foot<V> foot = plane.byLengths();
    auto isThin = plane.isThin();
    if (isAny(isThin)) {
      Foot<V> ofThin = plane.byAreas();
      foot = {choose(isThin, ofThin.second, foot.second),
              choose(isThin, ofThin.third, foot.third)};
    }
    return foot;
  });
}

/// That of a thin triangle, apart: most searches end without.
#ifndef WARP_GPU
__attribute__((noinline, cold))
#endif
inline OnTriangle<f64> closestOnThin(const Point<f64> (&corner)[3]) {
  return closestOnTriangle(
      corner[0], corner[1], corner[2],
      [](const Plane<f64> &plane) { return plane.byAreas(); });
}

__attribute__((always_inline)) inline OnTriangle<f64>
closestOnTriangle(Point<f64> a, Point<f64> b, Point<f64> c) {
  bool isThin;
  OnTriangle<f64> point =
      closestOnTriangle(a, b, c, [&](const Plane<f64> &plane) {
        isThin = plane.isThin();
        return plane.byLengths();
      });
  if (!isThin)
    return point;
  Point<f64> corner[3] = {a, b, c};
  return closestOnThin(corner);
}

/// The corner furthest from p, of all that are further than `minDist`.
inline ClosestPoint findFurthest(const Tree &tree, Point<f32> p, f32 minDist) {
  ClosestPoint result{-1, 0, 0};
  if (!tree.nodes)
    return result;
  f32 bound = minDist * tree.scale;
  f32 best = bound > 0 ? bound * bound : 0;
  Point<f32> at{p.x * tree.scale, p.y * tree.scale, p.z * tree.scale};
  auto *blocks = static_cast<const TriangleBlock *>(tree.blocks);
  i32 stack[maxDepth * (width - 1) + 1] = {0};
  for (int count = 1; count;) {
    const Node &node = tree.nodes[stack[--count]];
    auto reach = [&](int axis, f32 x) {
      return greatest(x - node.low[axis], node.high[axis] - x);
    };
    Point<Floats> offset{reach(0, at.x), reach(1, at.y), reach(2, at.z)};
    // Bounds are rounded, and ties are to be seen.
    u32 far = bitsOf(dot(offset, offset) * 1.000001f >= Floats(best)) &
              node.children();
    for (; far; far &= far - 1) {
      int child = lowestBit(far);
      if (node.nodes >> child & 1) {
        stack[count++] = node.nodeAt(child);
        continue;
      }
      const TriangleBlock &block = blocks[node.blockAt(child)];
      for (int corner = 0; corner < 3; ++corner) {
        Point<Floats> arm = block.corner(corner) - spread(at);
        Floats squared = dot(arm, arm);
        for (int lane = 0; lane < width; ++lane) {
          bool further = squared[lane] > best || (squared[lane] == best &&
                                                  block.id[lane] < result.face);
          if (!further)
            continue;
          best = squared[lane];
          result = {block.id[lane], f32(corner == 0), f32(corner == 1)};
        }
      }
    }
  }
  return result;
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_CLOSEST_H
