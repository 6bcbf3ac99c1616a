//===- WarpDialect.cpp - The warp dialect ---------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpDialect.h"
#include "TableFolds.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TileAttributes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/PatternMatch.h"
#include "mlir/Transforms/InliningUtils.h"

using namespace mlir;

#include "WarpDialect/WarpDialect.cpp.inc"

namespace {
/// Functions of a kernel are inlined into it without exception.
struct WarpInlinerInterface : DialectInlinerInterface {
  using DialectInlinerInterface::DialectInlinerInterface;
  bool isLegalToInline(Operation *, Operation *, bool) const final {
    return true;
  }
  bool isLegalToInline(Region *, Region *, bool, IRMapping &) const final {
    return true;
  }
  bool isLegalToInline(Operation *, Region *, bool, IRMapping &) const final {
    return true;
  }
};

/// A struct or long table is printed once, at the top, and goes by its name
/// below.
struct WarpAsmInterface : OpAsmDialectInterface {
  using OpAsmDialectInterface::OpAsmDialectInterface;
  AliasResult getAlias(mlir::Type type, raw_ostream &os) const final {
    auto structure = dyn_cast<warp::StructType>(type);
    if (!structure)
      return AliasResult::NoAlias;
    // The last part of `module.function.<locals>.Name`.
    os << structure.getName().rsplit('.').second;
    if (!structure.getName().contains('.'))
      os << structure.getName();
    return AliasResult::FinalAlias;
  }
  AliasResult getAlias(Attribute attribute, raw_ostream &os) const final {
    auto table = dyn_cast<DenseElementsAttr>(attribute);
    if (!table || table.isSplat() || table.getNumElements() <= mostInline)
      return AliasResult::NoAlias;
    os << "table";
    return AliasResult::OverridableAlias;
  }

  static constexpr int64_t mostInline = 8;
};

/// `scf.if` that only chooses canonicalises to `arith.select`, which would go
/// on to arithmetic that knows no signed integers. Comes first by benefit.
struct SelectBetweenSignedIntegers : OpRewritePattern<arith::SelectOp> {
  explicit SelectBetweenSignedIntegers(MLIRContext *context)
      : OpRewritePattern(context, /*benefit=*/10) {}

  LogicalResult matchAndRewrite(arith::SelectOp op,
                                PatternRewriter &rewriter) const override {
    auto type = dyn_cast<IntegerType>(op.getType());
    if (!type || type.isSignless())
      return failure();
    rewriter.replaceOpWithNewOp<warp::WhereOp>(op, TypeRange(type),
                                               op->getOperands());
    return success();
  }
};
} // namespace

void warp::WarpDialect::getCanonicalizationPatterns(
    RewritePatternSet &patterns) const {
  patterns.add<SelectBetweenSignedIntegers>(patterns.getContext());
  addTablePatterns(patterns);
}

void warp::WarpDialect::initialize() {
  registerAttributes();
  registerTypes();
  registerOps();
  addInterfaces<WarpAsmInterface, WarpInlinerInterface>();
}

Operation *warp::WarpDialect::materializeConstant(OpBuilder &builder,
                                                  Attribute value,
                                                  mlir::Type type,
                                                  Location loc) {
  auto typed = dyn_cast<TypedAttr>(value);
  if (!typed || typed.getType() != type || !isScalar(type))
    return nullptr;
  return ConstantOp::create(builder, loc, typed);
}

/// How many of a function's last results are for its pullback.
static LogicalResult verifyResiduals(Operation *op, Attribute attribute) {
  auto function = dyn_cast<func::FuncOp>(op);
  auto count = dyn_cast<IntegerAttr>(attribute);
  if (!function || !count)
    return op->emitOpError("'warp.residuals' is an integer of a 'func.func'");
  if (count.getInt() < 0 || count.getInt() > function.getNumResults())
    return op->emitOpError("'warp.residuals' is from 0 to the number of "
                           "results, ")
           << function.getNumResults() << ", but is " << count.getInt();
  return success();
}

LogicalResult
warp::WarpDialect::verifyOperationAttribute(Operation *op,
                                            NamedAttribute attribute) {
  if (attribute.getName() == attr::residuals)
    return verifyResiduals(op, attribute.getValue());
  if (attribute.getName() == attr::layout ||
      attribute.getName() == attr::function)
    return verifyTileAttribute(op, attribute);
  if (attribute.getName() != kernelAttrName)
    return success();
  auto function = dyn_cast<func::FuncOp>(op);
  if (!function || !isa<UnitAttr>(attribute.getValue()))
    return op->emitOpError("'warp.kernel' is a unit attribute of a "
                           "'func.func'");
  if (function.getNumResults() != 0)
    return op->emitOpError("a kernel has no results, but this one has ")
           << function.getNumResults();
  for (auto [index, type] : llvm::enumerate(function.getArgumentTypes()))
    if (!isValue(type) && !isThreadScalar(type))
      return op->emitOpError("argument ")
             << index
             << " of a kernel must be a scalar, composite, array or struct, "
                "but is "
             << type;
  return success();
}
