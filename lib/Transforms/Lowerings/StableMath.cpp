//===- StableMath.cpp - Lowerings that avoid cancellation and overflow ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions that a program could write with others, but then only for part of
// their domain: the plain formula overflows, cancels or divides zero by zero.
//
//===----------------------------------------------------------------------===//

#include "Decompositions.h"
#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

//===----------------------------------------------------------------------===//
// Scalars
//===----------------------------------------------------------------------===//

Scalars lowerHypot(Emitter &, Operands args) {
  return {length({args[0][0], args[1][0]})};
}

Scalars lowerSoftplus(Emitter &, Operands args) {
  Scalar x = args[0][0];
  return {select(isNan(x), x, max(x, x.like(0)) + log1p(exp(-abs(x))))};
}

Scalars lowerSinc(Emitter &, Operands args) {
  Scalar x = args[0][0];
  return {select(x == 0, x.like(1), sin(x) / x)};
}

/// The largest term is taken out: its share of the sum is 1, that of the others
/// goes to log1p.
Scalars lowerLogsumexp(Emitter &, Operands args) {
  ArrayRef<Scalar> x = args[0].scalars;
  // The first of those that are equal: it alone is taken out below, and so it
  // has the derivative by the largest.
  Scalar largest = x[0];
  for (Scalar y : x.drop_front())
    largest = select(y > largest, y, largest);
  Scalar others = largest.like(0), isTaken = x[0] == largest;
  for (auto [i, y] : llvm::enumerate(x)) {
    Scalar isLargest = y == largest;
    Scalar isFirst = i ? isLargest & ~isTaken : isLargest;
    isTaken = isTaken | isLargest;
    others = others + select(isFirst, y.like(0), exp(y - largest));
  }
  // An infinite term minus itself is NaN where it decides the sum.
  return {select(isInf(largest), largest, largest + log1p(others))};
}

//===----------------------------------------------------------------------===//
// Vectors and rotations
//===----------------------------------------------------------------------===//

/// |a x b| without cancellation where a and b are almost parallel.
static Scalar crossLength(ArrayRef<Scalar> a, ArrayRef<Scalar> b) {
  if (a.size() == 1)
    return a[0].like(0);
  Scalars parts;
  for (size_t i = 0; i < a.size(); ++i)
    for (size_t j = i + 1; j < a.size(); ++j)
      parts.push_back(differenceOfProducts(a[i], b[j], a[j], b[i]));
  return length(parts);
}

Scalars lowerAngleBetween(Emitter &, Operands args) {
  Scalars a = scaleToUnit(args[0].scalars).scalars;
  Scalars b = scaleToUnit(args[1].scalars).scalars;
  // Added to -0, 0 makes 0, so that the angle with the zero vector is 0.
  return {atan2(crossLength(a, b), dot(a, b) + 0.0)};
}

/// Below this, x and its sine or tangent are the same to the last digit.
static double getTinyAngle(Scalar x) {
  return std::sqrt(FloatFormat(x.type).getEpsilon() / 2);
}

Scalars lowerQuatLog(Emitter &, Operands args) {
  ArrayRef<Scalar> q = args[0].scalars, u = q.take_front(3);
  Scalar sine = length(u), cosine = abs(q[3]);
  Scalar isTiny = sine <= getTinyAngle(sine) * cosine;
  Scalar isZero = (sine == 0) & (cosine == 0);
  Scalar factor =
      select(isTiny, 1.0 / cosine,
             atan2(sine, cosine) / select(isTiny, sine.like(1), sine));
  // q and -q are the same rotation.
  factor = copysign(factor + factor, q[3]);
  return forEach(u, [&](Scalar x) {
    return select(isZero, x.like(0), x * factor);
  });
}

Scalars lowerQuatExp(Emitter &, Operands args) {
  ArrayRef<Scalar> v = args[0].scalars;
  Scalar angle = length(v), half = 0.5 * angle;
  Scalar isTiny = angle <= getTinyAngle(angle);
  Scalar factor = select(isTiny, angle.like(0.5),
                         sin(half) / select(isTiny, angle.like(1), angle));
  Scalars q = forEach(v, [&](Scalar x) { return x * factor; });
  q.push_back(cos(half));
  return q;
}

} // namespace warp::lowering
