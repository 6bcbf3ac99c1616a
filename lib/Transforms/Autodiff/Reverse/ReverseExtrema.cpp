//===- ReverseExtrema.cpp - Adjoints of atomic minima and maxima ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Reverse.h"

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

static Value isForGpu(OpBuilder &builder, Location loc) {
  Type type = builder.getIntegerType(32, true);
  Value none = zero(builder, loc, type);
  auto call = LibraryCallOp::create(builder, loc, type, isCpu, ValueRange());
  return createBuiltin(builder, loc, "eq", {call.getResult(0), none})
      ->getResult(0);
}

/// The gradient for the thread whose value is the extremum, zero for others.
/// Among several with that value the first one gets it, because an exchange
/// leaves zero for the others.
static Value takeIfEqual(OpBuilder &builder, Location loc, Value left,
                         Value value, Value gradient, ValueRange indices) {
  Type type = cast<ArrayType>(gradient.getType()).getElementType();
  Value wins = isLeft(builder, loc, left, value);
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

/// True if all cotangents of the operations before, in the block, come from
/// this minimum or maximum of elements that threads share.
bool ReverseBuilder::isOnlySource(Operation *op) const {
  auto extremum = dyn_cast<AccessOp>(op);
  if (!extremum || extremum.getEffect() != AccessEffect::Update)
    return false;
  std::optional<AtomicKind> kind = extremum.getCombination();
  if (kind != AtomicKind::min && kind != AtomicKind::max)
    return false;
  Value value = extremum.getWritten().front();
  if (isComposite(value.getType()) || !isActive(value) ||
      !activity.isActiveArray(extremum.getArray()) ||
      memory.getUniqueRank(extremum) || !cotangents.getPrimals().empty())
    return false;
  auto isSource = [](Operation *inner) {
    auto access = dyn_cast<AccessOp>(inner);
    bool mayBe = access
                     ? access.mayWrite()
                     : isTileOp(inner) ||
                           isa<func::CallOp, BarrierOp, ScratchStoreOp>(inner);
    return mayBe ? WalkResult::interrupt() : WalkResult::advance();
  };
  for (Operation &before :
       llvm::make_range(op->getBlock()->begin(), op->getIterator()))
    if (before.walk(isSource).wasInterrupted())
      return false;
  return true;
}

/// Reverses the operations up to a minimum or maximum, the only source of
/// their cotangents, in the thread whose value it is. The cotangents of others
/// are zero, and so is what they would add to gradients. Threads of a GPU go
/// on together, so that sums over warps stay.
LogicalResult ReverseBuilder::reverseAsWinner(AccessOp op) {
  Location loc = op.getLoc();
  Value gradient = gradOf(op.getArray()), value = op.getWritten().front();
  SmallVector<Value> indices = recover(op.getIndices());
  Value left = LoadOp::create(builder, loc, value.getType(),
                              recover(op.getArray()), indices);
  Value found = recover(value);
  Value enters = arith::OrIOp::create(
      builder, loc, isLeft(builder, loc, left, found), isForGpu(builder, loc));
  auto draft = scf::IfOp::create(builder, loc, TypeRange(), enters, true);
  OpBuilder::InsertionGuard guard(builder);
  builder.setInsertionPointToStart(draft.thenBlock());
  auto side = inScope([&]() -> LogicalResult {
    addCotangent(value,
                 takeIfEqual(builder, loc, left, found, gradient, indices));
    return reverseUpTo(*op->getBlock(), op->getIterator());
  });
  if (failed(side))
    return failure();
  finishIf(draft, {std::move(*side), Captures()});
  return success();
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
