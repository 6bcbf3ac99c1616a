//===- Closest.h - The closest point of a mesh ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Triangles are moved so that the query point is the origin. The closest point
// is the best of four points of the triangle: one on each edge, and the foot of
// the perpendicular if its weights say that it is inside. Each is a point of
// the triangle whatever was rounded, so slivers and points far away cost digits
// of where it is, never of how far; a triangle without area is its edges.
//
// Blocks compare in f32. The weights of the winner are computed once more in
// f64: a weight is zero exactly where the closest point is on an edge.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_CLOSEST_H
#define WARP_DEVICELIB_GEOMETRY_CLOSEST_H

#include "Tree.h"

namespace warp::geometry {

/// A point of a triangle: weights of its second and third corner, and what it
/// is when the query point is the origin.
template <class V> struct OnTriangle {
  V second, third, squared;
};

template <class V, class Mask>
inline void keepCloser(OnTriangle<V> &best, Mask where, V second, V third,
                       V squared) {
  where = both(where, squared < best.squared);
  best.second = choose(where, second, best.second);
  best.third = choose(where, third, best.third);
  best.squared = choose(where, squared, best.squared);
}

/// Where on the segment from a point in a direction the origin is closest.
template <class V> inline V foot(V toStart, V length2) {
  V t = -toStart / length2;
  // 0 / 0 of a segment without length compares with nothing.
  t = choose(t > V(0), t, V(0));
  return choose(t < V(1), t, V(1));
}

/// The point of triangle a b c that is closest to the origin.
template <class V>
inline OnTriangle<V> closestOnTriangle(Point<V> a, Point<V> b, Point<V> c) {
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
  keepCloser(best, squared == squared, V(0), t, squared);
  t = foot(bbc, bc2);
  squared = squareAt(b, t, bc);
  keepCloser(best, squared == squared, V(1) - t, t, squared);

  Point<V> normal = cross(ab, ac);
  V area2 = dot(normal, normal);
  V abac = dot(ab, ac);
  V second = differenceOfProducts(abac, aac, ac2, aab) / area2;
  V third = differenceOfProducts(abac, aab, ab2, aac) / area2;
  Point<V> inner = a.along(second, ab).along(third, ac);
  auto inside = both(both(second > V(0), third > V(0)),
                     second + third < V(1));
  keepCloser(best, inside, second, third, dot(inner, inner));
  return best;
}

inline Point<Floats> boxOffset(const Node &node, Point<Floats> p) {
  auto axis = [&](int i, Floats at) {
    return greatest(greatest(node.low[i] - at, at - node.high[i]), Floats(0));
  };
  return {axis(0, p.x), axis(1, p.y), axis(2, p.z)};
}

/// Finds the closest triangle. Equal distances go to the lower face.
class ClosestSearch {
public:
  ClosestSearch(const Tree &tree, Point<f32> p, f32 bound2)
      : tree(tree), p(spread(p)), best(bound2) {}

  /// A face with a smaller squared distance than the bound, or -1; `lane` of
  /// `block` is its triangle.
  i32 run(i32 root) {
    enter(root);
    while (level >= 0) {
      f32 nearest = leastOf(distances[level]);
      if (!(nearest <= best) || nearest == infinity) {
        --level;
        continue;
      }
      int child =
          lowestBit(bitsOf(distances[level] == Floats(nearest)));
      distances[level][child] = infinity;
      const Node &node = tree.nodes[path[level]];
      if (node.blocks >> child & 1)
        visit(node.blockAt(child));
      else
        enter(node.nodeAt(child));
    }
    return face;
  }

  i32 block = 0, lane = 0;

private:
  void enter(i32 index) {
    const Node &node = tree.nodes[index];
    Point<Floats> offset = boxOffset(node, p);
    path[++level] = index;
    distances[level] = choose(lanesOf(node.children()), dot(offset, offset),
                              Floats(infinity));
  }

  void visit(i32 index) {
    const TriangleBlock &triangles =
        static_cast<const TriangleBlock *>(tree.blocks)[index];
    Floats squared =
        closestOnTriangle(triangles.corner(0) - p, triangles.corner(1) - p,
                          triangles.corner(2) - p)
            .squared;
    Ints closer = (squared < best) | ((squared == best) &
                                      (triangles.id < Ints(face)));
    if (!bitsOf(closer))
      return;
    best = leastOf(choose(closer, squared, Floats(infinity)));
    Ints first = closer & (squared == Floats(best));
    face = leastOf(choose(first, triangles.id, Ints(largestInt)));
    lane = lowestBit(bitsOf(first & (triangles.id == Ints(face))));
    block = index;
  }

  const Tree &tree;
  Point<Floats> p;
  f32 best;
  i32 face = -1;
  int level = -1;
  i32 path[maxDepth];
  Floats distances[maxDepth];
};

struct ClosestPoint {
  i32 face;
  /// Weights of the first and the second corner.
  f32 u, v;
};

/// Where the closest triangle lies.
struct BlockLane {
  i32 block, lane;
};

/// The closest point within less than `maxDist` of p; face -1 if there is none.
inline ClosestPoint findClosest(const Tree &tree, Point<f32> p, f32 maxDist,
                                i32 root, BlockLane *place = nullptr) {
  ClosestPoint result{-1, 0, 0};
  if (!tree.nodes)
    return result;
  f32 bound = maxDist * tree.scale;
  Point<f32> at{p.x * tree.scale, p.y * tree.scale, p.z * tree.scale};
  // A distance below zero finds nothing; its square would. That of a tiny one
  // must not vanish.
  f32 squared = bound > 0 ? greatest(bound * bound, 1e-37f) : 0;
  ClosestSearch search(tree, at, squared);
  result.face = search.run(root);
  if (result.face < 0)
    return result;
  if (place)
    *place = {search.block, search.lane};
  const TriangleBlock &block =
      static_cast<const TriangleBlock *>(tree.blocks)[search.block];
  auto corner = [&](int i) -> Point<f64> {
    return {f64(block.vertex[i][0][search.lane]) - at.x,
            f64(block.vertex[i][1][search.lane]) - at.y,
            f64(block.vertex[i][2][search.lane]) - at.z};
  };
  OnTriangle<f64> point = closestOnTriangle(corner(0), corner(1), corner(2));
  // On the edge between the other two it is 0, but for what they are rounded.
  f64 first = 1.0 - point.second - point.third;
  result.u = first < 1e-14 ? 0 : f32(first);
  result.v = f32(point.second);
  return result;
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
          bool further =
              squared[lane] > best ||
              (squared[lane] == best && block.id[lane] < result.face);
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
