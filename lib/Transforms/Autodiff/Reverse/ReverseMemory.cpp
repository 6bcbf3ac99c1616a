//===- ReverseMemory.cpp - Adjoints of array accesses ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//   primal               adjoint, on the gradient h of the array
//   v = a[i]             h[i] += cot(v)
//   a[i] = v             cot(v) += h[i];  h[i] = 0
//   atomic a[i] += v     cot(v) += h[i]
//   atomic a[i] -= v     cot(v) -= h[i]
//   atomic min, max      if a[i] == v: cot(v) += h[i], taken by one thread
//
// For memory at an address, h is at another one, if that is not 0.
//
// A store ends the life of what the element held before, so its gradient is
// taken and left zero. An array without a gradient gets no code at all.
//
//===----------------------------------------------------------------------===//

#include "Reverse.h"

#include "KernelFunction.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

//===----------------------------------------------------------------------===//
// Arrays
//===----------------------------------------------------------------------===//

/// The type of the same view of another array.
static Type viewType(Value view, Value base, Value newBase) {
  auto type = cast<ArrayType>(view.getType());
  if (base.getType() == newBase.getType())
    return type;
  return ArrayType::get(type.getContext(), type.getRank(),
                        getGradientElement(type.getElementType()));
}

Value ReverseBuilder::rebase(Value array,
                             function_ref<Value(Value)> replaceRoot) {
  auto op = array.getDefiningOp<ArrayViewOp>();
  if (!op)
    return replaceRoot(array);
  Value base = op.getArray();
  Value newBase = rebase(base, replaceRoot);
  SmallVector<Value> operands = recover(op->getOperands());
  operands[0] = newBase;
  Operation *view = op->cloneWithoutRegions();
  view->setOperands(operands);
  view->getResult(0).setType(cast<ArrayType>(viewType(array, base, newBase)));
  builder.insert(view);
  return view->getResult(0);
}

/// Makes the argument, or field of an argument, at the start of the adjoint.
Value ReverseBuilder::recoverRoot(Value root) {
  Operation *op = root.getDefiningOp();
  if (!op)
    return recover(root);
  Operation *get = op->cloneWithoutRegions();
  get->setOperand(0, recoverRoot(op->getOperand(0)));
  builder.insert(get);
  return get->getResult(0);
}

Value ReverseBuilder::gradOf(Value array) {
  return rebase(array, [&](Value root) {
    if (Value address = gradientAddress(root)) {
      auto at = root.getDefiningOp<ArrayAtOp>();
      auto type = cast<ArrayType>(root.getType());
      type = ArrayType::get(type.getContext(), type.getRank(),
                            getGradientElement(type.getElementType()));
      return ArrayAtOp::create(builder, root.getLoc(), type, recover(address),
                               recover(at.getExtents()))
          .getResult();
    }
    Value &gradient = gradients[root];
    if (gradient)
      return gradient;
    OpBuilder::InsertionGuard guard(builder);
    builder.setInsertionPointToStart(&adjoint.getBody().front());
    gradient = GradOp::create(builder, root.getLoc(), recoverRoot(root));
    return gradient;
  });
}

Value ReverseBuilder::getHidden(HiddenKind kind, int64_t leaf, Type type) {
  auto key = std::make_pair(int64_t(kind), leaf);
  auto [found, isNew] = hidden.try_emplace(key, adjoint.getNumArguments());
  return isNew ? addHidden(kind, leaf, type)
               : adjoint.getArgument(found->second);
}

Value ReverseBuilder::addHidden(HiddenKind kind, int64_t leaf, Type type) {
  return autodiff::addHidden(
      adjoint, HiddenAttr::get(builder.getContext(), kind, leaf), type);
}

//===----------------------------------------------------------------------===//
// Reverse sweep
//===----------------------------------------------------------------------===//

LogicalResult ReverseBuilder::reverseAccess(AccessOp op) {
  switch (op.getEffect()) {
  case AccessEffect::Read:
    return reverseRead(op);
  case AccessEffect::Write:
    return reverseWrite(op);
  case AccessEffect::Update:
    return reverseUpdate(op);
  }
  llvm_unreachable("unknown effect");
}

LogicalResult ReverseBuilder::reverseRead(AccessOp op) {
  Value cotangent = takeCotangent(op.getRead().front());
  if (!cotangent)
    return success();
  IntegerAttr unique;
  if (int64_t rank = memory.getUniqueRank(op))
    unique = builder.getI64IntegerAttr(rank);
  auto accumulate = [&] {
    AccumulateOp::create(builder, op.getLoc(), cotangent, gradOf(op.getArray()),
                         recover(op.getIndices()), unique);
    return Value();
  };
  if (Value address = gradientAddress(op.getArray()))
    ifThere(builder, op.getLoc(), recover(address), Type(), accumulate);
  else
    accumulate();
  return success();
}

LogicalResult ReverseBuilder::reverseWrite(AccessOp op) {
  if (!activity.isActiveArray(op.getArray()))
    return success();
  Location loc = op.getLoc();
  Value gradient = gradOf(op.getArray());
  Type type = cast<ArrayType>(gradient.getType()).getElementType();
  SmallVector<Value> indices = recover(op.getIndices());
  if (!hasDerivative(type))
    return success();
  Value value = op.getWritten().front();
  if (isActive(value))
    addCotangent(value, LoadOp::create(builder, loc, type, gradient, indices));
  StoreOp::create(builder, loc, zero(builder, loc, type), gradient, indices);
  return success();
}

static LogicalResult refuseOrder(Operation *op) {
  return op->emitOpError("has no derivative: its result depends on the order "
                         "of threads; use 'atomic_add', 'atomic_min' or "
                         "'atomic_max', or a function with a derivative of its "
                         "own");
}

LogicalResult refuseReturned(Location atomic) {
  return emitError(atomic)
         << "what an atomic returns depends on the order of threads, unless "
            "the element belongs to one of them; a derivative cannot go "
            "through it";
}

LogicalResult ReverseBuilder::reverseUpdate(AccessOp op) {
  Value value = op.getWritten().front();
  // It takes part if it leaves a float in an array with a gradient.
  if (!activity.isActiveArray(op.getArray()) || !hasDerivative(value.getType()))
    return success();
  Location loc = op.getLoc();
  std::optional<AtomicKind> kind = op.getCombination();
  if (!kind)
    return refuseOrder(op);
  if (!llvm::all_of(op.getRead(),
                    [&](Value old) { return cotangents.isZero(old); }))
    return refuseReturned(op.getLoc());
  Value gradient = gradOf(op.getArray());
  Type type = cast<ArrayType>(gradient.getType()).getElementType();
  SmallVector<Value> indices = recover(op.getIndices());
  switch (*kind) {
  case AtomicKind::add:
  case AtomicKind::sub: {
    if (!isActive(value))
      return success();
    Value g = LoadOp::create(builder, loc, type, gradient, indices);
    if (kind == AtomicKind::sub)
      g = NegOp::create(builder, loc, type, g)->getResult(0);
    addCotangent(value, g);
    return success();
  }
  case AtomicKind::min:
  case AtomicKind::max:
    return reverseExtremum(op, gradient, indices);
  default:
    return refuseOrder(op);
  }
}

} // namespace warp::autodiff
