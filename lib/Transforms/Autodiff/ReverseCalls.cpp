//===- ReverseCalls.cpp - Functions with derivatives of their own ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A function that has an attribute `warp.vjp = @g` is called, not inlined, up
// to here. Its reverse is a call of @g with the same arguments, the residuals
// that it returned, which are the last of its results, and one cotangent for
// each of its other results that has a derivative. @g returns one cotangent
// for every argument that has one. Where `warp.replay = @r` is given, the
// forward sweep of the adjoint calls @r.
//
//===----------------------------------------------------------------------===//

#include "Reverse.h"

#include "WarpDialect/WarpOps.h"

#include "../KernelFunction.h"

using namespace mlir;

namespace warp::autodiff {

static func::FuncOp getCallee(func::CallOp call) {
  auto module = call->getParentOfType<ModuleOp>();
  return module.lookupSymbol<func::FuncOp>(call.getCallee());
}

LogicalResult ReverseBuilder::replayCall(func::CallOp op) {
  func::FuncOp callee = getCallee(op);
  auto replay = callee ? callee->getAttrOfType<FlatSymbolRefAttr>(attr::replay)
                       : FlatSymbolRefAttr();
  auto call = func::CallOp::create(
      builder, op.getLoc(), op.getResultTypes(),
      replay ? replay.getValue() : op.getCallee(), recover(op.getOperands()));
  setRecovered(op.getResults(), call.getResults());
  return success();
}

/// A cotangent as the function takes it: it knows no wider floats.
Value ReverseBuilder::narrow(Value cotangent, Type type) {
  if (cotangent.getType() == type)
    return cotangent;
  return CastOp::create(builder, cotangent.getLoc(), type, cotangent);
}

LogicalResult ReverseBuilder::reverseCall(func::CallOp op) {
  func::FuncOp callee = getCallee(op);
  auto vjp = callee ? callee->getAttrOfType<FlatSymbolRefAttr>(attr::vjp)
                    : FlatSymbolRefAttr();
  if (!vjp)
    return op.emitError("the call of '")
           << op.getCallee() << "' has no derivative: the function is neither "
           << "inlined nor has a pullback";
  auto isArray = [](Value v) { return isa<ArrayType>(v.getType()); };
  auto residuals = callee->getAttrOfType<IntegerAttr>(attr::residuals);
  size_t residualCount = residuals ? residuals.getInt() : 0;
  auto results = op.getResults().drop_back(residualCount);
  bool isSeeded = llvm::any_of(
      results, [&](Value result) { return !cotangents.isZero(result); });
  bool isWanted = llvm::any_of(
      op.getOperands(), [&](Value operand) { return isActive(operand); });
  if (!(isSeeded && isWanted) && llvm::none_of(op.getOperands(), isArray))
    return success();
  SmallVector<Value> operands = recover(op.getOperands());
  llvm::append_range(operands,
                     recover(op.getResults().take_back(residualCount)));
  for (Value result : results)
    if (hasDerivative(result.getType()))
      operands.push_back(narrow(takeCotangentOrZero(result), result.getType()));
  SmallVector<Value> receivers =
      llvm::filter_to_vector(op.getOperands(), [](Value operand) {
        return hasDerivative(operand.getType());
      });
  SmallVector<Type> types(ValueRange(receivers).getTypes());
  auto call = func::CallOp::create(builder, op.getLoc(), types, vjp.getValue(),
                                   operands);
  for (auto [operand, cotangent] : llvm::zip_equal(receivers, call.getResults()))
    addCotangent(operand, widen(builder, op.getLoc(), cotangent));
  return success();
}

} // namespace warp::autodiff
