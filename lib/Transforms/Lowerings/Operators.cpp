//===- Operators.cpp - Lowerings of the operators -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

/// The product of an m by k and a k by n matrix.
static Scalars multiply(ArrayRef<Scalar> a, ArrayRef<Scalar> b, size_t m,
                        size_t k, size_t n) {
  Scalars result;
  for (size_t i = 0; i < m; ++i)
    for (size_t j = 0; j < n; ++j) {
      Scalar sum = a[i * k] * b[j];
      for (size_t p = 1; p < k; ++p)
        sum = sum + a[i * k + p] * b[p * n + j];
      result.push_back(sum);
    }
  return result;
}

Scalars lowerMul(Emitter &, Operands args) {
  const Parts &a = args[0], &b = args[1];
  if (isScalar(a.type) || isScalar(b.type))
    return zipWith(a.scalars, b.scalars, std::multiplies<>());
  if (isa<QuatType>(a.type))
    return multiplyQuats(a.scalars, b.scalars);
  if (isa<TransformType>(a.type))
    return multiplyTransforms(a.scalars, b.scalars);
  auto left = dyn_cast<MatType>(a.type), right = dyn_cast<MatType>(b.type);
  size_t m = left ? left.getRows() : 1, n = right ? right.getCols() : 1;
  return multiply(a.scalars, b.scalars, m, a.size() / m, n);
}

Scalars lowerDiv(Emitter &, Operands args) {
  return zipWith(args[0].scalars, args[1].scalars, std::divides<>());
}

Scalars lowerDivApprox(Emitter &emitter, Operands args) {
  return lowerDiv(emitter, args);
}

Scalars lowerFloorDiv(Emitter &, Operands args) {
  return zipWith(args[0].scalars, args[1].scalars, floorDivide);
}

Scalars lowerMod(Emitter &, Operands args) {
  return zipWith(args[0].scalars, args[1].scalars, std::modulus<>());
}

Scalars lowerNeg(Emitter &, Operands args) {
  return forEach(args[0].scalars, std::negate<>());
}

Scalars lowerPos(Emitter &, Operands args) {
  return Scalars(args[0].scalars);
}

Scalars lowerStopGradient(Emitter &, Operands args) {
  return Scalars(args[0].scalars);
}

Scalars lowerLShift(Emitter &, Operands args) {
  return zipWith(args[0].scalars, args[1].scalars,
             [](Scalar a, Scalar b) { return shiftLeft(a, b); });
}

Scalars lowerRShift(Emitter &, Operands args) {
  return zipWith(args[0].scalars, args[1].scalars, shiftRight);
}

Scalars lowerInvert(Emitter &, Operands args) {
  return forEach(args[0].scalars, std::bit_not<>());
}

Scalars lowerUNot(Emitter &, Operands args) { return {args[0][0] == 0}; }

Scalars lowerWhere(Emitter &emitter, Operands args) {
  Scalar holds = convert(args[0][0], emitter.builder.getI1Type());
  return zipWith(args[1].scalars, args[2].scalars,
             [&](Scalar a, Scalar b) { return select(holds, a, b); });
}

//===----------------------------------------------------------------------===//
// Comparisons
//===----------------------------------------------------------------------===//

Scalars lowerEq(Emitter &, Operands args) {
  Scalars equal = zipWith(args[0].scalars, args[1].scalars, std::equal_to<>());
  Scalar all = equal[0];
  for (Scalar one : llvm::drop_begin(equal))
    all = all & one;
  return {all};
}

Scalars lowerNe(Emitter &, Operands args) {
  Scalars unequal =
      zipWith(args[0].scalars, args[1].scalars, std::not_equal_to<>());
  Scalar any = unequal[0];
  for (Scalar one : llvm::drop_begin(unequal))
    any = any | one;
  return {any};
}

Scalars lowerLt(Emitter &, Operands args) { return {args[0][0] < args[1][0]}; }
Scalars lowerLe(Emitter &, Operands args) { return {args[0][0] <= args[1][0]}; }
Scalars lowerGt(Emitter &, Operands args) { return {args[0][0] > args[1][0]}; }
Scalars lowerGe(Emitter &, Operands args) { return {args[0][0] >= args[1][0]}; }

} // namespace warp::lowering
