//===- Solve.cpp - Linear systems -----------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Gaussian elimination with partial pivoting, which for so few unknowns is as
// accurate as the numbers of the matrix allow; rows are exchanged by selection.
//
//===----------------------------------------------------------------------===//

#include "Decompositions.h"
#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

/// A row of the matrix and its right-hand side.
using Equation = Scalars;

/// Brings the equation with the largest coefficient of unknown `k` to place k.
static void pivot(SmallVectorImpl<Equation> &equations, size_t k) {
  for (size_t i = k + 1; i < equations.size(); ++i) {
    Scalar isLarger = abs(equations[i][k]) > abs(equations[k][k]);
    for (size_t j = k; j < equations[k].size(); ++j) {
      Scalar upper = equations[k][j], lower = equations[i][j];
      equations[k][j] = select(isLarger, lower, upper);
      equations[i][j] = select(isLarger, upper, lower);
    }
  }
}

/// Solves the equations, upper triangular from here on.
static Scalars substituteBack(ArrayRef<Equation> equations) {
  size_t n = equations.size();
  Scalars x(n);
  for (size_t k = n; k-- > 0;) {
    Scalar rest = equations[k][n];
    for (size_t j = k + 1; j < n; ++j)
      rest = fma(-equations[k][j], x[j], rest);
    x[k] = rest / equations[k][k];
  }
  return x;
}

/// Both sides are scaled, so that nothing overflows on the way.
static Scalars solve(Operands args) {
  size_t n = args[1].size();
  Scaled matrix = scaleToUnit(args[0].scalars);
  Scaled side = scaleToUnit(args[1].scalars);
  SmallVector<Equation, 4> equations;
  for (size_t i = 0; i < n; ++i) {
    equations.emplace_back(ArrayRef(matrix.scalars).slice(i * n, n));
    equations.back().push_back(side.scalars[i]);
  }
  Scalar isSingular = matrix.scalars[0] != matrix.scalars[0];
  for (size_t k = 0; k < n; ++k) {
    pivot(equations, k);
    Scalar isZero = equations[k][k] == 0;
    isSingular = k ? isSingular | isZero : isZero;
    for (size_t i = k + 1; i < n; ++i) {
      Scalar factor = equations[i][k] / equations[k][k];
      for (size_t j = k + 1; j <= n; ++j)
        equations[i][j] = fma(-factor, equations[k][j], equations[i][j]);
    }
  }
  // For a tiny matrix and a tiny side, a solution times one scale may overflow.
  Scalar scale = matrix.scale * side.unscale;
  Scalar isNumber = (scale > 0) & isFinite(scale);
  return forEach(substituteBack(equations), [&](Scalar x) {
    Scalar found =
        select(isNumber, x * scale, x * matrix.scale * side.unscale);
    return select(isSingular, x.like(0), found);
  });
}

Scalars lowerSolve2(Emitter &, Operands args) { return solve(args); }
Scalars lowerSolve3(Emitter &, Operands args) { return solve(args); }
Scalars lowerSolve4(Emitter &, Operands args) { return solve(args); }

} // namespace warp::lowering
