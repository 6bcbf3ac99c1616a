//===- RulesOfDecompositions.cpp - Derivatives of decompositions ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A decomposition is never differentiated through its iterations: a small turn
// of the factors follows from the equation that they satisfy. With A = U S V^T
// and the turns U^T dU and V^T dV, which are skew,
//
//   U^T dA V = (U^T dU) S - S (V^T dV) + dS,
//
// whose entries (i, j) and (j, i) are two equations for one turn of U and one
// of V. Their sum is divided by s_j - s_i and their difference by s_i + s_j;
// over the difference of squares, digits would be lost. Where values repeat,
// the turns are arbitrary. A function that does not depend on them has a
// cotangent whose part for that turn is zero, up to rounding, and contributes
// nothing; for any other one the policy for singular points decides.
//
// A function that tells values of such a pair apart, or that weighs their
// vectors by functions of the values, gives the values different cotangents in
// nearly all bases. Its derivative beside the diagonal shows in no
// cotangent of this basis, so the policy that reports counts it; but for
// products that SpectralProducts.cpp writes in another way.
//
// That is enough for first derivatives. For second ones, the tangent of an
// adjoint goes along one direction, and of all vectors of a repeated value
// those are taken that the direction separates: in them, the symmetric part of
// U^T dA V (of Q^T dA Q) has zeros beside the diagonal for such a value, so
// that vectors and values are smooth along the direction (Kato, "Perturbation
// Theory for Linear Operators", II.6), and no turn is arbitrary that matters.
//
// The polar decomposition has no such points but where the rotation itself is
// arbitrary: its turn solves a linear system, which at the identity is 2 I.
//
// See Townsend, "Differentiating the Singular Value Decomposition", 2016, and
// Walter and Lehmann, "Algorithmic Differentiation of Linear Algebra
// Functions", 2010.
//
//===----------------------------------------------------------------------===//

#include "MatrixFormula.h"

using namespace mlir;

namespace warp::autodiff {

/// Entries of a square matrix of at most 3 rows, zero at first.
namespace {
class Entries {
public:
  explicit Entries(MatrixFormula &f) : f(f) {
    for (Expr &entry : entries)
      entry = f.number(0);
  }
  Expr &operator()(int row, int col) { return entries[row * 3 + col]; }
  Expr toMatrix() {
    return f.makeMatrix([&](int row, int col) { return (*this)(row, col); });
  }

private:
  MatrixFormula &f;
  Expr entries[9];
};
} // namespace

//===----------------------------------------------------------------------===//
// Vectors of repeated values
//===----------------------------------------------------------------------===//

namespace {
/// Pairs of values that are the same; those of 0 and 2 are if 0 and 1 are and 1
/// and 2.
class Repeated {
public:
  Repeated(MatrixFormula &f, Expr values, Expr scale) : f(f) {
    for (int i = 0; i + 1 < f.getSize(); ++i)
      next[i] = f.areClose(f.get(values, i), f.get(values, i + 1), scale);
  }
  Expr operator()(int i, int j) {
    return j - i == 1 ? next[i] : f.call("bit_and", {next[0], next[1]});
  }
  /// True if a cotangent of the values tells such a pair apart.
  Expr areToldApart(Expr cotangent);
  /// The basis of their vectors that separates the values along a direction,
  /// whose symmetric part in the present basis is `p`.
  Expr getBasis(Expr p);

private:
  Expr getBasisOf2(Expr p);

