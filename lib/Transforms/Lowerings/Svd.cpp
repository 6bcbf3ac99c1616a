//===- Svd.cpp - Singular values ------------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One-sided Jacobi (Hestenes): rotations from the right make the columns of A V
// orthogonal. Small singular values keep their digits, which a method that
// forms A^T A loses. U is the orthonormal basis of these columns, so it is one
// whatever the rank, and the singular values are A V as U sees it.
//
//===----------------------------------------------------------------------===//

#include "Decompositions.h"
#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

/// By decreasing length of the columns of `b`.
static void sortColumns(Columns &b, Columns &v) {
  Scalars squares = {dot(b[0], b[0]), dot(b[1], b[1]), dot(b[2], b[2])};
  for (auto [i, j] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
    Scalar isLess = squares[i] < squares[j];
    exchange(isLess, b[i], b[j]);
    exchange(isLess, v[i], v[j]);
    Scalar larger = select(isLess, squares[j], squares[i]);
    squares[j] = select(isLess, squares[i], squares[j]);
    squares[i] = larger;
  }
}

Svd3 getSvd3(ArrayRef<Scalar> matrix) {
  Scaled scaled = scaleToUnit(matrix);
  Columns b = getColumns(scaled.scalars);
  Scalar zero = matrix[0].like(0), one = matrix[0].like(1);
  Columns v = {Scalars{one, zero, zero}, Scalars{zero, one, zero},
               Scalars{zero, zero, one}};
  int sweeps = zero.getWidth() == 32 ? 4 : 5;
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (auto [i, j] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
      JacobiRotation rotation(dot(b[i], b[i]), dot(b[j], b[j]),
                              dot(b[i], b[j]));
      rotation.apply(b[i], b[j]);
      rotation.apply(v[i], v[j]);
    }
  sortColumns(b, v);
  Columns u = getBasis(b[0], b[1]);
  Scalars sigma;
  for (int i = 0; i < 3; ++i)
    sigma.push_back(dot(u[i], b[i]) * scaled.unscale);
  // If the rank is 1, the second one is the rounding error of zero.
  sigma[1] = select(sigma[1] < 0, zero, sigma[1]);
  return {u, sigma, v};
}

/// With two columns, one rotation does it; the second removes its rounding.
Scalars lowerSvd2(Emitter &, Operands args) {
  Scaled scaled = scaleToUnit(args[0].scalars);
  ArrayRef<Scalar> m = scaled.scalars;
  Scalar zero = m[0].like(0), one = m[0].like(1);
  Scalars b[] = {{m[0], m[2]}, {m[1], m[3]}}, v[] = {{one, zero}, {zero, one}};
  for (int step = 0; step < 2; ++step) {
    JacobiRotation rotation(dot(b[0], b[0]), dot(b[1], b[1]), dot(b[0], b[1]));
    rotation.apply(b[0], b[1]);
    rotation.apply(v[0], v[1]);
  }
  Scalar isLess = dot(b[0], b[0]) < dot(b[1], b[1]);
  exchange(isLess, b[0], b[1]);
  exchange(isLess, v[0], v[1]);
  Scalars first = getUnit(b[0]);
  Scalar small = first[0] * b[1][1] - first[1] * b[1][0];
  // The second column of U is at right angles, on the side of the image.
  Scalar sign = copysign(one, small);
  Scalar x = -(sign * first[1]), y = sign * first[0];
  return {first[0], x, first[1], y,
          dot(first, b[0]) * scaled.unscale, abs(small) * scaled.unscale,
          v[0][0], v[1][0], v[0][1], v[1][1]};
}

Scalars lowerSvd3(Emitter &, Operands args) {
  Svd3 svd = getSvd3(args[0].scalars);
  Scalars results = getRowMajor(svd.u);
  llvm::append_range(results, svd.sigma);
  llvm::append_range(results, getRowMajor(svd.v));
  return results;
}

//===----------------------------------------------------------------------===//
// Polar decomposition
//===----------------------------------------------------------------------===//

/// R (3 - R^T R) / 2: removes what rounding took from orthogonality.
static Columns orthogonalize(const Columns &r) {
  Columns result = r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      Scalar excess = -0.5 * (i == j ? fma(r[i][0], r[i][0], r[i][0].like(-1)) +
                                           r[i][1] * r[i][1] + r[i][2] * r[i][2]
                                     : dot(r[i], r[j]));
      for (int row = 0; row < 3; ++row)
        result[i][row] = fma(excess, r[j][row], result[i][row]);
    }
  return result;
}

Scalars lowerPolar(Emitter &, Operands args) {
  Svd3 svd = getSvd3(args[0].scalars);
  Scalars ones(3, args[0][0].like(1));
  Columns r = getColumns(multiplyDiagonal(svd.u, ones, svd.v));
  Scalars results = getRowMajor(orthogonalize(r));
  llvm::append_range(results, multiplyDiagonal(svd.v, svd.sigma, svd.v));
  return results;
}

} // namespace warp::lowering
