//===- ReverseExtrema.cpp - Adjoints of atomic minima and maxima ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Reverse.h"

#include "WarpDialect/Registry.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

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