  MatrixFormula &f;
  Expr next[2];
};
} // namespace

Expr Repeated::areToldApart(Expr cotangent) {
  Expr any = f.number(0);
  if (cotangent.isNumber() || !f.isReported() || !f.doTurnsMatter())
    return any;
  for (int i = 0; i + 1 < f.getSize(); ++i) {
    Expr a = f.get(cotangent, i), b = f.get(cotangent, i + 1);
    Expr isSame = f.abs(a - b) <= f.number(0x1p-12) * (f.abs(a) + f.abs(b));
    any = f.either(any, f.call("bit_and", {next[i], f.call("unot", {isSame})}));
  }
  return any;
}

Expr Repeated::getBasisOf2(Expr p) {
  Expr angle = 0.5 * f.call("atan2", {2 * f.get(p, 0, 1),
                                      f.get(p, 0, 0) - f.get(p, 1, 1)});
  angle = f.call("where", {next[0], angle, f.number(0)});
  Expr c = f.call("cos", {angle}), s = f.call("sin", {angle});
  Expr entries[] = {c, -s, s, c};
  return f.makeMatrix([&](int row, int col) { return entries[2 * row + col]; });
}

Expr Repeated::getBasis(Expr p) {
  if (f.getSize() == 2)
    return getBasisOf2(p);
  Expr size = f.number(0);
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j)
      size = size + f.abs(f.get(p, i, j));
  size = f.call("where", {size == f.number(0), f.number(1), size});
  // The blocks of equal values, held apart so that their order stays.
  Expr first = f.call("where", {next[0], f.number(0), f.number(-8)});
  Expr second = first + f.call("where", {next[1], f.number(0), f.number(-8)});
  Expr places[] = {f.number(0), first, second};
  Expr blocks = f.makeMatrix([&](int row, int col) {
    Expr entry = f.get(p, row, col) / size;
    if (row == col)
      return entry + places[row];
    return f.call("where", {(*this)(std::min(row, col), std::max(row, col)),
                            entry, f.number(0)});
  });
  Expr q = f.getEigenvectors(blocks);
  // A vector that is alone stays as it is, also its sign.
  Expr any = f.either(next[0], next[1]);
  Expr signs[3];
  for (int i = 0; i < 3; ++i)
    signs[i] = f.call(
        "where", {f.get(q, i, i) < f.number(0), f.number(-1), f.number(1)});
  Expr turned = f.makeMatrix([&](int row, int col) {
    return f.call("where",
                  {any, signs[col] * f.get(q, row, col), f.number(row == col)});
  });
  // A turn, as the factors are; a vector of a repeated value changes its sign.
  Expr isFlipped = f.call("determinant", {turned}) < f.number(0);
  return f.makeMatrix([&](int row, int col) {
    Expr entry = f.get(turned, row, col);
    if (col == 1)
      return entry;
    Expr isHere = col == 0 ? next[0] : f.call("unot", {next[0]});
    return f.call("where",
                  {f.call("bit_and", {isFlipped, isHere}), -entry, entry});
  });
}

//===----------------------------------------------------------------------===//
// Singular values
//===----------------------------------------------------------------------===//

namespace {
/// The odd and the even part of the turns of columns i and j.
struct Turns {
  MatrixFormula::Quotient odd, even;

  /// From twice the parts, each a difference of terms of this size.
  Turns(MatrixFormula &f, Expr odd, Expr even, Expr terms, Expr s, int i, int j)
      : odd(f.divide(0.5 * odd, terms, f.get(s, i) + f.get(s, j),
                     f.abs(f.get(s, 0)))),
        even(f.divide(0.5 * even, terms, f.get(s, j) - f.get(s, i),
                      f.abs(f.get(s, 0)))) {}
};
} // namespace

static SmallVector<Value> pullbackSvd(RuleContext &context,
                                      const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr u = f.getResult(0), s = f.getResult(1), v = f.getResult(2);
  Expr ku = f.transpose(u) * f.getSeed(0), kv = f.transpose(v) * f.getSeed(2);
  Expr anySingular = f.number(0);
  Entries p(f);
  for (int i = 0; i < f.getSize(); ++i) {
    p(i, i) = f.get(f.getSeed(1), i);
    for (int j = i + 1; j < f.getSize(); ++j) {
      Expr u0 = f.get(ku, i, j), u1 = f.get(ku, j, i);
      Expr v0 = f.get(kv, i, j), v1 = f.get(kv, j, i);
      Expr terms = f.abs(u0) + f.abs(u1) + f.abs(v0) + f.abs(v1);
      Turns turns(f, (u0 - u1) - (v0 - v1), (u0 - u1) + (v0 - v1), terms, s, i,
                  j);
      // If it does not, what is there of the even part is rounding errors.
      if (!f.doTurnsMatter()) {
        Expr isSame =
            f.areNearlyTheSame(f.get(s, i), f.get(s, j), f.abs(f.get(s, 0)));
        turns.even.value =
            f.call("where", {isSame, f.number(0), turns.even.value});
        turns.even.isSingular = f.call(
            "bit_and", {turns.even.isSingular, f.call("unot", {isSame})});
      }
      // Half of an arbitrary turn would be as arbitrary.
      Expr isSingular = f.either(turns.odd.isSingular, turns.even.isSingular);
      anySingular = f.either(anySingular, isSingular);
      Expr upper = turns.even.value + turns.odd.value;
      Expr lower = turns.even.value - turns.odd.value;
      p(i, j) = f.call("where", {isSingular, f.number(0), upper});
      p(j, i) = f.call("where", {isSingular, f.number(0), lower});
    }
  }
  Repeated repeated(f, s, f.abs(f.get(s, 0)));
  f.report(f.either(anySingular, repeated.areToldApart(f.getSeed(1))));
  return f.getAdjoints(u * p.toMatrix() * f.transpose(v));
}

