//===- Norms.cpp - Lowerings for norms and losses of vectors --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

Scalars lowerNormL1(Emitter &, Operands args) {
  Scalar sum = abs(args[0][0]);
  for (Scalar x : args[0].scalars.drop_front())
    sum = sum + abs(x);
  return {sum};
}

Scalars lowerNormL2(Emitter &, Operands args) {
  return {length(args[0].scalars)};
}

Scalars lowerNormHuber(Emitter &, Operands args) {
  Scalar norm = length(args[0].scalars), delta = args[1][0];
  return {select(norm <= delta, 0.5 * norm * norm,
                 delta * (norm - 0.5 * delta))};
}

/// The hypotenuse of delta and the length, which can't overflow on the way.
static Scalar pseudoHuber(ArrayRef<Scalar> v, Scalar delta) {
  Scalars all(v);
  all.push_back(delta);
  return select(delta < 0, -length(all), length(all));
}

Scalars lowerNormPseudoHuber(Emitter &, Operands args) {
  return {pseudoHuber(args[0].scalars, args[1][0])};
}

Scalars lowerSmoothNormalize(Emitter &, Operands args) {
  Scalar norm = pseudoHuber(args[0].scalars, args[1][0]);
  return forEach(args[0].scalars, [&](Scalar x) { return x / norm; });
}

} // namespace warp::lowering
