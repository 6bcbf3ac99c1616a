//===- Formula.h - Parts of derivative formulas -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The functions in Derivatives.inc read like the formulas in the records: an
// `Expr` is a value of the warp dialect, and its operators create builtins. A
// number has no type of its own; it becomes a constant that fits the operand
// beside it. The number zero also stands for tangents that are not there, so
// sums and products with it vanish.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_FORMULA_H
#define WARP_TRANSFORMS_AUTODIFF_FORMULA_H

#include "Rules.h"

#include "llvm/ADT/STLFunctionalExtras.h"

#include <initializer_list>

namespace warp::autodiff {

class Formula;

/// A value, or a number if `value` is null.
struct Expr {
  Formula *formula = nullptr;
  mlir::Value value;
  double number = 0;

  bool isNumber() const { return !value; }
  bool isNumber(double other) const { return !value && number == other; }
};

/// One rule, applied to one operation.
class Formula {
public:
  Formula(RuleContext &context, mlir::ValueRange operands,
          mlir::ValueRange results)
      : context(context), operands(operands), results(results) {}

  Expr number(double number) { return {this, nullptr, number}; }
  Expr wrap(mlir::Value value) { return {this, value, 0}; }
  Expr operand(unsigned i) { return wrap(operands[i]); }
  Expr result() { return wrap(results[0]); }
  Expr cotangent() { return wrap(seed); }
  Expr tangent(unsigned i) { return wrap(tangents[i]); }

  /// A builtin, by its Python name.
  Expr call(llvm::StringRef name, std::initializer_list<Expr> args);

  /// The value, but zero where `isSingular`, as the policy has it. `isReported`
  /// if that is a property of the operands.
  Expr unless(llvm::function_ref<Expr()> isSingular,
              llvm::function_ref<Expr()> value, bool isReported = true);

  /// 1 / `divisor`, or the number zero: that is known where the kernel divides
  /// 1 by a square root. A root is never so small or large that its reciprocal
  /// is subnormal or infinite, so products with it are infinite or NaN where
  /// quotients are.
  Expr knownReciprocal(Expr divisor);

  /// True if the value comes from an operation that makes infinities of finite
  /// numbers, as a division does.
  static bool mayBeInfinite(Expr expr);

  /// Has the launch fail where the condition does not hold; IEEE arithmetic
  /// gives NaN there.
  void require(Expr condition, llvm::StringRef message);

  /// The value of an expression in a place where `type` is expected.
  mlir::Value materialize(Expr expr, mlir::Type type);

  /// The meaning of `g`.
  mlir::Value seed;
  llvm::ArrayRef<mlir::Value> tangents;

private:
  Expr callWhere(llvm::ArrayRef<Expr> args);

  RuleContext &context;
  mlir::ValueRange operands, results;
};

Expr operator+(Expr a, Expr b);
Expr operator-(Expr a, Expr b);
Expr operator*(Expr a, Expr b);
Expr operator/(Expr a, Expr b);
Expr operator-(Expr a);
Expr operator==(Expr a, Expr b);
Expr operator!=(Expr a, Expr b);
Expr operator<(Expr a, Expr b);
Expr operator<=(Expr a, Expr b);
Expr operator>(Expr a, Expr b);
Expr operator>=(Expr a, Expr b);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_FORMULA_H