static SmallVector<Value> pushforwardSvd(RuleContext &context,
                                         const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr u = f.getResult(0), s = f.getResult(1), v = f.getResult(2);
  Expr p = f.transpose(u) * f.getSeed(0) * v, anySingular = f.number(0);
  if (f.mayReplace()) {
    Repeated repeated(f, s, f.abs(f.get(s, 0)));
    Expr basis = repeated.getBasis(f.getSymmetricPart(p));
    u = u * basis;
    v = v * basis;
    f.replaceResult(0, u);
    f.replaceResult(2, v);
    Expr all = f.transpose(basis) * p * basis;
    p = f.makeMatrix([&](int row, int col) {
      Expr entry = f.get(all, row, col);
      if (row == col)
        return entry;
      // Without what rounding leaves of the symmetric part.
      Expr odd = 0.5 * (entry - f.get(all, col, row));
      return f.call("where", {repeated(std::min(row, col), std::max(row, col)),
                              odd, entry});
    });
  }
  Entries turnU(f), turnV(f);
  for (int i = 0; i < f.getSize(); ++i)
    for (int j = i + 1; j < f.getSize(); ++j) {
      Expr upper = f.get(p, i, j), lower = f.get(p, j, i);
      Turns turns(f, upper - lower, upper + lower, f.abs(upper) + f.abs(lower),
                  s, i, j);
      anySingular = f.either(
          anySingular, f.either(turns.odd.isSingular, turns.even.isSingular));
      turnU(i, j) = turns.even.value + turns.odd.value;
      turnU(j, i) = -turnU(i, j);
      turnV(i, j) = turns.even.value - turns.odd.value;
      turnV(j, i) = -turnV(i, j);
    }
  f.report(anySingular);
  return f.getTangents(
      {u * turnU.toMatrix(), f.getDiagonal(p), v * turnV.toMatrix()});
}

//===----------------------------------------------------------------------===//
// Eigenvalues
//===----------------------------------------------------------------------===//

static Expr getLargestEigenvalue(MatrixFormula &f, Expr d) {
  return f.call("max", {f.abs(f.get(d, 0)), f.abs(f.get(d, 2))});
}

SmallVector<Value> pullbackEig3(RuleContext &context, const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr q = f.getResult(0), d = f.getResult(1);
  Expr k = f.transpose(q) * f.getSeed(0), anySingular = f.number(0);
  Expr largest = getLargestEigenvalue(f, d);
  Entries p(f);
  for (int i = 0; i < 3; ++i) {
    p(i, i) = f.get(f.getSeed(1), i);
    for (int j = i + 1; j < 3; ++j) {
      Expr upper = f.get(k, i, j), lower = f.get(k, j, i);
      MatrixFormula::Quotient turn =
          f.divide(0.5 * (upper - lower), f.abs(upper) + f.abs(lower),
                   f.get(d, j) - f.get(d, i), largest);
      anySingular = f.either(anySingular, turn.isSingular);
      p(i, j) = p(j, i) = turn.value;
    }
  }
  Repeated repeated(f, d, largest);
  f.report(f.either(anySingular, repeated.areToldApart(f.getSeed(1))));
  return f.getAdjoints(q * p.toMatrix() * f.transpose(q));
}

SmallVector<Value> pushforwardEig3(RuleContext &context,
                                   const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr q = f.getResult(0), d = f.getResult(1);
  Expr p = f.transpose(q) * f.getSymmetricPart(f.getSeed(0)) * q;
  Expr largest = getLargestEigenvalue(f, d), anySingular = f.number(0);
  if (f.mayReplace()) {
    Repeated repeated(f, d, largest);
    Expr basis = repeated.getBasis(p);
    q = q * basis;
    f.replaceResult(0, q);
    Expr all = f.transpose(basis) * p * basis;
    p = f.makeMatrix([&](int row, int col) {
      Expr entry = f.get(all, row, col);
      if (row == col)
        return entry;
      return f.call("where", {repeated(std::min(row, col), std::max(row, col)),
                              f.number(0), entry});
    });
  }
  Entries turns(f);
  for (int i = 0; i < 3; ++i)
    for (int j = i + 1; j < 3; ++j) {
      MatrixFormula::Quotient turn = f.divide(
          f.get(p, i, j), f.number(0), f.get(d, j) - f.get(d, i), largest);
      anySingular = f.either(anySingular, turn.isSingular);
      turns(i, j) = turn.value;
      turns(j, i) = -turn.value;
    }
  f.report(anySingular);
  return f.getTangents({q * turns.toMatrix(), f.getDiagonal(p)});
}

//===----------------------------------------------------------------------===//
// QR decomposition
//===----------------------------------------------------------------------===//

