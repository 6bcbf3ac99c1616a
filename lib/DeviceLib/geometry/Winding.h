//===- Winding.h - How often a mesh goes around a point ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The winding number is the sum of the solid angles of all triangles over 4 pi;
// it says inside and outside for meshes with holes, too. Children of a node
// that are far away count as a dipole and its first derivative (Barill,
// Dickson, Schmidt, Levin, Jacobson, "Fast winding numbers for soups and
// clouds", ACM TOG 37(4), 2018), near triangles by their angle (van Oosterom,
// Strackee, IEEE TBME 30(2), 1983). A mesh without moments adds all angles.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_WINDING_H
#define WARP_DEVICELIB_GEOMETRY_WINDING_H

#include "Tree.h"

namespace warp::geometry {

/// What a node knows of its children: the center of their surface, the square
/// of the radius around it, the sum of normals times areas, and of those times
/// the offset from the center (offsets are rows).
struct Moments {
  Floats center[3], squared, normal[3], tensor[3][3];
};
static_assert(sizeof(Moments) == 512);

/// atan(y / x) in the right quadrant, for y and x that are not both 0, within
/// 1e-15: by the series after two halvings of the angle.
inline f64 angleOf(f64 y, f64 x) {
  f64 ay = __builtin_elementwise_abs(y), ax = __builtin_elementwise_abs(x);
  f64 tangent = ay < ax ? ay / ax : ax / ay;
  for (int i = 0; i < 2; ++i)
    tangent /= 1 + __builtin_elementwise_sqrt(1 + tangent * tangent);
  f64 square = tangent * tangent, sum = 0;
  for (int n = 21; n > 0; n -= 2)
    sum = 1.0 / n - square * sum;
  f64 angle = 4 * tangent * sum;
  if (!(ay < ax))
    angle = 1.5707963267948966 - angle;
  if (x < 0)
    angle = 3.141592653589793 - angle;
  return y < 0 ? -angle : angle;
}

/// The solid angle of one triangle, relative to the point.
inline f64 solidAngle(Point<f64> a, Point<f64> b, Point<f64> c) {
  f64 la = __builtin_elementwise_sqrt(dot(a, a));
  f64 lb = __builtin_elementwise_sqrt(dot(b, b));
  f64 lc = __builtin_elementwise_sqrt(dot(c, c));
  f64 volume = dot(a, cross(b, c));
  f64 below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
  // In its plane a triangle has no side; NaN counts nothing.
  if (!(volume > 0 || volume < 0))
    return 0;
  return 2 * angleOf(volume, below);
}

inline f64 solidAngles(const TriangleBlock &block, Point<f32> p) {
  f64 sum = 0;
  for (int lane = 0; lane < width; ++lane) {
    Point<f64> corner[3];
    for (int i = 0; i < 3; ++i)
      corner[i] = {block.vertex[i][0][lane] - f64(p.x),
                   block.vertex[i][1][lane] - f64(p.y),
                   block.vertex[i][2][lane] - f64(p.z)};
    sum += solidAngle(corner[0], corner[1], corner[2]);
  }
  return sum;
}

/// The solid angles of children as dipoles, and which are further away than
/// `accuracy` times their radius.
inline u32 farAngles(const Moments &m, Point<f32> p, f32 accuracy,
                     Floats &angle) {
  Point<Floats> r{m.center[0] - p.x, m.center[1] - p.y, m.center[2] - p.z};
  Floats square = dot(r, r);
  Floats inverse = Floats(1) / __builtin_elementwise_sqrt(square);
  Floats cube = inverse * inverse * inverse;
  Floats along[3] = {r.x, r.y, r.z};
  Floats dipole = Floats(0), trace = Floats(0), twice = Floats(0);
  for (int i = 0; i < 3; ++i) {
    dipole = fma(m.normal[i], along[i], dipole);
    trace += m.tensor[i][i];
    for (int j = 0; j < 3; ++j)
      twice = fma(m.tensor[i][j], along[i] * along[j], twice);
  }
  angle = cube * (dipole + trace - 3 * twice * inverse * inverse);
  return bitsOf(square > accuracy * accuracy * m.squared);
}

inline f64 windingNumber(const Tree &tree, const Moments *moments, Point<f32> p,
                         f32 accuracy) {
  if (!tree.nodes)
    return 0;
  Point<f32> at{p.x * tree.scale, p.y * tree.scale, p.z * tree.scale};
  i32 refs[maxDepth * (width - 1) + 1];
  int left = 0;
  f64 sum = 0;
  refs[left++] = 0;
  while (left) {
    i32 index = refs[--left];
    const Node &node = tree.nodes[index];
    Floats angle = Floats(0);
    u32 far = moments && accuracy < infinity
                  ? farAngles(moments[index], at, accuracy, angle)
                  : 0;
    for (u32 rest = node.children(); rest; rest &= rest - 1) {
      int child = lowestBit(rest);
      if (far >> child & 1)
        sum += f64(angle[child]);
      else if (node.nodes >> child & 1)
        refs[left++] = node.nodeAt(child);
      else
        sum += solidAngles(static_cast<const TriangleBlock *>(
                               tree.blocks)[node.blockAt(child)],
                           at);
    }
  }
  return sum * 0.07957747154594767;
}

/// -1 where the winding number exceeds the threshold, else 1. Near it the
/// number is asked for more accurately, in the end exactly.
inline f32 sideByWinding(const Tree &tree, const Moments *moments, Point<f32> p,
                         f32 accuracy, f32 threshold) {
  for (;;) {
    bool isLast = !moments || !(accuracy < 32);
    f64 found = windingNumber(tree, moments, p, isLast ? infinity : accuracy);
    if (isLast || __builtin_elementwise_abs(found - threshold) >= 0.1)
      return found > threshold ? -1 : 1;
    accuracy = accuracy > 0.5f ? 2 * accuracy : 1;
  }
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_WINDING_H
