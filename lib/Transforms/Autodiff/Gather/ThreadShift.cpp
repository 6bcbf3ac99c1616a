//===- ThreadShift.cpp - Thread indices plus constants --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "ThreadShift.h"

#include "IndexMath.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

/// Keeps sums of an index, an offset and the extents of a launch in 32 bits.
constexpr int64_t maxOffset = 1024;

//===----------------------------------------------------------------------===//
// Thread index plus constant
//===----------------------------------------------------------------------===//

std::optional<Shift> getShift(Value value) {
  if (auto cast = value.getDefiningOp<CastOp>()) {
    auto from = dyn_cast<IntegerType>(cast.getSource().getType());
    auto to = dyn_cast<IntegerType>(cast.getType());
    if (!from || !to || !from.isSigned() || !to.isSigned() ||
        from.getWidth() > to.getWidth())
      return std::nullopt;
    return getShift(cast.getSource());
  }
  if (std::optional<unsigned> dimension = getThreadDimension(value))
    return Shift{*dimension, 0};
  Operation *op = value.getDefiningOp();
  if (!isa_and_nonnull<AddOp, SubOp>(op) || !value.getType().isSignedInteger())
    return std::nullopt;
  for (unsigned i : {0, 1}) {
    if (i == 1 && isa<SubOp>(op))
      break;
    std::optional<Shift> shift = getShift(op->getOperand(i));
    std::optional<int64_t> number = getConstantInteger(op->getOperand(1 - i));
    if (!shift || !number || std::abs(*number) > maxOffset)
      continue;
    shift->offset += isa<AddOp>(op) ? *number : -*number;
    return std::abs(shift->offset) > maxOffset ? std::nullopt : shift;
  }
  return std::nullopt;
}

//===----------------------------------------------------------------------===//
// What branches say about thread indices
//===----------------------------------------------------------------------===//

std::optional<int64_t> getLeast(Operation *compare, bool truth,
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

/// The least thread index for which a condition can be `truth`.
static int64_t getLeastIndex(Value condition, bool truth, unsigned dimension) {
  Operation *op = condition.getDefiningOp();
  if (!op)
    return 0;
  auto most = [&](Value a, bool isA, Value b, bool isB) {
    return std::max(getLeastIndex(a, isA, dimension),
                    getLeastIndex(b, isB, dimension));
  };
  if (isa<EqOp, NeOp, LtOp, LeOp, GtOp, GeOp>(op))
    return std::max<int64_t>(0, getLeast(op, truth, dimension).value_or(0));
  if (truth ? isa<BitAndOp>(op) : isa<BitOrOp>(op))
    return most(op->getOperand(0), truth, op->getOperand(1), truth);
  if (isa<UNotOp>(op))
    return getLeastIndex(op->getOperand(0), !truth, dimension);
  auto branch = dyn_cast<scf::IfOp>(op);
  if (!branch)
    return 0;
  unsigned i = cast<OpResult>(condition).getResultNumber();
  Value then = branch.thenYield().getOperand(i);
  Value otherwise = branch.elseYield().getOperand(i);
  std::optional<int64_t> thenIs = getConstantInteger(then);
  std::optional<int64_t> otherwiseIs = getConstantInteger(otherwise);
  if (otherwiseIs && bool(*otherwiseIs) != truth)
    return most(branch.getCondition(), true, then, truth);
  if (thenIs && bool(*thenIs) != truth)
    return most(branch.getCondition(), false, otherwise, truth);
  return 0;
}

bool isNonNegative(Shift index, Operation *op) {
  int64_t least = 0;
  for (Block *block = op->getBlock(); block;) {
    auto branch = dyn_cast<scf::IfOp>(block->getParentOp());
    if (!branch)
      break;
    least = std::max(least, getLeastIndex(branch.getCondition(),
                                          block == branch.thenBlock(),
                                          index.dimension));
    block = branch->getBlock();
  }
  return least + index.offset >= 0;
}

} // namespace warp::autodiff
