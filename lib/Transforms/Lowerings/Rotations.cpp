//===- Rotations.cpp - Lowerings for quaternions --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Quaternions are x, y, z, w. Angles come from atan2 of the lengths of both
// parts, which is accurate near 0 and near pi alike, where acos is not.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

static Scalars conjugate(ArrayRef<Scalar> q) {
  return {-q[0], -q[1], -q[2], q[3]};
}

static Scalars scaled(ArrayRef<Scalar> v, Scalar factor) {
  return forEach(v, [&](Scalar x) { return x * factor; });
}

static Scalars added(ArrayRef<Scalar> a, ArrayRef<Scalar> b) {
  return zipWith(a, b, std::plus<>());
}

/// Hamilton's product.
Scalars multiplyQuats(ArrayRef<Scalar> a, ArrayRef<Scalar> b) {
  Scalars vector =
      added(added(scaled(b.take_front(3), a[3]), scaled(a.take_front(3), b[3])),
            cross(a.take_front(3), b.take_front(3)));
  vector.push_back(a[3] * b[3] - dot(a.take_front(3), b.take_front(3)));
  return vector;
}

/// The vector part of q v q*: (w^2 - u.u) v + 2 (u.v) u + 2 w (u x v) for the
/// vector part u of q, whatever its length.
Scalars rotate(ArrayRef<Scalar> q, ArrayRef<Scalar> v) {
  ArrayRef<Scalar> u = q.take_front(3);
  Scalar w = q[3], twice = v[0].like(2);
  Scalars along =
      added(scaled(v, w * w - dot(u, u)), scaled(u, twice * dot(u, v)));
  return added(along, scaled(cross(u, v), twice * w));
}

Scalars rotateInverse(ArrayRef<Scalar> q, ArrayRef<Scalar> v) {
  return rotate(conjugate(q), v);
}

Scalars lowerQuatRotate(Emitter &, Operands args) {
  return rotate(args[0].scalars, args[1].scalars);
}

Scalars lowerQuatRotateInv(Emitter &, Operands args) {
  return rotateInverse(args[0].scalars, args[1].scalars);
}

Scalars lowerQuatInverse(Emitter &, Operands args) {
  return conjugate(args[0].scalars);
}

//===----------------------------------------------------------------------===//
// Axis and angle
//===----------------------------------------------------------------------===//

Scalars lowerQuatFromAxisAngle(Emitter &, Operands args) {
  Scalar half = args[1][0] * 0.5;
  Scalars q = scaled(args[0].scalars, sin(half));
  q.push_back(cos(half));
  return q;
}

/// The identity has no axis; zero stands for it.
Scalars lowerQuatToAxisAngle(Emitter &, Operands args) {
  ArrayRef<Scalar> q = args[0].scalars, u = q.take_front(3);
  Scalar w = q[3];
  Scalars axis = normalize(u, Scalars(3, w.like(0)));
  // q and -q are the same rotation; the one with w >= 0 turns by at most pi.
  axis = forEach(axis, [&](Scalar x) { return select(w < 0, -x, x); });
  axis.push_back(2.0 * atan2(length(u), abs(w)));
  return axis;
}

/// Product of the rotations about z, y and x.
Scalars lowerQuatRpy(Emitter &, Operands args) {
  Scalar c[3], s[3];
  for (int i = 0; i < 3; ++i) {
    Scalar half = args[i][0] * 0.5;
    c[i] = cos(half);
    s[i] = sin(half);
  }
  return {s[0] * c[1] * c[2] - c[0] * s[1] * s[2],
          c[0] * s[1] * c[2] + s[0] * c[1] * s[2],
          c[0] * c[1] * s[2] - s[0] * s[1] * c[2],
          c[0] * c[1] * c[2] + s[0] * s[1] * s[2]};
}

//===----------------------------------------------------------------------===//
// Matrices
//===----------------------------------------------------------------------===//

/// The matrix of what `rotate` does.
Scalars lowerQuatToMatrix(Emitter &, Operands args) {
  ArrayRef<Scalar> q = args[0].scalars;
  Scalar square = dot(q, q);
  Scalar x2 = q[0] + q[0], y2 = q[1] + q[1], z2 = q[2] + q[2];
  Scalar xx = q[0] * x2, yy = q[1] * y2, zz = q[2] * z2;
  Scalar xy = q[0] * y2, xz = q[0] * z2, yz = q[1] * z2;
  Scalar wx = q[3] * x2, wy = q[3] * y2, wz = q[3] * z2;
  return {square - (yy + zz), xy - wz, xz + wy, xy + wz,
          square - (xx + zz), yz - wx, xz - wy, yz + wx,
          square - (xx + yy)};
}

/// Shepperd's method: the component of largest magnitude is found first and
/// the others divided by it. Each row of the symmetric matrix 4 q q^T is a
/// multiple of q; the one with the largest diagonal entry is normalised.
Scalars lowerQuatFromMatrix(Emitter &, Operands args) {
  const Parts &m = args[0];
  Scalar xy = m(1, 0) + m(0, 1), xz = m(2, 0) + m(0, 2);
  Scalar yz = m(2, 1) + m(1, 2), wx = m(2, 1) - m(1, 2);
  Scalar wy = m(0, 2) - m(2, 0), wz = m(1, 0) - m(0, 1);
  Scalar a = m(0, 0), b = m(1, 1), c = m(2, 2);
  Scalars rows[4] = {{1.0 + a - b - c, xy, xz, wx},
                     {xy, 1.0 - a + b - c, yz, wy},
                     {xz, yz, 1.0 - a - b + c, wz},
                     {wx, wy, wz, 1.0 + a + b + c}};
  Scalars row = rows[3];
  Scalar largest = row[3];
  for (int i = 0; i < 3; ++i) {
    Scalar better = rows[i][i] > largest;
    largest = select(better, rows[i][i], largest);
    row = zipWith(rows[i], row,
                  [&](Scalar x, Scalar y) { return select(better, x, y); });
  }
  // Chooses between q and -q: the real part is not negative where the angle is
  // at most 120 degrees, elsewhere the largest part is positive.
  Scalar flip = (row[3] < 0) & (a + b + c >= 0);
  row = forEach(row, [&](Scalar x) { return select(flip, -x, x); });
  Scalars identity(4, a.like(0));
  identity[3] = a.like(1);
  return normalize(row, identity);
}

//===----------------------------------------------------------------------===//
// Interpolation
//===----------------------------------------------------------------------===//

/// The angle of the arc is that between a and b as vectors. Where the arc is
/// so short that its sine loses digits, straight interpolation is exact.
Scalars lowerQuatSlerp(Emitter &, Operands args) {
  ArrayRef<Scalar> a = args[0].scalars;
  Scalar t = args[2][0];
  Scalar isFar = dot(a, args[1].scalars) < 0;
  Scalars b =
      forEach(args[1].scalars, [&](Scalar x) { return select(isFar, -x, x); });
  Scalars difference = zipWith(b, a, std::minus<>());
  // atan2(|b - a|, |b + a|) is half the angle.
  Scalar angle = 2.0 * atan2(length(difference), length(added(a, b)));
  Scalar isShort = angle < std::sqrt(FloatFormat(t.type).getEpsilon());
  Scalar sine = sin(select(isShort, t.like(1), angle));
  Scalar weightA = select(isShort, 1.0 - t, sin((1.0 - t) * angle) / sine);
  Scalar weightB = select(isShort, t, sin(t * angle) / sine);
  return added(scaled(a, weightA), scaled(b, weightB));
}

} // namespace warp::lowering
