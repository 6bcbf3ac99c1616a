//===- BlockVariance.cpp - Divergence within a block ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BlockVariance.h"

#include "KernelFunction.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::tiles {

BlockVariance::BlockVariance(FunctionOpInterface kernel)
    : rank(warp::getVariant(kernel).getRank()),
      threads(getBlockThreads(kernel)),
      isRagged(kernel->hasAttr(warp::attr::ragged)) {
  // To a fixed point, as loops carry values backwards.
  bool changed = true;
  while (changed) {
    changed = false;
    kernel->walk([&](Operation *op) { changed |= visit(op); });
  }
}

bool BlockVariance::mark(ValueRange results) {
  bool changed = false;
  for (Value result : results)
    if (!isTile(result))
      changed |= values.insert(result).second;
  return changed;
}

bool BlockVariance::anyOf(ValueRange operands) const {
  return llvm::any_of(operands, [&](Value v) { return contains(v); });
}

bool BlockVariance::isBlockNumber(Operation *op) const {
  // Both divisions are the same for indices, which are not negative.
  StringRef name = op->getName().getStringRef();
  if (rank != 1 || (name != "warp.floordiv" && name != "warp.div"))
    return false;
  auto tid = op->getOperand(0).getDefiningOp<TidOp>();
  auto divisor = op->getOperand(1).getDefiningOp<ConstantOp>();
  auto number =
      divisor ? dyn_cast<IntegerAttr>(divisor.getValue()) : IntegerAttr();
  if (!tid || !number || tid.getResult(0) != op->getOperand(0))
    return false;
  int64_t extent = number.getValue().getSExtValue();
  return extent > 0 && extent % threads == 0;
}

/// Only the last index of a thread differs within a block, if its
/// extent is that of the block; that is what wp.launch_tiled makes. In ragged
/// blocks all may.
bool BlockVariance::visit(Operation *op) {
  if (auto tid = dyn_cast<TidOp>(op); tid && isRagged)
    return mark(tid.getResults());
  if (auto tid = dyn_cast<TidOp>(op))
    return mark(tid.getResults().drop_front(
        std::min<size_t>(rank - 1, tid.getNumResults())));
  if (isa<TileToThreadsOp, AtomicOp, AtomicCasOp>(op))
    return mark(op->getResults());
  if (isa<TileOpInterface>(op) && op->getNumRegions() != 0)
    return false;
  if (isBlockNumber(op))
    return false;
  if (op->getNumRegions() == 0)
    return !op->hasTrait<OpTrait::IsTerminator>() && anyOf(op->getOperands()) &&
           mark(op->getResults());
  return visitRegions(op);
}

bool BlockVariance::visitRegions(Operation *op) {
  bool changed = false;
  if (auto branch = dyn_cast<scf::IfOp>(op)) {
    bool differs = contains(branch.getCondition());
    for (auto [i, result] : llvm::enumerate(branch.getResults()))
      if (differs || contains(branch.thenYield().getOperand(i)) ||
          contains(branch.elseYield().getOperand(i)))
        changed |= mark(result);
  } else if (auto loop = dyn_cast<scf::ForOp>(op)) {
    bool differs =
        anyOf({loop.getLowerBound(), loop.getUpperBound(), loop.getStep()});
    if (differs)
      changed |= mark(loop.getInductionVar());
    for (auto [init, argument, next, result] :
         llvm::zip(loop.getInitArgs(), loop.getRegionIterArgs(),
                   loop.getYieldedValues(), loop.getResults()))
      if (differs || contains(init) || contains(next)) {
        changed |= mark(argument);
        changed |= mark(result);
      }
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    auto condition = loop.getConditionOp();
    for (auto [init, argument, next] :
         llvm::zip(loop.getInits(), loop.getBeforeArguments(),
                   loop.getYieldOp().getOperands()))
      if (contains(init) || contains(next))
        changed |= mark(argument);
    for (auto [value, argument, result] : llvm::zip(
             condition.getArgs(), loop.getAfterArguments(), loop.getResults()))
      if (contains(condition.getCondition()) || contains(value)) {
        changed |= mark(argument);
        changed |= mark(result);
      }
  }
  return changed;
}

} // namespace warp::tiles
