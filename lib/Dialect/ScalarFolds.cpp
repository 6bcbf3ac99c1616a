//===- ScalarFolds.cpp - Simplification of scalar operations --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Constants are computed exactly as the target computes them: integers wrap,
// floats round once, to nearest even. Identities are used where they hold for
// every value, so `x + 0` is folded for integers but not for floats, where it
// would turn -0 into 0.
//
//===----------------------------------------------------------------------===//

#include "TableFolds.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Matchers.h"
#include "llvm/ADT/APSInt.h"

using namespace mlir;

OpFoldResult warp::ConstantOp::fold(FoldAdaptor) { return getValue(); }

//===----------------------------------------------------------------------===//
// Casts
//===----------------------------------------------------------------------===//

static bool isUnsigned(mlir::Type type) {
  return type.isUnsignedInteger() || warp::isBool(type);
}

static const llvm::fltSemantics &getSemantics(mlir::Type type) {
  return cast<FloatType>(type).getFloatSemantics();
}

static unsigned getWidth(mlir::Type type) {
  // `index` attributes are kept in 64 bits.
  return isa<IndexType>(type) ? 64 : type.getIntOrFloatBitWidth();
}

/// A float as an integer: saturated, NaN as zero.
static APInt toInteger(const APFloat &value, mlir::Type type) {
  llvm::APSInt result(getWidth(type), isUnsigned(type));
  bool isExact;
  if (value.isNaN())
    return APInt::getZero(getWidth(type));
  value.convertToInteger(result, APFloat::rmTowardZero, &isExact);
  return result;
}

Attribute warp::castConstant(Attribute value, mlir::Type from, mlir::Type to) {
  if (auto number = dyn_cast<FloatAttr>(value)) {
    APFloat real = number.getValue();
    if (warp::isBool(to))
      return BoolAttr::get(to.getContext(), !real.isZero());
    if (!isa<FloatType>(to))
      return IntegerAttr::get(to, toInteger(real, to));
    bool losesInfo;
    real.convert(getSemantics(to), APFloat::rmNearestTiesToEven, &losesInfo);
    return FloatAttr::get(to, real);
  }
  auto number = dyn_cast<IntegerAttr>(value);
  if (!number)
    return {};
  APInt integer = number.getValue();
  if (warp::isBool(to))
    return BoolAttr::get(to.getContext(), !integer.isZero());
  if (isa<FloatType>(to)) {
    APFloat real(getSemantics(to));
    real.convertFromAPInt(integer, !isUnsigned(from),
                          APFloat::rmNearestTiesToEven);
    return FloatAttr::get(to, real);
  }
  return IntegerAttr::get(to, isUnsigned(from)
                                  ? integer.zextOrTrunc(getWidth(to))
                                  : integer.sextOrTrunc(getWidth(to)));
}

OpFoldResult warp::CastOp::fold(FoldAdaptor adaptor) {
  mlir::Type from = getSource().getType(), to = getResult().getType();
  if (from == to)
    return getSource();
  if (Attribute value = adaptor.getSource())
    return castConstant(value, from, to);
  // An integer that went through another of at least its width is unchanged.
  auto inner = getSource().getDefiningOp<CastOp>();
  if (!inner || inner.getSource().getType() != to)
    return {};
  auto isNumber = [](mlir::Type type) {
    return warp::isInteger(type) || isa<IndexType>(type);
  };
  if (isNumber(to) && isNumber(from) && getWidth(from) >= getWidth(to))
    return inner.getSource();
  return {};
}

//===----------------------------------------------------------------------===//
// Arithmetic
//===----------------------------------------------------------------------===//

using FloatFunction = APFloat (*)(const APFloat &, const APFloat &);
using IntegerFunction = APInt (*)(const APInt &, const APInt &);

/// The constant result of a binary operation on scalar constants, or null.
static Attribute foldConstants(ArrayRef<Attribute> args, FloatFunction onFloats,
                               IntegerFunction onIntegers) {
  if (args.size() != 2 || !args[0] || !args[1])
    return {};
  auto floatA = dyn_cast<FloatAttr>(args[0]);
  auto floatB = dyn_cast<FloatAttr>(args[1]);
  if (floatA && floatB && floatA.getType() == floatB.getType())
    return FloatAttr::get(floatA.getType(),
                          onFloats(floatA.getValue(), floatB.getValue()));
  auto integerA = dyn_cast<IntegerAttr>(args[0]);
  auto integerB = dyn_cast<IntegerAttr>(args[1]);
  if (integerA && integerB && integerA.getType() == integerB.getType())
    return IntegerAttr::get(
        integerA.getType(),
        onIntegers(integerA.getValue(), integerB.getValue()));
  return {};
}

