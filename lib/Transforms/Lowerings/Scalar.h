//===- Scalar.h - Arithmetic on scalars of thread IR ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The lowerings of builtins are formulas, and this is what lets them read like
// formulas: a `Scalar` is an SSA value together with its scalar type in the
// warp dialect, which knows the sign of an integer, and its operators create
// the operations of `arith` and `math`. Nothing here knows composites.
//
// Constants are created once per function, in its entry block.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_LOWERINGS_SCALAR_H
#define WARP_TRANSFORMS_LOWERINGS_SCALAR_H

#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinTypes.h"
#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/STLFunctionalExtras.h"

#include <cmath>
#include <functional>

namespace warp::lowering {

class Emitter;

/// A scalar value and its type in the warp dialect.
struct Scalar {
  Emitter *emitter = nullptr;
  mlir::Value value;
  mlir::Type type;

  bool isFloat() const { return llvm::isa<mlir::FloatType>(type); }
  bool isUnsigned() const;
  unsigned getWidth() const { return type.getIntOrFloatBitWidth(); }
  /// A constant of this scalar's type.
  Scalar like(double number) const;
  /// The constant that this is, if it is an integer constant.
  std::optional<llvm::APInt> getConstant() const;
};

using Scalars = llvm::SmallVector<Scalar, 4>;

/// Creates operations at one place of a function.
class Emitter {
public:
  /// Constants go to the start of `entry`.
  Emitter(mlir::MLIRContext *context, mlir::Block *entry)
      : builder(context), loc(builder.getUnknownLoc()), entry(entry) {}

  void moveTo(mlir::Operation *op) {
    builder.setInsertionPoint(op);
    loc = op->getLoc();
  }

  mlir::Value constant(mlir::TypedAttr attribute);
  Scalar constant(mlir::Type scalar, double number);
  Scalar integer(mlir::Type scalar, uint64_t bits);

  template <typename OpTy, typename... Args> mlir::Value create(Args &&...args) {
    return OpTy::create(builder, loc, std::forward<Args>(args)...);
  }

  mlir::OpBuilder builder;
  mlir::Location loc;
  /// If set, makes the components of `length` or `normalize` of a vector, which
  /// are not expanded then.
  std::function<llvm::SmallVector<Scalar, 4>(llvm::StringRef builtin,
                                             llvm::ArrayRef<Scalar> vector)>
      keep;

private:
  mlir::Block *entry;
  llvm::DenseMap<mlir::Attribute, mlir::Value> constants;
};

/// Integers wrap around.
Scalar operator+(Scalar a, Scalar b);
Scalar operator-(Scalar a, Scalar b);
Scalar operator*(Scalar a, Scalar b);
Scalar operator-(Scalar a);
inline Scalar operator+(Scalar a, double b) { return a + a.like(b); }
inline Scalar operator+(double a, Scalar b) { return b.like(a) + b; }
inline Scalar operator-(Scalar a, double b) { return a - a.like(b); }
inline Scalar operator-(double a, Scalar b) { return b.like(a) - b; }
inline Scalar operator*(Scalar a, double b) { return a * a.like(b); }
inline Scalar operator*(double a, Scalar b) { return b * b.like(a); }

/// Integers truncate toward zero; a zero divisor gives zero, and the smallest
/// integer by -1 gives itself.
Scalar operator/(Scalar a, Scalar b);
inline Scalar operator/(double a, Scalar b) { return b.like(a) / b; }
/// Remainder with the sign of the dividend; zero for a zero divisor.
Scalar operator%(Scalar a, Scalar b);
/// Quotient rounded down.
Scalar floorDivide(Scalar a, Scalar b);

/// Bitwise operations, of booleans too.
Scalar operator&(Scalar a, Scalar b);
Scalar operator|(Scalar a, Scalar b);
Scalar operator^(Scalar a, Scalar b);
Scalar operator~(Scalar a);
/// By the width or more, nothing remains but the sign.
Scalar shiftLeft(Scalar a, Scalar b);
Scalar shiftRight(Scalar a, Scalar b);
/// By a constant below the width; the right one does not keep the sign.
Scalar shiftLeft(Scalar a, unsigned bits);
Scalar shiftRightLogical(Scalar a, unsigned bits);
Scalar shiftRightLogical(Scalar a, Scalar bits);

/// Comparisons are false for NaN, except that NaN is unequal to everything.
Scalar operator<(Scalar a, Scalar b);
Scalar operator<=(Scalar a, Scalar b);
Scalar operator>(Scalar a, Scalar b);
Scalar operator>=(Scalar a, Scalar b);
Scalar operator==(Scalar a, Scalar b);
Scalar operator!=(Scalar a, Scalar b);
inline Scalar operator<(Scalar a, double b) { return a < a.like(b); }
inline Scalar operator<=(Scalar a, double b) { return a <= a.like(b); }
inline Scalar operator>(Scalar a, double b) { return a > a.like(b); }
inline Scalar operator>=(Scalar a, double b) { return a >= a.like(b); }
inline Scalar operator==(Scalar a, double b) { return a == a.like(b); }
inline Scalar operator!=(Scalar a, double b) { return a != a.like(b); }

/// The same number, whose operation is not merged with others.
Scalar exactly(Scalar x);

Scalar select(Scalar condition, Scalar a, Scalar b);

/// For floats, the operand that is not NaN if one is.
Scalar min(Scalar a, Scalar b);
Scalar max(Scalar a, Scalar b);
/// The smallest integer is its own absolute value.
Scalar abs(Scalar x);
/// a b + c, rounded once.
Scalar fma(Scalar a, Scalar b, Scalar c);
Scalar sqrt(Scalar x);
Scalar sin(Scalar x);
Scalar cos(Scalar x);
Scalar asin(Scalar x);
Scalar acos(Scalar x);
Scalar atan2(Scalar y, Scalar x);
Scalar exp(Scalar x);
Scalar log(Scalar x);
/// log(1 + x).
Scalar log1p(Scalar x);
Scalar trunc(Scalar x);
Scalar floor(Scalar x);
Scalar copysign(Scalar magnitude, Scalar sign);
Scalar popcount(Scalar x);
Scalar isNan(Scalar x);
Scalar isInf(Scalar x);
Scalar isFinite(Scalar x);

/// Numeric conversion: float to integer saturates and sends NaN to zero; to
/// boolean tests against zero. Integers without a sign count as signed.
Scalar convert(Scalar x, mlir::Type to);
/// The same bits as another type of the same width.
Scalar reinterpret(Scalar x, mlir::Type to);
/// Unsigned integer type of the width of a scalar.
mlir::Type getBitsType(mlir::Type scalar);

/// The values of `rare` where `condition` holds, otherwise `common`; code for
/// `rare` runs only where it is needed.
Scalars branch(Scalar condition, llvm::ArrayRef<Scalar> common,
               llvm::function_ref<Scalars()> rare);

/// How a float type lies in its bits.
struct FloatFormat {
  int mantissaBits, bias;
  explicit FloatFormat(mlir::Type type);
  /// Distance from 1 to the next number.
  double getEpsilon() const { return std::ldexp(1.0, -mantissaBits); }
};

} // namespace warp::lowering

#endif // WARP_TRANSFORMS_LOWERINGS_SCALAR_H
