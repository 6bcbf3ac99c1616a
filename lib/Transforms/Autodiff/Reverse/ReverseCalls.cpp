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

#include "Analysis/Effects.h"

#include "WarpDialect/WarpOps.h"

#include "KernelFunction.h"

using namespace mlir;

namespace warp::autodiff {

static func::FuncOp getCallee(func::CallOp call) {
  auto module = call->getParentOfType<ModuleOp>();
  return module.lookupSymbol<func::FuncOp>(call.getCallee());
}

/// Takes what a function writes out of it; what an atomic returns can't be had.
static void removeEffects(func::FuncOp function) {
  function.walk([](Operation *op) {
    if (!isObservable(op))
      return;
    if (op->getNumResults() == 0)
      return op->erase();
    auto update = cast<AccessOp>(op);
    OpBuilder builder(op);
    auto load =
        LoadOp::create(builder, op->getLoc(), op->getResult(0).getType(),
                       update.getArray(), update.getIndices());
    load->setAttr(attr::unrecoverable,
                  builder.getStringAttr(
                      "what an atomic returns depends on the order of threads; "
                      "give the function a replay function"));
    op->getResult(0).replaceAllUsesWith(load);
    op->erase();
  });
}

/// The function that the forward sweep calls: the one that was named for it,
/// or the callee without its effects.
static StringRef getReplayed(func::FuncOp callee) {
  if (auto replay = callee->getAttrOfType<FlatSymbolRefAttr>(attr::replay))
    return replay.getValue();
  bool writes = callee
                    .walk([](Operation *op) {
                      return isObservable(op) ? WalkResult::interrupt()
                                              : WalkResult::advance();
                    })
                    .wasInterrupted();
  if (!writes)
    return callee.getName();
  auto module = callee->getParentOfType<ModuleOp>();
  std::string name = (callee.getName() + "_values").str();
  auto twin = module.lookupSymbol<func::FuncOp>(name);
  if (!twin) {
    twin = callee.clone();
    twin.setName(name);
    removeEffects(twin);
    module.insert(callee, twin);
  }
  return twin.getName();
}

LogicalResult ReverseBuilder::replayCall(func::CallOp op) {
  func::FuncOp callee = getCallee(op);
  if (!callee)
    return op.emitError("expects a function '") << op.getCallee() << "'";
  auto call =
      func::CallOp::create(builder, op.getLoc(), op.getResultTypes(),
                           getReplayed(callee), recover(op.getOperands()));
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
  if (!(isSeeded && isWanted) && llvm::none_of(op.getOperands(), isArray)) {
    for (Value result : results)
      (void)cotangents.takeParts(result);
    return success();
  }
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
  for (auto [operand, cotangent] :
       llvm::zip_equal(receivers, call.getResults()))
    addCotangent(operand, widen(builder, op.getLoc(), cotangent));
  return success();
}

} // namespace warp::autodiff
