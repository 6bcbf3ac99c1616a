//===- Scalar.cpp - Arithmetic on scalars of thread IR --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Floats map one to one to operations. Integers need care: division must not
// trap, shifts and conversions must not be poison, and the sign is in our type
// rather than in the value's. Guards are left out where an operand is constant,
// which is the common case.
//
//===----------------------------------------------------------------------===//

#include "Scalar.h"

#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;

namespace warp::lowering {

static Scalar wrap(Scalar like, Value value) {
  return {like.emitter, value, like.type};
}

static Type boolType(Scalar x) {
  return IntegerType::get(x.type.getContext(), 1);
}

template <typename FloatOp, typename IntOp>
static Scalar arithmetic(Scalar a, Scalar b) {
  Emitter &e = *a.emitter;
  return wrap(a, a.isFloat() ? e.create<FloatOp>(a.value, b.value)
                             : e.create<IntOp>(a.value, b.value));
}

template <typename FloatOp, typename SignedOp, typename UnsignedOp>
static Scalar arithmetic(Scalar a, Scalar b) {
  return a.isUnsigned() ? arithmetic<FloatOp, UnsignedOp>(a, b)
                        : arithmetic<FloatOp, SignedOp>(a, b);
}

template <typename MathOp> static Scalar unary(Scalar x) {
  return wrap(x, x.emitter->create<MathOp>(x.value));
}

//===----------------------------------------------------------------------===//
// Constants
//===----------------------------------------------------------------------===//

bool Scalar::isUnsigned() const {
  return type.isUnsignedInteger() || type.isInteger(1);
}

Scalar Scalar::like(double number) const {
  return emitter->constant(type, number);
}

std::optional<llvm::APInt> Scalar::getConstant() const {
  llvm::APInt bits;
  if (matchPattern(value, m_ConstantInt(&bits)))
    return bits;
  return std::nullopt;
}

Value Emitter::constant(TypedAttr attribute) {
  Value &known = constants[attribute];
  if (!known) {
    OpBuilder atEntry = OpBuilder::atBlockBegin(entry);
    known = arith::ConstantOp::create(atEntry, loc, attribute);
  }
  return known;
}

Scalar Emitter::constant(Type scalar, double number) {
  if (auto type = dyn_cast<FloatType>(scalar))
    return {this, constant(FloatAttr::get(type, number)), scalar};
  return integer(scalar, static_cast<uint64_t>(static_cast<int64_t>(number)));
}

Scalar Emitter::integer(Type scalar, uint64_t bits) {
  unsigned width = scalar.getIntOrFloatBitWidth();
  llvm::APInt value(64, bits);
  return {this,
          constant(IntegerAttr::get(builder.getIntegerType(width),
                                    value.zextOrTrunc(width))),
          scalar};
}

//===----------------------------------------------------------------------===//
// Arithmetic
//===----------------------------------------------------------------------===//

Scalar operator+(Scalar a, Scalar b) {
  return arithmetic<arith::AddFOp, arith::AddIOp>(a, b);
}

Scalar operator-(Scalar a, Scalar b) {
  return arithmetic<arith::SubFOp, arith::SubIOp>(a, b);
}

Scalar operator*(Scalar a, Scalar b) {
  return arithmetic<arith::MulFOp, arith::MulIOp>(a, b);
}

Scalar operator-(Scalar a) {
  return a.isFloat() ? unary<arith::NegFOp>(a) : a.like(0) - a;
}

namespace {
/// A divisor that is safe to divide by, and where it is not the one given.
struct Divisor {
  Scalar value;
  std::optional<Scalar> replaced;

  explicit Divisor(Scalar b) : value(b) {
    if (auto known = b.getConstant())
      if (!known->isZero() && (b.isUnsigned() || !known->isAllOnes()))
        return;
    if (b.isUnsigned())
      replaced = b == 0;
    else
      replaced = Scalar{b.emitter,
                        b.emitter->create<arith::CmpIOp>(
                            arith::CmpIPredicate::ult, (b + 1).value,
                            b.like(2).value),
                        boolType(b)};
    value = select(*replaced, b.like(1), b);
  }

