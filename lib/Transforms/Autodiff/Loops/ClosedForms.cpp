//===- ClosedForms.cpp - Closed forms of carried values -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Rank 1 is for what does not change in a loop, and for integers that a step is
// added to in every iteration: the number of the iteration gives the value.
//
//===----------------------------------------------------------------------===//

#include "LoopReversal.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp::autodiff;

/// The operand that is added to a state in every iteration, or subtracted from
/// it, if it is always the same.
Value LoopReversal::findStep(unsigned state, bool &isNegative) {
  Value now = getStates()[state], next = trace(getNexts()[state]);
  Operation *op = next.getDefiningOp();
  if (!isa_and_nonnull<warp::AddOp, warp::SubOp>(op) ||
      !isa<IntegerType>(next.getType()))
    return nullptr;
  isNegative = isa<warp::SubOp>(op);
  bool isSecond = !isNegative && trace(op->getOperand(1)) == now;
  if (!isSecond && trace(op->getOperand(0)) != now)
    return nullptr;
  Value step = op->getOperand(isSecond ? 0 : 1);
  bool isOutside = !loop->isAncestor(step.getParentRegion()->getParentOp());
  bool isConstant = step.getDefiningOp<warp::ConstantOp>() != nullptr;
  return isOutside || isConstant ? step : nullptr;
}

bool LoopReversal::hasClosedForm(unsigned state) {
  bool isNegative;
  return trace(getNexts()[state]) == getStates()[state] ||
         findStep(state, isNegative);
}

Value LoopReversal::closedForm(unsigned state, Value number) {
  Value now = getStates()[state];
  if (trace(getNexts()[state]) == now)
    return reverse.recover(getInits()[state]);
  bool isNegative = false;
  Value step = findStep(state, isNegative);
  if (!step)
    return nullptr;
  Operation *definition = step.getDefiningOp();
  if (definition && loop->isAncestor(definition))
    step = b.clone(*definition)->getResult(0);
  else
    step = reverse.recover(step);
  Type type = now.getType();
  Value count = number;
  if (type.getIntOrFloatBitWidth() > number.getType().getIntOrFloatBitWidth())
    count = arith::ExtUIOp::create(b, loc, b.getI64Type(), count);
  count = CastOp::create(b, loc, type, count);
  Value moved = MulOp::create(b, loc, TypeRange(type), ValueRange{count, step})
                    ->getResult(0);
  Value init = reverse.recover(getInits()[state]);
  SmallVector<Value> sum{init, moved};
  return isNegative ? SubOp::create(b, loc, TypeRange(type), sum)->getResult(0)
                    : AddOp::create(b, loc, TypeRange(type), sum)->getResult(0);
}

/// Gives needed states that a formula has their value; returns the others.
SmallVector<unsigned> LoopReversal::resolveFree() {
  OpBuilder::InsertionGuard guard(b);
  SmallVector<unsigned> needed;
  for (auto [i, value] : llvm::enumerate(placeholders)) {
    if (value.use_empty())
      continue;
    b.setInsertionPointAfterValue(value);
    if (!hasClosedForm(i)) {
      needed.push_back(i);
      continue;
    }
    value.replaceAllUsesWith(closedForm(i, number));
    note({unsigned(i)}, RecoveryRank::ClosedForm, 0);
  }
  return needed;
}
