//===- RulesOfDeterminant.cpp - Derivative of the determinant -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The derivative by an entry is its cofactor, which is finite for singular
// matrices too, where det(A) inverse(A)^T is not.
//
//===----------------------------------------------------------------------===//

#include "MatrixFormula.h"

using namespace mlir;

namespace warp::autodiff {

/// Determinant of the rows and columns left, by the first of the rows.
static Expr getMinor(MatrixFormula &f, ArrayRef<int> rows, ArrayRef<int> cols) {
  Expr matrix = f.getMatrix();
  if (rows.size() == 1)
    return f.get(matrix, rows[0], cols[0]);
  // A builtin, which has a difference of products without cancellation error:
  // larger minors of nearly dependent rows are sums of such small numbers.
  if (rows.size() == 2)
    return f.determinantOf2(
        {f.get(matrix, rows[0], cols[0]), f.get(matrix, rows[0], cols[1]),
         f.get(matrix, rows[1], cols[0]), f.get(matrix, rows[1], cols[1])});
  Expr sum = f.number(0);
  for (size_t i = 0; i < cols.size(); ++i) {
    SmallVector<int, 4> others(cols);
    others.erase(others.begin() + i);
    Expr term = f.get(matrix, rows[0], cols[i]) *
                getMinor(f, rows.drop_front(), others);
    sum = i % 2 ? sum - term : sum + term;
  }
  return sum;
}

static Expr getCofactors(MatrixFormula &f) {
  return f.makeMatrix([&](int row, int col) {
    SmallVector<int, 4> rows, cols;
    for (int i = 0; i < f.getSize(); ++i) {
      if (i != row)
        rows.push_back(i);
      if (i != col)
        cols.push_back(i);
    }
    Expr minor = getMinor(f, rows, cols);
    return (row + col) % 2 ? -minor : minor;
  });
}

SmallVector<Value> pullbackDeterminant(RuleContext &context,
                                       const RuleInput &input) {
  MatrixFormula f(context, input);
  return f.getAdjoints(f.getSeed(0) * getCofactors(f));
}

SmallVector<Value> pushforwardDeterminant(RuleContext &context,
                                          const RuleInput &input) {
  MatrixFormula f(context, input);
  return f.getTangents({f.call("ddot", {getCofactors(f), f.getSeed(0)})});
}

} // namespace warp::autodiff
