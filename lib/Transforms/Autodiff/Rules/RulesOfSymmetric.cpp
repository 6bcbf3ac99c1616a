//===- RulesOfSymmetric.cpp - Derivatives of symmetric functions ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// With A = Q diag(d) Q^T, the derivative of f(A) is
//
//   Q ((Q^T dA Q) scaled by the divided differences of f) Q^T,
//
// (f(x) - f(y)) / (x - y) for two eigenvalues, f'(x) for equal ones. Written
// without cancellation, these are smooth where eigenvalues repeat. The map is
// its own transpose, so both modes are the same.
//
//===----------------------------------------------------------------------===//

#include "MatrixFormula.h"

using namespace mlir;

namespace warp::autodiff {

/// A divided difference for x >= y.
using DividedDifference = Expr (*)(MatrixFormula &, Expr x, Expr y);

/// 1 / (sqrt(x) + sqrt(y)).
static Expr divideSqrt(MatrixFormula &f, Expr x, Expr y) {
  auto root = [&](Expr z) {
    return f.call("sqrt", {f.call("max", {z, f.number(0)})});
  };
  Expr sum = root(x) + root(y);
  return f.getFormula().unless([&] { return sum == f.number(0); },
                               [&] { return f.number(1) / sum; });
}

/// With a number `x`, function / x; near 0 the first terms of its series, whose
/// derivative is right at 0, too.
static Expr divideSmoothly(MatrixFormula &f, Expr function, Expr x,
                           ArrayRef<double> series) {
  Expr isSmall = f.abs(x) < f.number(0.01);
  Expr sum = f.number(series.back());
  for (double term : llvm::reverse(series.drop_back()))
    sum = f.number(term) + sum * x;
  Expr divisor = f.call("where", {isSmall, f.number(1), x});
  return f.call("where", {isSmall, sum, function / divisor});
}

static Expr divideLog(MatrixFormula &f, Expr x, Expr y) {
  static constexpr double series[] = {1,        -1.0 / 2, 1.0 / 3,
                                      -1.0 / 4, 1.0 / 5,  -1.0 / 6,
                                      1.0 / 7,  -1.0 / 8, 1.0 / 9};
  Expr ratio = (x - y) / y;
  return divideSmoothly(f, f.call("log1p", {ratio}), ratio, series) / y;
}

static Expr divideExp(MatrixFormula &f, Expr x, Expr y) {
  static constexpr double series[] = {1,          1.0 / 2,    1.0 / 6,
                                      1.0 / 24,   1.0 / 120,  1.0 / 720,
                                      1.0 / 5040, 1.0 / 40320};
  Expr gap = y - x;
  return divideSmoothly(f, f.call("expm1", {gap}), gap, series) *
         f.call("exp", {x});
}

static Expr scaleEntries(MatrixFormula &f, DividedDifference divide) {
  auto [q, d] = f.getEigen();
  Expr p = f.transpose(q) * f.getSymmetricPart(f.getSeed(0)) * q;
  Expr values = d;
  Expr scaled = f.makeMatrix([&](int row, int col) {
    Expr x = f.get(values, std::min(row, col));
    Expr y = f.get(values, std::max(row, col));
    return divide(f, x, y) * f.get(p, row, col);
  });
  return q * scaled * f.transpose(q);
}

#define WARP_SYMMETRIC_RULES(Name, divide)                                     \
  SmallVector<Value> pullback##Name(RuleContext &context,                      \
                                    const RuleInput &input) {                  \
    MatrixFormula f(context, input);                                           \
    return f.getAdjoints(scaleEntries(f, divide));                             \
  }                                                                            \
  SmallVector<Value> pushforward##Name(RuleContext &context,                   \
                                       const RuleInput &input) {               \
    MatrixFormula f(context, input);                                           \
    return f.getTangents(scaleEntries(f, divide));                             \
  }
WARP_SYMMETRIC_RULES(SymSqrt3, divideSqrt)
WARP_SYMMETRIC_RULES(SymLog3, divideLog)
WARP_SYMMETRIC_RULES(SymExp3, divideExp)
#undef WARP_SYMMETRIC_RULES

//===----------------------------------------------------------------------===//
// Any function, by its values and divided differences
//===----------------------------------------------------------------------===//

namespace {
/// Q^T g Q, and the values' and the matrix's share of it.
struct Spectral {
  Expr q, p;

  Spectral(MatrixFormula &f, Expr g) {
    q = f.getEigen().first;
    p = f.transpose(q) * f.getSymmetricPart(g) * q;
  }
  /// The entry beside pair (i, j) has the index of the third axis.
  Expr scaleOffDiagonal(MatrixFormula &f, Expr slopes) {
    return f.makeMatrix([&](int row, int col) {
      return row == col ? f.number(0)
                        : f.get(slopes, 3 - row - col) * f.get(p, row, col);
    });
  }
};
} // namespace

SmallVector<Value> pullbackSymSpectral3(RuleContext &context,
                                        const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr slopes = f.getFormula().wrap(input.operands[2]);
  Spectral spectral(f, f.getSeed(0));
  Expr scaled = spectral.scaleOffDiagonal(f, slopes);
  SmallVector<Value> adjoints =
      f.getAdjoints(spectral.q * scaled * f.transpose(spectral.q));
  if (input.wanted[1])
    adjoints[1] = f.getDiagonal(spectral.p).value;
  return adjoints;
}

SmallVector<Value> pushforwardSymSpectral3(RuleContext &context,
                                           const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr slopes = f.getFormula().wrap(input.operands[2]);
  Spectral spectral(f, f.getSeed(0));
  Expr sum = spectral.scaleOffDiagonal(f, slopes);
  if (Expr values = f.getSeed(1); !values.isNumber())
    sum = sum + f.call("diag", {values});
  return f.getTangents(spectral.q * sum * f.transpose(spectral.q));
}

} // namespace warp::autodiff
