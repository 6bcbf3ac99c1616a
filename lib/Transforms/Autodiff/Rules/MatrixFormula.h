//===- MatrixFormula.h - Formulas with entries of matrices ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_MATRIXFORMULA_H
#define WARP_TRANSFORMS_AUTODIFF_MATRIXFORMULA_H

#include "Formula.h"
#include "RulesByFunction.h"

namespace warp::autodiff {

/// True if two values are so close that the mean of a function's derivatives at
/// both is better than a quotient of differences; or count as the same next to
/// `scale`, if that is not zero.
Expr areNearlyTheSame(Formula &f, Expr x, Expr y, Expr scale, double roundoff);

/// The rule of a builtin whose first operand is a square matrix, the only one
/// with a derivative. Expressions may be the number zero for what is absent.
class MatrixFormula {
public:
  MatrixFormula(RuleContext &context, const RuleInput &input);

  /// The matrix, a result, and the cotangent of a result.
  Expr getMatrix() const { return matrix; }
  Expr getResult(unsigned i) { return f.wrap(input.results[i]); }
  Expr getSeed(unsigned i) {
    return input.seeds[i] ? f.wrap(input.seeds[i]) : f.number(0);
  }
  int getSize() const { return size; }
  Expr number(double number) { return f.number(number); }
  Expr call(llvm::StringRef name, std::initializer_list<Expr> args) {
    return f.call(name, args);
  }
  Formula &getFormula() { return f; }

  // Components.
  Expr get(Expr vector, int i) { return extract(vector, {i}); }
  Expr get(Expr composite, int row, int col) {
    return extract(composite, {row, col});
  }
  Expr makeVector(llvm::ArrayRef<Expr> components);
  Expr makeMatrix(llvm::function_ref<Expr(int row, int col)> entry);
  /// Determinant of a 2x2 matrix, given by rows.
  Expr determinantOf2(llvm::ArrayRef<Expr> entries);

  // Functions of matrices, which may be zero.
  Expr transpose(Expr m);
  Expr getDiagonal(Expr m);
  Expr getSymmetricPart(Expr m);
  Expr abs(Expr x);
  Expr either(Expr a, Expr b) { return f.call("bit_or", {a, b}); }
  /// Eigenvectors and eigenvalues of the matrix.
  std::pair<Expr, Expr> getEigen() { return getEigen(matrix); }
  Expr getEigenvectors(Expr symmetric) { return getEigen(symmetric).first; }

  /// A quotient that the policy for singular points is about.
  struct Quotient {
    Expr value, isSingular;
  };
  /// `above` counts as zero next to `terms`, whose difference it is, and
  /// `below` next to `scale`.
  Quotient divide(Expr above, Expr terms, Expr below, Expr scale);
  /// True if two values count as the same next to `scale`.
  Expr areClose(Expr x, Expr y, Expr scale) {
    return abs(x - y) <= f.number(8 * roundoff) * scale;
  }
  /// The same by a wider measure; see below.
  Expr areNearlyTheSame(Expr x, Expr y, Expr scale) {
    return autodiff::areNearlyTheSame(f, x, y, scale, roundoff);
  }
  /// True if results may be exchanged for others, and doing it.
  bool mayReplace() const { return context.replace != nullptr; }
  void replaceResult(unsigned i, Expr value) {
    context.replace(i, f.materialize(value, input.results[i].getType()));
  }
  bool isReported() const {
    return context.report && context.singular != Singular::Strict;
  }
  bool doTurnsMatter() const { return context.turnsMatter; }
  /// Counts where the policy has pinned something.
  void report(Expr isSingular);

  /// The result of a rule.
  llvm::SmallVector<mlir::Value> getAdjoints(Expr ofMatrix);
  llvm::SmallVector<mlir::Value> getTangents(llvm::ArrayRef<Expr> ofResults);

private:
  std::pair<Expr, Expr> getEigen(Expr symmetric);
  Expr extract(Expr composite, std::initializer_list<int> indices);
  Expr make(mlir::Type type, llvm::ArrayRef<Expr> components);

  RuleContext &context;
  RuleInput input;
  Formula f;
  mlir::Type matrixType, scalar;
  int size;
  double roundoff;
  Expr matrix;
};

inline Expr operator*(double number, Expr x) {
  return x.formula->number(number) * x;
}

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_MATRIXFORMULA_H
