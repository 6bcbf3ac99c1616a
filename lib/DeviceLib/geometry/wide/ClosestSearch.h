//===- ClosestSearch.h - 8-wide closest-point traversal ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// For processors whose registers hold eight floats. A level of the tree keeps
// the distances of the children that are left.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_WIDE_CLOSESTSEARCH_H
#define WARP_DEVICELIB_GEOMETRY_WIDE_CLOSESTSEARCH_H

#include "../Closest.h"

namespace warp::geometry::wide {

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
      int child = lowestBit(bitsOf(distances[level] == Floats(nearest)));
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
    distances[level] =
        choose(lanesOf(node.children()), dot(offset, offset), Floats(infinity));
  }

  Floats squaresOf(const TriangleBlock &triangles, Ints &isThin) const {
    return closestOnTriangle(triangles.corner(0) - p, triangles.corner(1) - p,
                             triangles.corner(2) - p,
                             [&](const Plane<Floats> &plane) {
                               isThin = plane.isThin();
                               return plane.byLengths();
                             })
        .squared;
  }
  /// The same where some are thin. Not a part of the search, which would keep
  /// registers for what most blocks do not need.
  __attribute__((noinline, cold)) static Floats
  squaresOfThin(const TriangleBlock &triangles, f32 x, f32 y, f32 z) {
    Point<Floats> p{Floats(x), Floats(y), Floats(z)};
    return closestOnTriangle(triangles.corner(0) - p, triangles.corner(1) - p,
                             triangles.corner(2) - p)
        .squared;
  }

  void visit(i32 index) {
    const TriangleBlock &triangles =
        static_cast<const TriangleBlock *>(tree.blocks)[index];
    Ints isThin;
    Floats squared = squaresOf(triangles, isThin);
    if (isAny(isThin))
      squared = squaresOfThin(triangles, p.x[0], p.y[0], p.z[0]);
    Ints closer =
        (squared < best) | ((squared == best) & (triangles.id < Ints(face)));
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

} // namespace warp::geometry::wide

#endif // WARP_DEVICELIB_GEOMETRY_WIDE_CLOSESTSEARCH_H
