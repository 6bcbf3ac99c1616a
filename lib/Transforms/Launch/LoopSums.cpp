//===- LoopSums.cpp - Loops that are reductions only ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LoopSums.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Math/IR/Math.h"

#include "llvm/ADT/SmallPtrSet.h"

using namespace mlir;

namespace {

/// Follows what a loop carries through one iteration.
class SumFinder {
public:
  SumFinder(scf::ForOp loop, bool anyOrder) : loop(loop), anyOrder(anyOrder) {}

  bool isSum(Value value, Value carried);
  /// Uses that lead from what is carried to what is yielded.
  SmallPtrSet<OpOperand *, 8> links;

private:
  bool isOpen(Operation *op);
  bool isSumByOperation(Value value, Value carried);

  /// Answers found, as values may be shared.
  DenseMap<Value, bool> sums;
  scf::ForOp loop;
  bool anyOrder;
};

} // namespace

bool SumFinder::isOpen(Operation *op) {
  auto floats = dyn_cast<arith::ArithFastMathInterface>(op);
  return anyOrder ||
         (floats && floats.getFastMathFlagsAttr() &&
          bitEnumContainsAll(floats.getFastMathFlagsAttr().getValue(),
                             arith::FastMathFlags::reassoc));
}

/// True if `value` is the carried value plus a term, on every path.
bool SumFinder::isSum(Value value, Value carried) {
  if (value == carried)
    return true;
  if (auto known = sums.find(value); known != sums.end())
    return known->second;
  bool result = isSumByOperation(value, carried);
  return sums[value] = result;
}

bool SumFinder::isSumByOperation(Value value, Value carried) {
  Operation *op = value.getDefiningOp();
  if (!op || !loop->isProperAncestor(op))
    return false;
  auto follow = [&](OpOperand &link) {
    if (!isSum(link.get(), carried))
      return false;
    links.insert(&link);
    return true;
  };
  if (isa<arith::AddIOp>(op) || (isa<arith::AddFOp>(op) && isOpen(op)))
    return follow(op->getOpOperand(0)) || follow(op->getOpOperand(1));
  if (isa<arith::SubIOp>(op) || (isa<arith::SubFOp>(op) && isOpen(op)))
    return follow(op->getOpOperand(0));
  if (isa<math::FmaOp>(op) && isOpen(op))
    return follow(op->getOpOperand(2));
  if (isa<arith::SelectOp>(op))
    return follow(op->getOpOperand(1)) && follow(op->getOpOperand(2));
  auto branch = dyn_cast<scf::IfOp>(op);
  if (!branch)
    return false;
  unsigned i = cast<OpResult>(value).getResultNumber();
  return follow(branch.thenYield()->getOpOperand(i)) &&
         follow(branch.elseYield()->getOpOperand(i));
}

bool warp::carriesSums(scf::ForOp loop, bool anyOrder) {
  if (loop.getNumResults() == 0)
    return true;
  for (auto [carried, yielded] : llvm::zip_equal(
           loop.getRegionIterArgs(),
           loop.getBody()->getTerminator()->getOpOperands())) {
    SumFinder finder(loop, anyOrder);
    if (!finder.isSum(yielded.get(), carried))
      return false;
    // Neither it nor what it becomes may be looked at on the way.
    finder.links.insert(&yielded);
    auto isLink = [&](OpOperand &use) { return finder.links.contains(&use); };
    for (OpOperand *link : finder.links)
      if (!llvm::all_of(link->get().getUses(), isLink))
        return false;
    if (!llvm::all_of(carried.getUses(), isLink))
      return false;
  }
  return true;
}
