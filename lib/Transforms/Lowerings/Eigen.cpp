//===- Eigen.cpp - Eigenvalues of symmetric matrices ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Jacobi's method: each rotation makes one pair of entries zero, and a sweep
// over the three pairs squares the size of those that remain, once they are
// small. The number of sweeps is fixed; it is one more than the largest found
// necessary on matrices of every kind.
//
//===----------------------------------------------------------------------===//

#include "Decompositions.h"
#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

static Columns getIdentity(Scalar like) {
  Scalar zero = like.like(0), one = like.like(1);
  return {Scalars{one, zero, zero}, Scalars{zero, one, zero},
          Scalars{zero, zero, one}};
}

Eigen3 getEigen3(ArrayRef<Scalar> matrix) {
  Scaled scaled = scaleToUnit(matrix);
  ArrayRef<Scalar> m = scaled.scalars;
  Scalars d = {m[0], m[4], m[8]};
  // The entry beside pair (p, q) has the index of the third axis.
  Scalars other = {0.5 * (m[5] + m[7]), 0.5 * (m[2] + m[6]),
                   0.5 * (m[1] + m[3])};
  Columns q = getIdentity(m[0]);
  double roundoff = FloatFormat(m[0].type).getEpsilon();
  Scalar negligible = m[0].like(roundoff * roundoff);
  int sweeps = m[0].getWidth() == 32 ? 4 : 5;
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (int third : {2, 1, 0}) {
      int i = third == 0 ? 1 : 0, j = third == 2 ? 1 : 2;
      JacobiRotation rotation(d[i], d[j], other[third]);
      Scalar change = rotation.tangent * other[third];
      d[i] = d[i] - change;
      d[j] = d[j] + change;
      other[third] = d[i].like(0);
      rotation.apply(other[j], other[i]);
      // On their way to zero, they must not become denormal, which is slow.
      for (int k : {i, j})
        other[k] = select(abs(other[k]) < negligible, d[i].like(0), other[k]);
      rotation.apply(q[i], q[j]);
    }
  for (auto [i, j] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
    Scalar isLess = d[i] < d[j];
    exchange(isLess, q[i], q[j]);
    Scalar larger = select(isLess, d[j], d[i]);
    d[j] = select(isLess, d[i], d[j]);
    d[i] = larger;
  }
  return {q, forEach(d, [&](Scalar x) { return x * scaled.unscale; })};
}

Scalars lowerEig3(Emitter &, Operands args) {
  Eigen3 eigen = getEigen3(args[0].scalars);
  Scalars results = getRowMajor(eigen.vectors);
  llvm::append_range(results, eigen.values);
  return results;
}

//===----------------------------------------------------------------------===//
// Functions of symmetric matrices
//===----------------------------------------------------------------------===//

static Scalars applyToValues(Operands args,
                             llvm::function_ref<Scalar(Scalar)> f) {
  Eigen3 eigen = getEigen3(args[0].scalars);
  return multiplyDiagonal(eigen.vectors, forEach(eigen.values, f),
                          eigen.vectors);
}

/// Negative eigenvalues no larger than rounding makes them count as zero.
Scalars lowerSymSqrt3(Emitter &, Operands args) {
  Eigen3 eigen = getEigen3(args[0].scalars);
  double roundoff = FloatFormat(args[0][0].type).getEpsilon();
  Scalar lowest = eigen.values[0] * (-8 * roundoff);
  Scalars roots = forEach(eigen.values, [&](Scalar x) {
    return sqrt(select((x < 0) & (x >= lowest), x.like(0), x));
  });
  return multiplyDiagonal(eigen.vectors, roots, eigen.vectors);
}

/// Near the identity, where logarithms are as small as the difference from it,
/// that difference is diagonalized: it is exact, and its digits are not lost
/// beside 1.
Scalars lowerSymLog3(Emitter &, Operands args) {
  Scalars m(args[0].scalars.begin(), args[0].scalars.end());
  Scalar one = m[0].like(1), zero = m[0].like(0), distance = zero;
  for (int i = 0; i < 9; ++i)
    distance = max(distance, abs(i % 4 ? m[i] : m[i] - one));
  Scalar isNear = distance < 0.25;
  for (int i : {0, 4, 8})
    m[i] = m[i] - select(isNear, one, zero);
  Eigen3 eigen = getEigen3(m);
  Scalars logarithms = forEach(
      eigen.values, [&](Scalar x) { return select(isNear, log1p(x), log(x)); });
  return multiplyDiagonal(eigen.vectors, logarithms, eigen.vectors);
}

Scalars lowerSymExp3(Emitter &, Operands args) {
  return applyToValues(args, exp);
}

Scalars lowerSymSpectral3(Emitter &, Operands args) {
  Eigen3 eigen = getEigen3(args[0].scalars);
  return multiplyDiagonal(eigen.vectors, args[1].scalars, eigen.vectors);
}

} // namespace warp::lowering
