//===- ScalarMath.cpp - Lowerings of scalar functions ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

static Scalar clamp(Scalar x, Scalar low, Scalar high) {
  return min(max(x, low), high);
}

/// A NaN stays one: it is unordered with both bounds.
static Scalar clampToUnit(Scalar x) {
  Scalar one = x.like(1), minusOne = x.like(-1);
  return select(x > one, one, select(x < minusOne, minusOne, x));
}

Scalars lowerAsin(Emitter &, Operands args) {
  return {asin(clampToUnit(args[0][0]))};
}

Scalars lowerAcos(Emitter &, Operands args) {
  return {acos(clampToUnit(args[0][0]))};
}

Scalars lowerDegrees(Emitter &, Operands args) {
  return {args[0][0] * 57.295779513082320877};
}

Scalars lowerRadians(Emitter &, Operands args) {
  return {args[0][0] * 0.017453292519943295769};
}

Scalars lowerFrac(Emitter &, Operands args) {
  return {args[0][0] - trunc(args[0][0])};
}

Scalars lowerAbs(Emitter &, Operands args) {
  return forEach(args[0].scalars, [](Scalar x) { return abs(x); });
}

Scalars lowerSign(Emitter &, Operands args) {
  return forEach(args[0].scalars,
                 [](Scalar x) { return select(x < 0, x.like(-1), x.like(1)); });
}

Scalars lowerStep(Emitter &, Operands args) {
  Scalar x = args[0][0];
  return {select(x < 0, x.like(1), x.like(0))};
}

Scalars lowerNonzero(Emitter &, Operands args) {
  Scalar x = args[0][0];
  return {select(x == 0, x.like(0), x.like(1))};
}

//===----------------------------------------------------------------------===//
// Smallest and largest
//===----------------------------------------------------------------------===//

static Scalars extremum(Operands args, Scalar (*better)(Scalar, Scalar)) {
  if (args.size() == 2)
    return zipWith(args[0].scalars, args[1].scalars, better);
  Scalar best = args[0][0];
  for (Scalar x : args[0].scalars.drop_front())
    best = better(best, x);
  return {best};
}

Scalars lowerMin(Emitter &, Operands args) { return extremum(args, min); }
Scalars lowerMax(Emitter &, Operands args) { return extremum(args, max); }

Scalars lowerClamp(Emitter &, Operands args) {
  return {clamp(args[0][0], args[1][0], args[2][0])};
}

//===----------------------------------------------------------------------===//
// Interpolation
//===----------------------------------------------------------------------===//

Scalars lowerLerp(Emitter &, Operands args) {
  Scalar t = args[2][0], rest = 1.0 - t;
  return zipWith(args[0].scalars, args[1].scalars,
                 [&](Scalar a, Scalar b) { return a * rest + b * t; });
}

Scalars lowerSmoothstep(Emitter &, Operands args) {
  Scalar a = args[0][0], b = args[1][0], x = args[2][0];
  // From the nearer end, so that slopes near it have all their digits.
  auto rise = [&](Scalar part) {
    Scalar t = clamp(part / (b - a), a.like(0), a.like(1));
    return std::pair(t, t * t * (3.0 - 2.0 * t));
  };
  auto [t, fromA] = rise(x - a);
  auto [u, fromB] = rise(b - x);
  return {select(u < t, 1.0 - fromB, fromA)};
}

//===----------------------------------------------------------------------===//
// Bits and classes
//===----------------------------------------------------------------------===//

Scalars lowerBitCount(Emitter &emitter, Operands args) {
  Scalar x = args[0][0];
  // The count is not negative, whatever the sign of the operand's type.
  Scalar count = reinterpret(popcount(x), getBitsType(x.type));
  return {convert(count, emitter.builder.getIntegerType(32, true))};
}

Scalars lowerIsFinite(Emitter &, Operands args) {
  Scalars each = forEach(args[0].scalars, isFinite);
  Scalar all = each[0];
  for (Scalar one : llvm::drop_begin(each))
    all = all & one;
  return {all};
}

static Scalars any(Operands args, Scalar (*test)(Scalar)) {
  Scalars each = forEach(args[0].scalars, test);
  Scalar any = each[0];
  for (Scalar one : llvm::drop_begin(each))
    any = any | one;
  return {any};
}

Scalars lowerIsNan(Emitter &, Operands args) { return any(args, isNan); }
Scalars lowerIsInf(Emitter &, Operands args) { return any(args, isInf); }

} // namespace warp::lowering