  /// The quotient, given the quotient by the safe divisor: -a for -1, and zero
  /// for zero. Both are `-a & b`.
  Scalar finish(Scalar a, Scalar b, Scalar quotient) const {
    if (!replaced)
      return quotient;
    Scalar special = b.isUnsigned() ? b.like(0) : -a & b;
    return select(*replaced, special, quotient);
  }
};
} // namespace

Scalar operator/(Scalar a, Scalar b) {
  if (a.isFloat())
    return arithmetic<arith::DivFOp, arith::DivSIOp>(a, b);
  Divisor divisor(b);
  Scalar quotient = arithmetic<arith::DivFOp, arith::DivSIOp, arith::DivUIOp>(
      a, divisor.value);
  return divisor.finish(a, b, quotient);
}

Scalar operator%(Scalar a, Scalar b) {
  if (a.isFloat())
    return arithmetic<arith::RemFOp, arith::RemSIOp>(a, b);
  Divisor divisor(b);
  Scalar rest = arithmetic<arith::RemFOp, arith::RemSIOp, arith::RemUIOp>(
      a, divisor.value);
  // The remainder by the stand-in, 1, is zero already.
  return rest;
}

Scalar floorDivide(Scalar a, Scalar b) {
  if (a.isFloat())
    return floor(a / b);
  if (a.isUnsigned())
    return a / b;
  if (auto known = b.getConstant(); known && known->isStrictlyPositive() &&
                                    known->isPowerOf2())
    return arithmetic<arith::DivFOp, arith::ShRSIOp>(
        a, a.like(known->exactLogBase2()));
  Divisor divisor(b);
  Scalar quotient =
      arithmetic<arith::DivFOp, arith::DivSIOp>(a, divisor.value);
  Scalar rest = a - quotient * divisor.value;
  Scalar roundsUp = (rest != 0) & ((rest ^ divisor.value) < 0);
  return divisor.finish(a, b, select(roundsUp, quotient - 1, quotient));
}

//===----------------------------------------------------------------------===//
// Bits
//===----------------------------------------------------------------------===//

Scalar operator&(Scalar a, Scalar b) {
  return wrap(a, a.emitter->create<arith::AndIOp>(a.value, b.value));
}

Scalar operator|(Scalar a, Scalar b) {
  return wrap(a, a.emitter->create<arith::OrIOp>(a.value, b.value));
}

Scalar operator^(Scalar a, Scalar b) {
  return wrap(a, a.emitter->create<arith::XOrIOp>(a.value, b.value));
}

Scalar operator~(Scalar a) { return a ^ a.emitter->integer(a.type, ~0ull); }

/// True if a shift by `b` leaves nothing of a value of its width; no value if
/// that is known not to happen.
static std::optional<Scalar> isWholeShift(Scalar b) {
  unsigned width = b.getWidth();
  if (auto known = b.getConstant(); known && known->ult(width))
    return std::nullopt;
  return Scalar{b.emitter,
                b.emitter->create<arith::CmpIOp>(arith::CmpIPredicate::uge,
                                                 b.value, b.like(width).value),
                boolType(b)};
}

/// An amount that is not poison. A minimum, not a selection: LLVM 22 takes a
/// selection apart again, and its NVPTX back end then shifts 64-bit values by
/// the low half of the amount.
static Scalar limitShift(Scalar b) {
  Scalar most = b.like(b.getWidth() - 1);
  return wrap(b, b.emitter->create<arith::MinUIOp>(b.value, most.value));
}

Scalar shiftLeft(Scalar a, Scalar b) {
  auto whole = isWholeShift(b);
  Scalar by = whole ? limitShift(b) : b;
  Scalar result = wrap(a, a.emitter->create<arith::ShLIOp>(a.value, by.value));
  return whole ? select(*whole, a.like(0), result) : result;
}

Scalar shiftRight(Scalar a, Scalar b) {
  auto whole = isWholeShift(b);
  Scalar by = whole ? limitShift(b) : b;
  Emitter &e = *a.emitter;
  if (!a.isUnsigned())
    return wrap(a, e.create<arith::ShRSIOp>(a.value, by.value));
  Scalar result = wrap(a, e.create<arith::ShRUIOp>(a.value, by.value));
  return whole ? select(*whole, a.like(0), result) : result;
}

Scalar shiftLeft(Scalar a, unsigned bits) {
  return wrap(a, a.emitter->create<arith::ShLIOp>(a.value, a.like(bits).value));
}

Scalar shiftRightLogical(Scalar a, Scalar bits) {
  return wrap(a, a.emitter->create<arith::ShRUIOp>(a.value, bits.value));
}

Scalar shiftRightLogical(Scalar a, unsigned bits) {
  return shiftRightLogical(a, a.like(bits));
}

//===----------------------------------------------------------------------===//
// Comparison and choice
//===----------------------------------------------------------------------===//

static Scalar compare(Scalar a, Scalar b, arith::CmpFPredicate onFloat,
                      arith::CmpIPredicate onSigned,
                      arith::CmpIPredicate onUnsigned) {
  Emitter &e = *a.emitter;
  Value result =
      a.isFloat()
          ? e.create<arith::CmpFOp>(onFloat, a.value, b.value)
          : e.create<arith::CmpIOp>(a.isUnsigned() ? onUnsigned : onSigned,
                                    a.value, b.value);
  return {&e, result, boolType(a)};
}

#define WARP_COMPARISON(symbol, onFloat, onSigned, onUnsigned)                 \
  Scalar operator symbol(Scalar a, Scalar b) {                                 \
    return compare(a, b, arith::CmpFPredicate::onFloat,                        \
                   arith::CmpIPredicate::onSigned,                             \
                   arith::CmpIPredicate::onUnsigned);                          \
  }
WARP_COMPARISON(<, OLT, slt, ult)
WARP_COMPARISON(<=, OLE, sle, ule)
WARP_COMPARISON(>, OGT, sgt, ugt)
WARP_COMPARISON(>=, OGE, sge, uge)
WARP_COMPARISON(==, OEQ, eq, eq)
WARP_COMPARISON(!=, UNE, ne, ne)
#undef WARP_COMPARISON

Scalar exactly(Scalar x) {
  x.value.getDefiningOp()->setDiscardableAttr(
      exactAttrName, x.emitter->builder.getUnitAttr());
  return x;
}

Scalar select(Scalar condition, Scalar a, Scalar b) {
  if (a.value == b.value)
    return a;
  return wrap(a, a.emitter->create<arith::SelectOp>(condition.value, a.value,
                                                    b.value));
}

Scalar min(Scalar a, Scalar b) {
  return arithmetic<arith::MinNumFOp, arith::MinSIOp, arith::MinUIOp>(a, b);
}

Scalar max(Scalar a, Scalar b) {
  return arithmetic<arith::MaxNumFOp, arith::MaxSIOp, arith::MaxUIOp>(a, b);
}

Scalar abs(Scalar x) {
  if (x.isUnsigned())
    return x;
  return x.isFloat() ? unary<math::AbsFOp>(x) : unary<math::AbsIOp>(x);
}

//===----------------------------------------------------------------------===//
// Functions
//===----------------------------------------------------------------------===//

Scalar fma(Scalar a, Scalar b, Scalar c) {
  return wrap(a, a.emitter->create<math::FmaOp>(a.value, b.value, c.value));
}

Scalar sqrt(Scalar x) { return unary<math::SqrtOp>(x); }
Scalar sin(Scalar x) { return unary<math::SinOp>(x); }
Scalar cos(Scalar x) { return unary<math::CosOp>(x); }
Scalar asin(Scalar x) { return unary<math::AsinOp>(x); }
Scalar acos(Scalar x) { return unary<math::AcosOp>(x); }
Scalar exp(Scalar x) { return unary<math::ExpOp>(x); }
Scalar log(Scalar x) { return unary<math::LogOp>(x); }
Scalar log1p(Scalar x) { return unary<math::Log1pOp>(x); }
Scalar trunc(Scalar x) { return unary<math::TruncOp>(x); }
Scalar floor(Scalar x) { return unary<math::FloorOp>(x); }
Scalar popcount(Scalar x) { return unary<math::CtPopOp>(x); }

Scalar atan2(Scalar y, Scalar x) {
  return wrap(y, y.emitter->create<math::Atan2Op>(y.value, x.value));
}

Scalar copysign(Scalar magnitude, Scalar sign) {
  return wrap(magnitude, magnitude.emitter->create<math::CopySignOp>(
                             magnitude.value, sign.value));
}

Scalar isNan(Scalar x) { return x != x; }

Scalar isInf(Scalar x) {
  return abs(x) == std::numeric_limits<double>::infinity();
}

Scalar isFinite(Scalar x) {
  return abs(x) < std::numeric_limits<double>::infinity();
}

FloatFormat::FloatFormat(Type type) {
  const llvm::fltSemantics &format = cast<FloatType>(type).getFloatSemantics();
  mantissaBits = llvm::APFloat::semanticsPrecision(format) - 1;
  bias = llvm::APFloat::semanticsMaxExponent(format);
}

} // namespace warp::lowering
