//===- WidenDivisions.cpp - Quotients of integers by lanes ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Processors divide integers one by one. Quotients of 32 bits are exact in
// double precision. Where all lanes have the same divisor, its reciprocal is
// computed once, and rounded up: x r is above x / y by less than a factor of
// 1 + 2^-50, so it is not below a quotient that is whole, and with |x| < 2^32
// not up to the next one. Quotients of 64 bits are the sum of two, where there
// are instructions for such conversions (AVX-512):
//
//   q = [x / y] + [(x - [x / y] y) / y]
//
// for the absolute values, which is off by one at most: the first quotient has
// a relative error of 2^-51, so what is left is below y + 2^13.
//
//===----------------------------------------------------------------------===//

#include "Widening.h"

#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using warp::Widening;

/// The quotient of integers of 32 bits.
Value Widening::divideInDoubles(Value x, Value divisor, bool isSigned) {
  Type f64 = b.getF64Type(), type = x.getType();
  auto toFloat = [&](Value v) -> Value {
    Type wide = isa<VectorType>(v.getType()) ? lanesOf(f64) : f64;
    return isSigned ? arith::SIToFPOp::create(b, loc, wide, v).getResult()
                    : arith::UIToFPOp::create(b, loc, wide, v).getResult();
  };
  auto number = [&](double value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getF64FloatAttr(value));
  };
  Value quotient;
  if (isVarying(divisor)) {
    quotient =
        arith::DivFOp::create(b, loc, toFloat(x), toFloat(vector(divisor)));
  } else {
    Value one =
        arith::DivFOp::create(b, loc, number(1), toFloat(scalar(divisor)));
    Value above = arith::MulFOp::create(b, loc, one, number(1 + 0x1p-51));
    quotient = arith::MulFOp::create(b, loc, toFloat(x), broadcast(above));
  }
  if (isSigned)
    return arith::FPToSIOp::create(b, loc, type, quotient);
  return arith::FPToUIOp::create(b, loc, type, quotient);
}

/// The quotient of signed integers of 64 bits.
Value Widening::divideLong(Value x, Value y) {
  Type wide = lanesOf(b.getF64Type()), type = x.getType();
  Value zero = arith::ConstantOp::create(b, loc, b.getZeroAttr(type));
  Value one = splat(b.getI64IntegerAttr(1));
  auto add = [&](Value a, Value c) -> Value {
    return arith::AddIOp::create(b, loc, a, c);
  };
  auto subtract = [&](Value a, Value c) -> Value {
    return arith::SubIOp::create(b, loc, a, c);
  };
  auto compare = [&](arith::CmpIPredicate how, Value a, Value c) -> Value {
    return arith::CmpIOp::create(b, loc, how, a, c);
  };
  auto isNegative = [&](Value v) {
    return compare(arith::CmpIPredicate::slt, v, zero);
  };
  auto select = [&](Value condition, Value a, Value c) -> Value {
    return arith::SelectOp::create(b, loc, condition, a, c);
  };
  auto absolute = [&](Value v) {
    return select(isNegative(v), subtract(zero, v), v);
  };
  auto remainder = [&](Value a, Value q, Value c) {
    return subtract(a, arith::MulIOp::create(b, loc, q, c));
  };
  // Up to 2^63, without a sign.
  Value u = absolute(x), v = absolute(y);
  Value divisor = arith::UIToFPOp::create(b, loc, wide, v);
  Value first = arith::FPToUIOp::create(
      b, loc, type,
      arith::DivFOp::create(b, loc, arith::UIToFPOp::create(b, loc, wide, u),
                            divisor));
  Value left = remainder(u, first, v);
  Value second = arith::FPToSIOp::create(
      b, loc, type,
      arith::DivFOp::create(b, loc, arith::SIToFPOp::create(b, loc, wide, left),
                            divisor));
  Value quotient = add(first, second), rest = remainder(left, second, v);
  Value isOver = isNegative(rest);
  Value isUnder = compare(arith::CmpIPredicate::uge, rest, v);
  quotient = select(isOver, subtract(quotient, one),
                    select(isUnder, add(quotient, one), quotient));
  Value differs = isNegative(arith::XOrIOp::create(b, loc, x, y));
  return select(differs, subtract(zero, quotient), quotient);
}

/// A lane that is not live must not divide by zero, in an instruction for
/// integers.
void Widening::widenDivision(Operation *op) {
  Type type = op->getResult(0).getType();
  Value x = vector(op->getOperand(0)), y = vector(op->getOperand(1));
  APInt number;
  bool isConstant = matchPattern(op->getOperand(1), m_ConstantInt(&number));
  bool isSigned = isa<arith::DivSIOp, arith::RemSIOp>(op);
  bool isShort = !isConstant && type.isInteger(32);
  bool isLong = !isConstant && type.isInteger(64) && isSigned &&
                getVariant(kernel).getTarget().getBits() >= 512;
  if (!isShort && !isLong) {
    if (!isConstant) {
      y = choose(mask, y, splat(b.getIntegerAttr(type, 1)));
      x = choose(mask, x, splat(b.getIntegerAttr(type, 0)));
    }
    OperationState state(loc, op->getName(), {x, y}, {x.getType()});
    setVector(op->getResult(0), b.create(state)->getResult(0));
    return;
  }
  Value result = isShort ? divideInDoubles(x, op->getOperand(1), isSigned)
                         : divideLong(x, y);
  if (isa<arith::RemSIOp, arith::RemUIOp>(op))
    result = arith::SubIOp::create(b, loc, x,
                                   arith::MulIOp::create(b, loc, result, y));
  setVector(op->getResult(0), result);
}
