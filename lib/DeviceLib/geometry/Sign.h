//===- Sign.h - Inside-outside tests of meshes ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// By rays: most of three rays along the axes say it by the side of the first
// triangle that they meet. By normals: the closest point of a mesh is within a
// face, on an edge or at a corner, and there the normals of the faces that
// meet, weighted by angles, have one sign for each side (Baerentzen, Aanaes,
// "Signed distance computation using the angle weighted pseudonormal", IEEE
// TVCG 11(3), 2005). Faces meet where their corners have the same place, so
// soups of triangles need no topology.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SIGN_H
#define WARP_DEVICELIB_GEOMETRY_SIGN_H

#include "Overlap.h"
#include "Search.h"

namespace warp::geometry {

/// -1 for a point inside of a mesh, else 1.
inline f32 sideByRays(const Tree &tree, Point<f32> p) {
  int inside = 0;
  if (!tree.nodes)
    return 1;
  for (int axis = 0; axis < 3; ++axis) {
    Ray ray(tree, p, {f32(axis == 0), f32(axis == 1), f32(axis == 2)});
    RaySearch search(tree, ray, infinity, false);
    if (search.run(0).face >= 0 && search.leavesThroughFront())
      ++inside;
  }
  return inside >= 2 ? -1 : 1;
}

inline f64 length(Point<f64> v) {
  return __builtin_elementwise_sqrt(dot(v, v));
}

/// The angle between two vectors, in units of a quarter turn to within 1e-5
/// (Abramowitz, Stegun, 4.4.47, of the half angle).
inline f64 angleBetween(Point<f64> a, Point<f64> b) {
  f64 la = length(a), lb = length(b);
  if (!(la > 0 && lb > 0))
    return 0;
  Point<f64> sum{a.x / la + b.x / lb, a.y / la + b.y / lb, a.z / la + b.z / lb};
  Point<f64> difference{a.x / la - b.x / lb, a.y / la - b.y / lb,
                        a.z / la - b.z / lb};
  f64 opposite = length(difference), adjacent = length(sum);
  bool isSteep = opposite > adjacent;
  f64 x = isSteep ? adjacent / opposite : opposite / adjacent;
  f64 s = x * x;
  f64 arc = x * (0.9998660 +
                 s * (-0.3302995 +
                      s * (0.1801410 + s * (-0.0851330 + s * 0.0208351))));
  f64 half = isSteep ? 1.5707963267948966 - arc : arc;
  return half * (2 / 1.5707963267948966);
}

/// Sums the normals of the faces at a corner or an edge.
class NormalSum {
public:
  /// Places within `tolerance` of each other are one.
  NormalSum(const Tree &tree, f64 tolerance)
      : tree(tree), tolerance(tolerance) {}

  /// For all faces with a corner at a, and another one at b if it is not null.
  Point<f64> around(Point<f64> a, const Point<f64> *b) const {
    Point<f64> sum{0, 0, 0};
    auto near = f32(tolerance);
    // The box has to have the corner in it after rounding.
    BoxShape box{{f32(a.x) - near, f32(a.y) - near, f32(a.z) - near},
                 {f32(a.x) + near, f32(a.y) + near, f32(a.z) + near}};
    Cursor cursor{0, -1, 0, 0, 0, 0};
    while (nextOverlap<TriangleBlock>(tree, box, cursor) >= 0)
      add(sum, cursor, a, b);
    return sum;
  }

private:
  void add(Point<f64> &sum, const Cursor &cursor, Point<f64> a,
           const Point<f64> *b) const {
    const TriangleBlock &block =
        static_cast<const TriangleBlock *>(tree.blocks)[cursor.block];
    int lane = cursor.lane;
    Point<f64> corners[3];
    for (int i = 0; i < 3; ++i)
      corners[i] = {block.vertex[i][0][lane], block.vertex[i][1][lane],
                    block.vertex[i][2][lane]};
    Point<f64> normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
    f64 size = length(normal);
    if (!(size > 0))
      return;
    f64 weight = 0;
    bool hasB = !b;
    for (int i = 0; i < 3; ++i) {
      const Point<f64> &next = corners[(i + 1) % 3];
      const Point<f64> &last = corners[(i + 2) % 3];
      if (isOne(corners[i], a))
        weight += b ? 1 : angleBetween(next - corners[i], last - corners[i]);
      hasB |= b && isOne(corners[i], *b);
    }
    if (!hasB)
      return;
    weight /= size;
    sum = {fma(weight, normal.x, sum.x), fma(weight, normal.y, sum.y),
           fma(weight, normal.z, sum.z)};
  }
  bool isOne(Point<f64> a, Point<f64> b) const {
    Point<f64> offset = a - b;
    return dot(offset, offset) <= tolerance * tolerance;
  }

  const Tree &tree;
  f64 tolerance;
};

/// The side by normals at the point (u, v) of a face; `epsilon` of its longest
/// edge is where corners are one. 1 in front and on the surface, -1 behind.
inline f32 sideByNormal(const Tree &tree, Point<f32> p, const ClosestPoint &at,
                        const TriangleBlock &block, int lane, f32 epsilon) {
  Point<f64> corners[3];
  for (int i = 0; i < 3; ++i)
    corners[i] = {block.vertex[i][0][lane], block.vertex[i][1][lane],
                  block.vertex[i][2][lane]};
  f64 weights[3] = {at.u, at.v, 1.0 - f64(at.u) - f64(at.v)};
  Point<f64> foot{0, 0, 0};
  int zeros = 0, zero = 0, largest = 0;
  f64 longest = 0;
  for (int i = 0; i < 3; ++i) {
    foot = foot.along(weights[i], corners[i]);
    // Weights are floats: what is not one is at most its rounding.
    if (!(weights[i] > 1e-7)) {
      ++zeros;
      zero = i;
    }
    if (weights[i] > weights[largest])
      largest = i;
    f64 edge = length(corners[(i + 1) % 3] - corners[i]);
    longest = greatest(longest, edge);
  }
  NormalSum normals(tree, longest * epsilon);
  Point<f64> normal;
  if (zeros == 0)
    normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
  else if (zeros == 1)
    normal = normals.around(corners[(zero + 1) % 3], &corners[(zero + 2) % 3]);
  else
    normal = normals.around(corners[largest], nullptr);
  Point<f64> offset{p.x * f64(tree.scale) - foot.x,
                    p.y * f64(tree.scale) - foot.y,
                    p.z * f64(tree.scale) - foot.z};
  return dot(offset, normal) < 0 ? -1 : 1;
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_SIGN_H
