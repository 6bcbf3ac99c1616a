//===- Convert.cpp - Conversions between scalar types ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Conversions are total: float to integer saturates and sends NaN to zero. The
// 16-bit floats convert by way of f32, as their arithmetic does.
//
//===----------------------------------------------------------------------===//

#include "RareBranch.h"
#include "Scalar.h"

#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/Support/FormatVariadic.h"

using namespace mlir;

namespace warp::lowering {

template <typename OpTy> static Scalar castBy(Scalar x, Type to) {
  return {x.emitter, x.emitter->create<OpTy>(getSignless(to), x.value), to};
}

static Scalar floatToFloat(Scalar x, Type to) {
  unsigned from = x.getWidth(), width = to.getIntOrFloatBitWidth();
  if (from < width)
    return castBy<arith::ExtFOp>(x, to);
  if (from == width || (from == 64 && width == 16))
    x = floatToFloat(x, Float32Type::get(to.getContext()));
  // Rounding back what was widened gives the number it came from.
  if (auto widened = x.value.getDefiningOp<arith::ExtFOp>();
      widened && widened.getIn().getType() == to)
    return {x.emitter, widened.getIn(), to};
  return castBy<arith::TruncFOp>(x, to);
}

/// The intrinsics saturate and send NaN to zero by definition.
static Scalar floatToInteger(Scalar x, Type to) {
  Emitter &e = *x.emitter;
  std::string name =
      llvm::formatv("llvm.fpto{0}.sat.i{1}.f{2}",
                    to.isUnsignedInteger() ? "ui" : "si",
                    to.getIntOrFloatBitWidth(), x.getWidth());
  auto call = LLVM::CallIntrinsicOp::create(e.builder, e.loc, getSignless(to),
                                            e.builder.getStringAttr(name),
                                            ValueRange(x.value));
  return {&e, call.getResults(), to};
}

static Scalar integerToInteger(Scalar x, Type to) {
  if (isa<IndexType>(x.type) || isa<IndexType>(to))
    return x.isUnsigned() || to.isUnsignedInteger()
               ? castBy<arith::IndexCastUIOp>(x, to)
               : castBy<arith::IndexCastOp>(x, to);
  unsigned from = x.getWidth(), width = to.getIntOrFloatBitWidth();
  if (from == width)
    return {x.emitter, x.value, to};
  if (from > width)
    return castBy<arith::TruncIOp>(x, to);
  return x.isUnsigned() ? castBy<arith::ExtUIOp>(x, to)
                        : castBy<arith::ExtSIOp>(x, to);
}

Scalar convert(Scalar x, Type to) {
  if (x.type == to)
    return x;
  bool toFloat = isa<FloatType>(to);
  if (isBool(to))
    return x != 0;
  if (!x.isFloat() && !toFloat)
    return integerToInteger(x, to);
  bool narrow = (x.isFloat() ? x.type : to).getIntOrFloatBitWidth() < 32;
  Type single = Float32Type::get(to.getContext());
  if (!x.isFloat()) {
    Type wide = narrow ? single : to;
    Scalar result = x.isUnsigned() ? castBy<arith::UIToFPOp>(x, wide)
                                   : castBy<arith::SIToFPOp>(x, wide);
    return convert(result, to);
  }
  if (toFloat)
    return floatToFloat(x, to);
  return floatToInteger(narrow ? convert(x, single) : x, to);
}

Scalar reinterpret(Scalar x, Type to) {
  if (x.value.getType() == getSignless(to))
    return {x.emitter, x.value, to};
  return castBy<arith::BitcastOp>(x, to);
}

Type getBitsType(Type scalar) {
  return IntegerType::get(scalar.getContext(), scalar.getIntOrFloatBitWidth(),
                          IntegerType::Unsigned);
}

Scalars branch(Scalar condition, ArrayRef<Scalar> common,
               llvm::function_ref<Scalars()> rare) {
  Emitter &e = *condition.emitter;
  SmallVector<Type> types;
  SmallVector<Value> values;
  for (Scalar x : common) {
    types.push_back(x.value.getType());
    values.push_back(x.value);
  }
  auto ifOp = scf::IfOp::create(e.builder, e.loc, types, condition.value,
                                /*addThenBlock=*/true, /*addElseBlock=*/true);
  ifOp->setAttr(attr::rare, e.builder.getUnitAttr());
  OpBuilder::InsertionGuard guard(e.builder);
  e.builder.setInsertionPointToStart(ifOp.elseBlock());
  scf::YieldOp::create(e.builder, e.loc, values);

  e.builder.setInsertionPointToStart(ifOp.thenBlock());
  Scalars result = rare();
  values.clear();
  for (Scalar x : result)
    values.push_back(x.value);
  scf::YieldOp::create(e.builder, e.loc, values);
  for (auto [scalar, value] : llvm::zip_equal(result, ifOp.getResults()))
    scalar.value = value;
  return result;
}

} // namespace warp::lowering
