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

/// With the number `ratio`, function / ratio; 1 where that is 0 / 0.
static Expr divideUnlessZero(MatrixFormula &f, Expr function, Expr ratio) {
  Expr isZero = ratio == f.number(0);
  Expr divisor = f.call("where", {isZero, f.number(1), ratio});
  return f.call("where", {isZero, f.number(1), function / divisor});
}

static Expr divideLog(MatrixFormula &f, Expr x, Expr y) {
  Expr ratio = (x - y) / y;
  return divideUnlessZero(f, f.call("log1p", {ratio}), ratio) / y;
}

static Expr divideExp(MatrixFormula &f, Expr x, Expr y) {
  Expr gap = x - y;
  return divideUnlessZero(f, -f.call("expm1", {-gap}), gap) *
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
  SmallVector<Value> adjoints = f.getAdjoints(spectral.q * scaled *
                                              f.transpose(spectral.q));
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
