//===- Crossings.h - Ray crossing counts of a mesh --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A ray through an edge or a corner meets several triangles, but crosses the
// surface once, or only touches it. It is counted as if it were moved off by
// an infinitely small step (Edelsbrunner, Muecke, "Simulation of simplicity",
// ACM TOG 9(1), 1990): where a corner's side of the ray is undecided, the step
// decides, the same way for all triangles at the edge.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_CROSSINGS_H
#define WARP_DEVICELIB_GEOMETRY_CROSSINGS_H

#include "Ray.h"

namespace warp::geometry {

/// On which side of the ray the sheared edge from a to b passes.
inline Ints isLeft(Floats ax, Floats ay, Floats bx, Floats by) {
  Floats side = differenceOfProducts(ax, by, ay, bx);
  Floats zero = Floats(0);
  return (side > zero) |
         ((side == zero) & ((ay > by) | ((ay == by) & (bx > ax))));
}

/// Triangles of a block that the moved ray crosses at t >= 0.
inline u32 crossTriangles(const TriangleBlock &block, const Ray &ray) {
  auto [x, y, z] = shearCorners(block, ray);
  // Both triangles of an edge have to compute the same: from its lower corner.
  auto left = [&](int a, int b) {
    Ints swap = (x[a] > x[b]) | ((x[a] == x[b]) & (y[a] > y[b]));
    Ints found = isLeft(choose(swap, x[b], x[a]), choose(swap, y[b], y[a]),
                        choose(swap, x[a], x[b]), choose(swap, y[a], y[b]));
    return found ^ swap;
  };
  Ints u = left(2, 1), v = left(0, 2), w = left(1, 0);
  Ints isCrossed = (u & v & w) | (~u & ~v & ~w);
  // A corner that is NaN has no side.
  isCrossed &= (x[0] == x[0]) & (x[1] == x[1]) & (x[2] == x[2]) &
               (y[0] == y[0]) & (y[1] == y[1]) & (y[2] == y[2]);
  Floats weights[3] = {differenceOfProducts(x[2], y[1], y[2], x[1]),
                       differenceOfProducts(x[0], y[2], y[0], x[2]),
                       differenceOfProducts(x[1], y[0], y[1], x[0])};
  Floats sum = weights[0] + weights[1] + weights[2];
  Floats t = fma(weights[0], z[0], fma(weights[1], z[1], weights[2] * z[2])) *
             ray.shearZ / sum;
  return bitsOf(isCrossed & (t >= Floats(0)));
}

inline i32 countCrossings(const Tree &tree, Point<f32> start,
                          Point<f32> direction, i32 root) {
  if (!tree.nodes || root < 0)
    return 0;
  Ray ray(tree, start, direction);
  if (!ray.isValid)
    return 0;
  i32 refs[maxDepth * (width - 1) + 1];
  int left = 0;
  i32 found = 0;
  refs[left++] = root;
  while (left) {
    const Node &node = tree.nodes[refs[--left]];
    Floats entry;
    for (u32 met = meetBoxes(node, ray, infinity, entry); met; met &= met - 1) {
      int child = lowestBit(met);
      if (node.nodes >> child & 1)
        refs[left++] = node.nodeAt(child);
      else
        found += countBits(crossTriangles(static_cast<const TriangleBlock *>(
                                              tree.blocks)[node.blockAt(child)],
                                          ray));
    }
  }
  return found;
}

/// A number in [-1, 1) that follows from a counter (the finaliser of
/// MurmurHash3, Appleby).
inline f32 scatter(u32 n) {
  n = (n + 1) * 0x9e3779b9u;
  n = (n ^ n >> 16) * 0x85ebca6bu;
  n = (n ^ n >> 13) * 0xc2b2ae35u;
  return f32(i32(n ^ n >> 16)) * 0x1p-31f;
}

/// -1 if at least half of some rays around (1, 1, 1) cross an odd number of
/// triangles, else 1.
inline f32 sideByParity(const Tree &tree, Point<f32> p, i32 rays, f32 spread) {
  i32 odd = 0;
  for (i32 i = 0; i < rays; ++i) {
    u32 n = 3 * u32(i);
    Point<f32> direction{1 + spread * scatter(n), 1 + spread * scatter(n + 1),
                         1 + spread * scatter(n + 2)};
    odd += countCrossings(tree, p, direction, 0) & 1;
  }
  return 2 * i64(odd) >= i64(rays) ? -1 : 1;
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_CROSSINGS_H
