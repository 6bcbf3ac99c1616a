//===- Jacobi.cpp - Rotations and bases that decompositions share ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Decompositions.h"

using namespace mlir;

namespace warp::lowering {

//===----------------------------------------------------------------------===//
// Matrices
//===----------------------------------------------------------------------===//

Columns getColumns(ArrayRef<Scalar> m) {
  return {Scalars{m[0], m[3], m[6]}, Scalars{m[1], m[4], m[7]},
          Scalars{m[2], m[5], m[8]}};
}

Scalars getRowMajor(const Columns &columns) {
  Scalars entries;
  for (int row = 0; row < 3; ++row)
    for (const Scalars &column : columns)
      entries.push_back(column[row]);
  return entries;
}

Scalars multiplyDiagonal(const Columns &u, ArrayRef<Scalar> d,
                         const Columns &v) {
  Scalars entries;
  for (int row = 0; row < 3; ++row)
    for (int col = 0; col < 3; ++col) {
      // Products in the same order on both sides of the diagonal.
      Scalar sum = d[2] * (u[2][row] * v[2][col]);
      for (int k : {1, 0})
        sum = fma(d[k], u[k][row] * v[k][col], sum);
      entries.push_back(sum);
    }
  return entries;
}

Scaled scaleToUnit(ArrayRef<Scalar> numbers) {
  Scalar largest = abs(numbers[0]);
  for (Scalar x : numbers.drop_front())
    largest = max(largest, abs(x));
  FloatFormat format(largest.type);
  auto bitsType = getBitsType(largest.type);
  auto exponent = [&](uint64_t bits) {
    return largest.emitter->integer(bitsType, bits << format.mantissaBits);
  };
  // 2^k has the exponent bits k + bias. Both factors are normal numbers.
  Scalar own = reinterpret(largest, bitsType) & exponent(2 * format.bias + 1);
  own = max(exponent(1), min(own, exponent(2 * format.bias - 1)));
  Scalar scale = reinterpret(exponent(2 * format.bias) - own, largest.type);
  return {forEach(numbers, [&](Scalar x) { return x * scale; }), scale,
          reinterpret(own, largest.type)};
}

//===----------------------------------------------------------------------===//
// Bases
//===----------------------------------------------------------------------===//

static Scalars selectVector(Scalar condition, ArrayRef<Scalar> a,
                            ArrayRef<Scalar> b) {
  return zipWith(a, b,
                 [&](Scalar x, Scalar y) { return select(condition, x, y); });
}

static Scalars divide(ArrayRef<Scalar> v, Scalar by) {
  return forEach(v, [&](Scalar x) { return x / by; });
}

/// A unit vector at right angles to a unit vector (Duff et al., "Building an
/// Orthonormal Basis, Revisited", JCGT 6(1), 2017).
static Scalars getPerpendicular(ArrayRef<Scalar> n) {
  Scalar sign = copysign(n[0].like(1), n[2]);
  Scalar ratio = n[1] / (sign + n[2]);
  return {-(n[0] * ratio), sign - n[1] * ratio, -n[1]};
}

/// The part of `v` at right angles to a unit vector.
static Scalars reject(ArrayRef<Scalar> v, ArrayRef<Scalar> unit) {
  Scalar along = dot(v, unit);
  return zipWith(v, unit,
                 [&](Scalar x, Scalar y) { return fma(-along, y, x); });
}

Scalars getUnit(ArrayRef<Scalar> v) {
  Scalars axis(v.size(), v[0].like(0));
  axis[0] = v[0].like(1);
  Scalars scaled = scaleToUnit(v).scalars;
  Scalar squares = dot(scaled, scaled);
  return selectVector(squares == 0, axis, divide(scaled, sqrt(squares)));
}

Columns getBasis(ArrayRef<Scalar> a, ArrayRef<Scalar> b) {
  Scalars first = getUnit(a);
  // Two steps leave what is at right angles, unless that is nothing but the
  // rounding error of the first one.
  Scalars across = scaleToUnit(b).scalars;
  Scalars rest = reject(reject(across, first), first);
  double roundoff = FloatFormat(a[0].type).getEpsilon();
  Scalar isLost =
      dot(rest, rest) <= dot(across, across) * (roundoff * roundoff);
  Scalars second = selectVector(isLost, getPerpendicular(first),
                                divide(rest, sqrt(dot(rest, rest))));
  return {first, second, cross(first, second)};
}

//===----------------------------------------------------------------------===//
// Rotations
//===----------------------------------------------------------------------===//

JacobiRotation::JacobiRotation(Scalar p, Scalar q, Scalar other) {
  Scalar difference = q - p, twice = other + other;
  Scalar root = sqrt(fma(difference, difference, twice * twice));
  Scalar sum = difference + copysign(root, difference);
  tangent = select(sum == 0, p.like(0), twice / sum);
  Scalar cosine = 1.0 / sqrt(fma(tangent, tangent, p.like(1)));
  sine = tangent * cosine;
  halfTangent = sine / (1.0 + cosine);
}

void JacobiRotation::apply(Scalar &p, Scalar &q) const {
  Scalar toP = fma(halfTangent, p, q), toQ = fma(-halfTangent, q, p);
  p = fma(-sine, toP, p);
  q = fma(sine, toQ, q);
}

void JacobiRotation::apply(Scalars &p, Scalars &q) const {
  for (size_t i = 0; i < p.size(); ++i)
    apply(p[i], q[i]);
}

void exchange(Scalar condition, Scalars &p, Scalars &q) {
  for (size_t i = 0; i < p.size(); ++i) {
    Scalar x = p[i], y = q[i];
    p[i] = select(condition, y, x);
    q[i] = select(condition, -x, y);
  }
}

} // namespace warp::lowering
