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
// Of what lies at an address, h is at another one, if that is not 0.
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
// Forward sweep
//===----------------------------------------------------------------------===//

LogicalResult ReverseBuilder::replayLoad(AccessOp op) {
  std::string why;
  bool needsOneThread;
  Recovery recovery = memory.getRecovery(op, why, needsOneThread);
  if (recovery == Recovery::Impossible) {
    if (!logTapes.contains(op))
      return replaySaved(op, why);
    replayLogged(op, options.log->loads.lookup(op));
    return success();
  }
  Value array;
  if (recovery == Recovery::Preserved)
    array = rebase(op.getArray(), [&](Value root) {
      return getHidden(HiddenKind::Preserved, leaves.of(root).front(),
                       root.getType());
    });
  else
    array = recover(op.getArray());
  auto load = LoadOp::create(builder, op.getLoc(), op->getResultTypes(), array,
                             recover(op.getIndices()));
  if (needsOneThread)
    load->setAttr(attr::assumesOneThread, builder.getUnitAttr());
  setRecovered(op.getRead(), load->getResults());
  return success();
}

LogicalResult ReverseBuilder::replayUpdate(AccessOp op) {
  if (op->use_empty())
    return success();
  return replaySaved(op, "what an atomic returns within a loop depends on the "
                         "order of threads; move it out of the loop");
}

/// What the launch overwrote, or what depends on the order of threads: the
/// augmented kernel keeps it, one value per thread. A loop would have to keep
/// one per iteration; there it is marked with the reason for an error.
LogicalResult ReverseBuilder::replaySaved(Operation *op, StringRef why) {
  Location loc = op->getLoc();
  Type type = op->getResult(0).getType();
  Value array;
  SmallVector<Value> indices;
  bool isSaved = !op->getParentOfType<LoopLikeOpInterface>();
  if (isSaved) {
    array = getHidden(HiddenKind::Saved, memory.getNumber(op),
                      ArrayType::get(type.getContext(), 4, type));
    SmallVector<Type> types(4, builder.getIntegerType(32, true));
    llvm::append_range(indices,
                       TidOp::create(builder, loc, types).getResults());
  } else {
    auto access = cast<AccessOp>(op);
    array = recover(access.getArray());
    indices = recover(access.getIndices());
  }
  auto load = LoadOp::create(builder, loc, type, array, indices);
  if (!isSaved)
    load->setAttr(attr::unrecoverable, builder.getStringAttr(why));
  setRecovered(op->getResult(0), load.getResult());
  return success();
}

/// Adds the arguments that hold what loads in loops have read, in the order in
/// which the recording function has them.
void ReverseBuilder::addLog() {
  if (!options.log)
    return;
  MLIRContext *context = builder.getContext();
  Location loc = primal.getLoc();
  Type number = builder.getIntegerType(64, true);
  Type perThread = ArrayType::get(context, 4, number);
  SmallVector<Type> types(4, builder.getIntegerType(32, true));
  auto thread = TidOp::create(builder, loc, types);
  for (int64_t site = 0; site < options.log->sites; ++site) {
    Value offsets = addHidden(HiddenKind::Offsets, site, perThread);
    logOffsets.push_back(
        LoadOp::create(builder, loc, number, offsets, thread.getResults()));
  }
  for (auto &[load, logged] : options.log->loads) {
    Type type = load->getResult(0).getType();
    auto hidden =
        HiddenAttr::get(context, HiddenKind::Tape, logged.site, logged.ordinal);
    logTapes[load] =
        autodiff::addHidden(adjoint, hidden, ArrayType::get(context, 2, type));
    metrics.tapeBytesPerTrip += getByteSize(type);
  }
}

void ReverseBuilder::replayLogged(Operation *op, const LoggedLoad &logged) {
  Location loc = op->getLoc();
  Value offset = logOffsets[logged.site];
  SmallVector<Value> sum{offset, recover(logged.position)};
  Value at = AddOp::create(builder, loc, TypeRange(offset.getType()), sum)
                 ->getResult(0);
  at = CastOp::create(builder, loc, builder.getI64Type(), at);
  auto load =
      LoadOp::create(builder, loc, op->getResult(0).getType(),
                     logTapes.lookup(op), getTapeIndices(builder, loc, at));
  setRecovered(op->getResult(0), load.getResult());
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
  return op->emitOpError("has no derivative: what it leaves depends on the "
                         "order of threads; use 'atomic_add', 'atomic_min' or "
                         "'atomic_max', or a function with a derivative of its "
                         "own");
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
    return op->emitOpError("returns a value that depends on the order of "
                           "threads; a derivative cannot go through it");
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

/// The gradient for the thread whose value is the extremum, zero for others. Of
/// several with that value the first one gets it, because an exchange leaves
/// zero for the others.
static Value takeIfEqual(OpBuilder &builder, Location loc, Value left,
                         Value value, Value gradient, ValueRange indices) {
  Type type = cast<ArrayType>(gradient.getType()).getElementType();
  Value wins =
      createBuiltin(builder, loc, EqOp::getSpec(), {left, value})->getResult(0);
  auto branch = scf::IfOp::create(builder, loc, TypeRange(type), wins, true);
  OpBuilder::InsertionGuard guard(builder);
  builder.setInsertionPointToStart(branch.thenBlock());
  Value none = zero(builder, loc, type);
  Value taken = AtomicOp::create(builder, loc, type, AtomicKind::exch, none,
                                 gradient, indices);
  scf::YieldOp::create(builder, loc, taken);
  builder.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(builder, loc, zero(builder, loc, type));
  return branch.getResult(0);
}

LogicalResult ReverseBuilder::reverseExtremum(AccessOp op, Value gradient,
                                              ValueRange indices) {
  Location loc = op.getLoc();
  Value updating = op.getWritten().front();
  Value value = recover(updating);
  Type type = value.getType();
  Value left =
      LoadOp::create(builder, loc, type, recover(op.getArray()), indices);
  if (!isComposite(type)) {
    addCotangent(updating,
                 takeIfEqual(builder, loc, left, value, gradient, indices));
    return success();
  }
  // Components are updated each on their own.
  auto gradientType = cast<ArrayType>(gradient.getType());
  Type part = ArrayType::get(op->getContext(), gradientType.getRank(),
                             getElementScalar(gradientType.getElementType()));
  for (int64_t i = 0, n = getComponentCount(type); i < n; ++i) {
    auto at = getSlotIndices(builder, loc, type, i);
    auto pick = [&](Value composite) -> Value {
      return ExtractOp::create(builder, loc, getElementScalar(type), composite,
                               at);
    };
    Value view =
        ComponentViewOp::create(builder, loc, part, gradient, at, StringAttr());
    Value taken =
        takeIfEqual(builder, loc, pick(left), pick(value), view, indices);
    if (isActive(updating))
      cotangents.addSlot(builder, loc, updating, i, taken);
  }
  return success();
}

} // namespace warp::autodiff