static bool isIntegerConstant(Attribute value, int64_t expected) {
  auto integer = dyn_cast_or_null<IntegerAttr>(value);
  return integer &&
         integer.getValue() == APInt(integer.getValue().getBitWidth(), expected,
                                     /*isSigned=*/true, /*implicitTrunc=*/true);
}

static bool isFloatConstant(Attribute value, double expected) {
  auto number = dyn_cast_or_null<FloatAttr>(value);
  return number && number.getValue().isExactlyValue(expected);
}

/// Appends a fold's only result, if there is one.
static LogicalResult give(OpFoldResult result,
                          SmallVectorImpl<OpFoldResult> &results) {
  if (!result)
    return failure();
  results.push_back(result);
  return success();
}

LogicalResult warp::AddOp::fold(FoldAdaptor adaptor,
                                SmallVectorImpl<OpFoldResult> &results) {
  ArrayRef<Attribute> args = adaptor.getArgs();
  if (isIntegerConstant(args[1], 0))
    return give(getArgs()[0], results);
  if (isIntegerConstant(args[0], 0))
    return give(getArgs()[1], results);
  return give(foldConstants(
                  args,
                  [](const APFloat &a, const APFloat &b) { return a + b; },
                  [](const APInt &a, const APInt &b) { return a + b; }),
              results);
}

LogicalResult warp::SubOp::fold(FoldAdaptor adaptor,
                                SmallVectorImpl<OpFoldResult> &results) {
  ArrayRef<Attribute> args = adaptor.getArgs();
  if (isIntegerConstant(args[1], 0) || isFloatConstant(args[1], 0.0))
    return give(getArgs()[0], results);
  return give(foldConstants(
                  args,
                  [](const APFloat &a, const APFloat &b) { return a - b; },
                  [](const APInt &a, const APInt &b) { return a - b; }),
              results);
}

LogicalResult warp::MulOp::fold(FoldAdaptor adaptor,
                                SmallVectorImpl<OpFoldResult> &results) {
  ArrayRef<Attribute> args = adaptor.getArgs();
  mlir::Type result = getResult(0).getType();
  for (unsigned i : {0, 1}) {
    mlir::Value other = getArgs()[1 - i];
    if (other.getType() != result)
      continue;
    if (isIntegerConstant(args[i], 1) || isFloatConstant(args[i], 1.0))
      return give(other, results);
    if (isIntegerConstant(args[i], 0) && isInteger(result))
      return give(args[i], results);
  }
  return give(foldConstants(
                  args,
                  [](const APFloat &a, const APFloat &b) { return a * b; },
                  [](const APInt &a, const APInt &b) { return a * b; }),
              results);
}

LogicalResult warp::NegOp::fold(FoldAdaptor adaptor,
                                SmallVectorImpl<OpFoldResult> &results) {
  Attribute arg = adaptor.getArgs()[0];
  if (auto number = dyn_cast_or_null<FloatAttr>(arg))
    return give(FloatAttr::get(number.getType(), -number.getValue()), results);
  if (auto number = dyn_cast_or_null<IntegerAttr>(arg))
    return give(IntegerAttr::get(number.getType(), -number.getValue()),
                results);
  if (auto inner = getArgs()[0].getDefiningOp<NegOp>())
    return give(inner.getArgs()[0], results);
  return failure();
}

LogicalResult warp::PosOp::fold(FoldAdaptor,
                                SmallVectorImpl<OpFoldResult> &results) {
  return give(getArgs()[0], results);
}

//===----------------------------------------------------------------------===//
// Logic
//===----------------------------------------------------------------------===//

LogicalResult warp::UNotOp::fold(FoldAdaptor adaptor,
                                 SmallVectorImpl<OpFoldResult> &results) {
  if (auto number = dyn_cast_or_null<IntegerAttr>(adaptor.getArgs()[0]))
    return give(BoolAttr::get(getContext(), number.getValue().isZero()),
                results);
  auto inner = getArgs()[0].getDefiningOp<UNotOp>();
  if (inner && isBool(inner.getArgs()[0].getType()))
    return give(inner.getArgs()[0], results);
  return failure();
}