/// A rule for square matrices with floats of 32 bits, in doubles. Rounded
/// factors are off by the matrix's condition, and so is what is divided by
/// them: they would lose twice the digits that the derivative itself does.
static SmallVector<Value>
inDoubles(RuleContext &context, const RuleInput &input, RuleFunction rule) {
  OpBuilder &b = context.builder;
  auto given = cast<MatType>(input.operands[0].getType());
  if (!given.getElementType().isF32())
    return rule(context, input);
  Type wide = MatType::get(b.getContext(), given.getRows(), given.getCols(),
                           b.getF64Type());
  auto castAll = [&](ValueRange values, Type type) {
    SmallVector<Value> cast;
    for (Value value : values)
      cast.push_back(value ? CastOp::create(b, context.loc, type, value)
                           : Value());
    return cast;
  };
  SmallVector<Value> operands = castAll(input.operands, wide);
  SmallVector<Value> seeds = castAll(input.seeds, wide);
  Operation *again = createBuiltin(
      b, context.loc, cast<BuiltinOp>(input.op).getSpec(), operands);
  return castAll(rule(context, {again, operands, again->getResults(), seeds,
                                input.wanted}),
                 given);
}

static SmallVector<Value> pullbackQr(RuleContext &context,
                                     const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr q = f.getResult(0), r = f.getResult(1);
  Expr gq = f.getSeed(0), gr = f.getSeed(1);
  // Entries below the diagonal are no function of the matrix.
  if (!gr.isNumber())
    gr = f.makeMatrix([&, all = gr](int row, int col) {
      return row <= col ? f.get(all, row, col) : f.number(0);
    });
  Expr m = r * f.transpose(gr) - f.transpose(gq) * q;
  Expr lowerOnBothSides = f.makeMatrix([&](int row, int col) {
    return f.get(m, std::max(row, col), std::min(row, col));
  });
  return f.getAdjoints((gq + q * lowerOnBothSides) *
                       f.transpose(f.call("inverse", {r})));
}

static SmallVector<Value> pushforwardQr(RuleContext &context,
                                        const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr q = f.getResult(0), r = f.getResult(1);
  Expr p = f.transpose(q) * f.getSeed(0) * f.call("inverse", {r});
  Expr turn = f.makeMatrix([&](int row, int col) {
    if (row == col)
      return f.number(0);
    return row > col ? f.get(p, row, col) : -f.get(p, col, row);
  });
  Expr dr = (p - turn) * r;
  Expr upper = f.makeMatrix([&](int row, int col) {
    return row <= col ? f.get(dr, row, col) : f.number(0);
  });
  return f.getTangents({q * turn, upper});
}

SmallVector<Value> pullbackQr3(RuleContext &context, const RuleInput &input) {
  return inDoubles(context, input, pullbackQr);
}

SmallVector<Value> pushforwardQr3(RuleContext &context,
                                  const RuleInput &input) {
  return inDoubles(context, input, pushforwardQr);
}

//===----------------------------------------------------------------------===//
// Polar decomposition
//===----------------------------------------------------------------------===//

/// The turn w for which skew(w) S + S skew(w) is the skew part of 2 m: it
/// solves (tr(S) I - S) w = axial vector of m - m^T.
static Expr getPolarTurn(MatrixFormula &f, Expr s, Expr m) {
  Expr system = f.makeMatrix([&](int row, int col) {
    if (row != col)
      return -f.get(s, row, col);
    int second = (row + 1) % 3, third = (row + 2) % 3;
    return f.get(s, second, second) + f.get(s, third, third);
  });
  Expr axial = f.makeVector({f.get(m, 2, 1) - f.get(m, 1, 2),
                             f.get(m, 0, 2) - f.get(m, 2, 0),
                             f.get(m, 1, 0) - f.get(m, 0, 1)});
  return f.call("skew", {f.call("solve3", {system, axial})});
}

SmallVector<Value> pullbackPolar(RuleContext &context, const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr r = f.getResult(0), s = f.getResult(1), gs = f.getSeed(1);
  Expr k = f.transpose(r) * f.getSeed(0) - gs * s;
  return f.getAdjoints(r * (getPolarTurn(f, s, k) + gs));
}

SmallVector<Value> pushforwardPolar(RuleContext &context,
                                    const RuleInput &input) {
  MatrixFormula f(context, input);
  Expr r = f.getResult(0), s = f.getResult(1);
  Expr p = f.transpose(r) * f.getSeed(0), turn = getPolarTurn(f, s, p);
  return f.getTangents({r * turn, p - turn * s});
}

//===----------------------------------------------------------------------===//
// Both sizes
//===----------------------------------------------------------------------===//

#define WARP_SVD_RULES(Name)                                                   \
  SmallVector<Value> pullback##Name(RuleContext &context,                      \
                                    const RuleInput &input) {                  \
    return pullbackSvd(context, input);                                        \
  }                                                                            \
  SmallVector<Value> pushforward##Name(RuleContext &context,                   \
                                       const RuleInput &input) {               \
    return pushforwardSvd(context, input);                                     \
  }
WARP_SVD_RULES(Svd2)
WARP_SVD_RULES(Svd3)
#undef WARP_SVD_RULES

} // namespace warp::autodiff
