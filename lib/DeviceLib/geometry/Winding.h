//===- Winding.h - Generalised winding numbers ------------------*- C++ -*-===//
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

/// A node's record of its children: the center of their surface, the square
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

/// A sum of angles as the direction of a product of complex numbers, so that
/// there is one arc tangent in all, and how often the sum went around.
class AngleSum {
public:
  /// Adds the angle of x + iy, of which both are at most about 4.
  void add(f64 x, f64 y) {
    f64 before = im;
    f64 product = differenceOfProducts(re, x, im, y);
    im = fma(re, y, im * x);
    re = product;
    turns += before >= 0 && y > 0 && im < 0;
    turns -= before < 0 && y < 0 && im >= 0;
  }
  /// Called after a few additions, so that the product stays a number.
  void normalize() {
    f64 inverse =
        1 / (__builtin_elementwise_abs(re) + __builtin_elementwise_abs(im));
    re *= inverse;
    im *= inverse;
  }
  f64 total() const { return angleOf(im, re) + 6.283185307179586 * turns; }

private:
  f64 re = 1, im = 0;
  i32 turns = 0;
};

/// Complex numbers whose angles are halves of the solid angles of triangles;
/// their imaginary part is neither below nor above 0 where there is no side.
template <class V> struct HalfAngles {
  V re, im;

  /// Corners relative to the point.
  HalfAngles(Point<V> a, Point<V> b, Point<V> c) {
    V la = __builtin_elementwise_sqrt(dot(a, a));
    V lb = __builtin_elementwise_sqrt(dot(b, b));
    V lc = __builtin_elementwise_sqrt(dot(c, c));
    V inverse = V(1) / (la * lb * lc);
    im = dot(a, cross(b, c)) * inverse;
    re = fma(dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb, inverse, V(1));
  }
};

inline void widen(Floats x, int lane, f64 &wide) { wide = x[lane]; }
inline void widen(Floats x, int, Doubles &wide) {
  wide = __builtin_convertvector(x, Doubles);
}

/// The values of one triangle of a block, or of all.
template <class V>
HalfAngles<V> halfAngles(const TriangleBlock &block, Point<f32> p, int lane) {
  auto offset = [&](int corner) {
    Point<V> at;
    widen(block.vertex[corner][0], lane, at.x);
    widen(block.vertex[corner][1], lane, at.y);
    widen(block.vertex[corner][2], lane, at.z);
    return at - Point<V>{V(p.x), V(p.y), V(p.z)};
  };
  return {offset(0), offset(1), offset(2)};
}

inline void addAngles(const TriangleBlock &block, Point<f32> p, AngleSum &sum) {
#ifndef WARP_GPU
  HalfAngles<Doubles> all = halfAngles<Doubles>(block, p, 0);
#endif
  for (int lane = 0; lane < width; ++lane) {
#ifdef WARP_GPU
    auto [re, im] = halfAngles<f64>(block, p, lane);
#else
    f64 re = all.re[lane], im = all.im[lane];
#endif
    // In its plane a triangle has no side; NaN counts nothing.
    if (im > 0 || im < 0)
      sum.add(re, im);
  }
  sum.normalize();
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
  AngleSum halves;
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
        addAngles(static_cast<const TriangleBlock *>(
                      tree.blocks)[node.blockAt(child)],
                  at, halves);
    }
  }
  return (sum + 2 * halves.total()) * 0.07957747154594767;
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
