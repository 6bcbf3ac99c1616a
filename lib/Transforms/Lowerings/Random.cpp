//===- Random.cpp - Lowerings for random numbers --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The state is advanced by PCG-RXS-M-XS on 32 bits (O'Neill, "PCG", HMC-CS-
// 2014-0905; as a hash: Jarzynski and Olano, JCGT 9(3), 2020). Sequences are
// those of the peer, bit by bit, so the order and the rounding of each float
// operation below is part of the definition.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"
#include "Pcg.h"

#include "mlir/Dialect/Math/IR/Math.h"

using namespace mlir;

namespace warp::lowering {

static Scalar advance(Scalar state) {
  Emitter &e = *state.emitter;
  auto number = [&](uint32_t bits) { return e.integer(state.type, bits); };
  Scalar next = state * number(pcg::multiplier) + number(pcg::increment);
  Scalar shift =
      shiftRightLogical(next, pcg::topShift) + number(pcg::leastShift);
  Scalar word =
      (shiftRightLogical(next, shift) ^ next) * number(pcg::mixer);
  return shiftRightLogical(word, pcg::lastShift) ^ word;
}

/// The upper 24 bits as a fraction, which is exact.
static Scalar toUnit(Scalar state) {
  Type single = state.emitter->builder.getF32Type();
  return convert(shiftRightLogical(state, 8), single) * 0x1p-24;
}

Scalars lowerRandInit(Emitter &emitter, Operands args) {
  Type type = emitter.builder.getIntegerType(32, false);
  Scalar state = convert(args[0][0], type);
  if (args.size() == 2)
    state = state + advance(convert(args[1][0], type));
  return {advance(state)};
}

/// Results are the number and the new state.
static Scalars randomInteger(Operands args, Type type) {
  Scalar state = advance(args[0][0]);
  if (args.size() == 1)
    return {convert(state, type), state};
  Scalar low = convert(args[1][0], state.type);
  Scalar high = convert(args[2][0], state.type);
  return {convert(state % (high - low) + low, type), state};
}

Scalars lowerRandi(Emitter &emitter, Operands args) {
  return randomInteger(args, emitter.builder.getIntegerType(32, true));
}

Scalars lowerRandu(Emitter &emitter, Operands args) {
  return randomInteger(args, emitter.builder.getIntegerType(32, false));
}

Scalars lowerRandf(Emitter &, Operands args) {
  Scalar state = advance(args[0][0]);
  Scalar unit = toUnit(state);
  if (args.size() == 1)
    return {unit, state};
  Scalar low = args[1][0], high = args[2][0];
  return {exactly((high - low) * unit) + low, state};
}

/// Box and Muller's method. The small number keeps the logarithm finite.
Scalars lowerRandn(Emitter &, Operands args) {
  Scalar first = advance(args[0][0]), second = advance(first);
  Scalar radius = sqrt(-2.0 * log(toUnit(first) + 5.96e-8));
  Scalar angle = static_cast<double>(2 * 3.14159265f) * toUnit(second);
  Scalar normal = radius * cos(angle);
  if (args.size() == 1)
    return {normal, second};
  return {args[1][0] + exactly(args[2][0] * normal), second};
}

//===----------------------------------------------------------------------===//
// Points, uniformly distributed; results are the components and the new state
//===----------------------------------------------------------------------===//

static Scalar drawUnit(Scalar &state) {
  state = advance(state);
  return toUnit(state);
}

static Scalar drawAngle(Scalar &state) {
  return exactly(static_cast<double>(2 * 3.14159265f) * drawUnit(state));
}

static Scalars pointOnDisk(Scalar state, bool inside) {
  std::optional<Scalar> radius;
  if (inside)
    radius = sqrt(drawUnit(state));
  Scalar angle = drawAngle(state);
  Scalar x = cos(angle), y = sin(angle);
  if (!radius)
    return {x, y, state};
  return {*radius * x, *radius * y, state};
}

/// The cosine of the polar angle is uniform in [1 - height, 1].
static Scalars pointOnSphere(Scalar state, double height, bool inside) {
  Scalar polar = acos(1.0 - height * drawUnit(state));
  Scalar angle = drawAngle(state);
  Scalar x = cos(angle), y = sin(angle), z = cos(polar);
  if (inside) {
    Scalar draw = drawUnit(state);
    Emitter &e = *draw.emitter;
    Scalar third = draw.like(static_cast<double>(1.0f / 3.0f));
    Scalar radius = {&e, e.create<math::PowFOp>(draw.value, third.value),
                     draw.type};
    x = radius * x, y = radius * y, z = radius * z;
  }
  return {x * sin(polar), y * sin(polar), z, state};
}

Scalars pointInCube(Scalar state, unsigned dimensions) {
  Scalars result;
  for (unsigned i = 0; i < dimensions; ++i)
    result.push_back(drawUnit(state) - 0.5);
  result.push_back(state);
  return result;
}

Scalars lowerSampleUnitRing(Emitter &, Operands args) {
  return pointOnDisk(args[0][0], false);
}

Scalars lowerSampleUnitDisk(Emitter &, Operands args) {
  return pointOnDisk(args[0][0], true);
}

Scalars lowerSampleUnitSquare(Emitter &, Operands args) {
  return pointInCube(args[0][0], 2);
}

Scalars lowerSampleUnitCube(Emitter &, Operands args) {
  return pointInCube(args[0][0], 3);
}

Scalars lowerSampleUnitSphereSurface(Emitter &, Operands args) {
  return pointOnSphere(args[0][0], 2.0, false);
}

Scalars lowerSampleUnitSphere(Emitter &, Operands args) {
  return pointOnSphere(args[0][0], 2.0, true);
}

Scalars lowerSampleUnitHemisphereSurface(Emitter &, Operands args) {
  return pointOnSphere(args[0][0], 1.0, false);
}

Scalars lowerSampleUnitHemisphere(Emitter &, Operands args) {
  return pointOnSphere(args[0][0], 1.0, true);
}

/// Barycentric coordinates of the first two corners.
Scalars lowerSampleTriangle(Emitter &, Operands args) {
  Scalar state = args[0][0];
  Scalar root = sqrt(drawUnit(state));
  Scalar second = drawUnit(state) * root;
  return {1.0 - root, second, state};
}

} // namespace warp::lowering
