//===- GatherGuard.cpp - Bounds of gathered contributions -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GatherGuard.h"

#include "Analysis/Effects.h"
#include "Analysis/ThreadVariance.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

Value GatherEmitter::number(int64_t value) {
  auto attr = b.getIntegerAttr(tid.getResult(0).getType(), value);
  return ConstantOp::create(b, loc, attr);
}

Value GatherEmitter::truth(bool value) {
  return ConstantOp::create(b, loc, b.getBoolAttr(value));
}

Value GatherEmitter::isAtLeast(unsigned dimension, int64_t bound) {
  return make<GeOp>(b.getI1Type(), {tid.getResult(dimension), number(bound)});
}

Value GatherEmitter::both(Value left, Value right) {
  if (!left || !right)
    return left ? left : right;
  return make<BitAndOp>(b.getI1Type(), {left, right});
}

Value GatherEmitter::limitOf(Value bound, int64_t distance) {
  Value &limit = limits[{bound.getAsOpaquePointer(), distance}];
  if (limit)
    return limit;
  Value found = makeUniform(bound);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointAfterValue(found);
  if (isa<BlockArgument>(found))
    b.setInsertionPointAfter(tid);
  Type type = bound.getType();
  found = make<MaxOp>(type, {found, number(distance)});
  found = make<MinOp>(type, {found, number(1 << 30)});
  return limit = make<SubOp>(type, {found, number(distance)});
}

bool isSpeculatable(Value value) {
  Operation *op = value.getDefiningOp();
  if (!op)
    return true;
  return !op->walk([&](Operation *inner) {
              bool isLoad = isPlainRead(inner);
              for (Value operand : inner->getOperands())
                if (isLoad || (!op->isAncestor(
                                   operand.getParentRegion()->getParentOp()) &&
                               !isSpeculatable(operand)))
                  return WalkResult::interrupt();
              return WalkResult::advance();
            }).wasInterrupted();
}

/// The least thread index for which a comparison with a constant holds, or does
/// not, as far as it says so by a lower bound or equality; indices are not
/// negative.
static std::optional<int64_t> getLeast(Operation *compare, bool truth,
                                       unsigned dimension) {
  Value left = compare->getOperand(0), right = compare->getOperand(1);
  std::optional<Shift> shift = getShift(left);
  bool isSwapped = !shift;
  if (isSwapped) {
    std::swap(left, right);
    shift = getShift(left);
  }
  std::optional<int64_t> number = getConstantInteger(right);
  if (!shift || !number || shift->dimension != dimension)
    return std::nullopt;
  int64_t bound = *number - shift->offset;
  if (isa<EqOp, NeOp>(compare)) {
    if (isa<EqOp>(compare) == truth)
      return bound;
    return bound == 0 ? std::optional<int64_t>(1) : std::nullopt;
  }
  bool isGreater = isa<GtOp, GeOp>(compare) != isSwapped;
  bool isStrict = isa<GtOp, LtOp>(compare);
  if (isGreater != truth)
    return std::nullopt;
  return bound + (truth == isStrict);
}

/// Adds a comparison of a thread index with a value that is the same in all
/// threads; false if it is not of that form.
bool Guard::addComparison(GatherEmitter &emitter, Operation *op, bool holds) {
  std::optional<Shift> shift = getShift(op->getOperand(0));
  bool isSwapped = !shift;
  if (isSwapped)
    shift = getShift(op->getOperand(1));
  Value bound = op->getOperand(isSwapped ? 0 : 1);
  Type type = emitter.tid.getResult(0).getType();
  if (!shift || bound.getType() != type ||
      op->getOperand(isSwapped).getType() != type)
    return false;
  unsigned dimension = shift->dimension;
  if (std::optional<int64_t> from = getLeast(op, holds, dimension)) {
    least[dimension] = std::max(least[dimension], *from);
    return !isa<EqOp, NeOp>(op) || isa<EqOp>(op) != holds;
  }
  if (!isa<LtOp, LeOp, GtOp, GeOp>(op) ||
      (isa<LtOp, LeOp>(op) != isSwapped) != holds || !isUniform(bound) ||
      !isSpeculatable(bound))
    return false;
  // index + offset < bound, or <=; no launch reaches the larger limit.
  bool isStrict = isa<LtOp, GtOp>(op) == holds;
  Value limit = emitter.limitOf(bound, shift->offset - !isStrict);
  if (!llvm::is_contained(bounds[dimension], limit))
    bounds[dimension].push_back(limit);
  return true;
}

void Guard::add(GatherEmitter &emitter, Value condition, bool holds,
                Clone clone) {
  Operation *op = condition.getDefiningOp();
  if (op && (holds ? isa<BitAndOp>(op) : isa<BitOrOp>(op))) {
    add(emitter, op->getOperand(0), holds, clone);
    return add(emitter, op->getOperand(1), holds, clone);
  }
  if (isa_and_nonnull<UNotOp>(op))
    return add(emitter, op->getOperand(0), !holds, clone);
  if (auto branch = dyn_cast_or_null<scf::IfOp>(op)) {
    unsigned i = cast<OpResult>(condition).getResultNumber();
    Value then = branch.thenYield().getOperand(i);
    Value otherwise = branch.elseYield().getOperand(i);
    for (bool taken : {true, false}) {
      auto other = getConstantInteger(taken ? otherwise : then);
      if (!other || bool(*other) == holds)
        continue;
      add(emitter, branch.getCondition(), taken, clone);
      return add(emitter, taken ? then : otherwise, holds, clone);
    }
  }
  if (op && isa<EqOp, NeOp, LtOp, LeOp, GtOp, GeOp>(op) &&
      addComparison(emitter, op, holds))
    return;
  Value value = clone(condition);
  if (!holds)
    value = emitter.make<UNotOp>(value.getType(), {value});
  rest = emitter.both(rest, value);
}

Value Guard::build(GatherEmitter &emitter, ArrayRef<int64_t> back,
                   ArrayRef<int64_t> halo) const {
  return emitter.both(build(emitter, back, halo, 0, least.size()), rest);
}

Value Guard::build(GatherEmitter &emitter, ArrayRef<int64_t> back,
                   ArrayRef<int64_t> halo, unsigned first,
                   unsigned dimensionsEnd) const {
  Value all;
  for (unsigned i = first; i < dimensionsEnd; ++i) {
    if (int64_t from = least[i] + back[i]; from > 0)
      all = emitter.both(all, emitter.isAtLeast(i, from));
    SmallVector<Value, 2> ends = bounds[i];
    if (!extents.empty() && back[i] < halo[i])
      ends.push_back(extents[i]);
    if (ends.empty())
      continue;
    Value end = ends.front(), index = emitter.tid.getResult(i);
    for (Value other : llvm::drop_begin(ends))
      end = emitter.make<MinOp>(end.getType(), {end, other});
    if (back[i])
      end = emitter.make<AddOp>(end.getType(), {end, emitter.number(back[i])});
    all = emitter.both(all,
                       emitter.make<LtOp>(emitter.b.getI1Type(), {index, end}));
  }
  return all;
}

} // namespace warp::autodiff
