//===- Neighbours.cpp - Nearly contiguous accesses of lanes ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If a thread looks at its neighbours, its index is kept inside of the
// array: by a minimum and a maximum, by a remainder, by a choice at the border.
// Then all but a few vectors of lanes have elements that follow each other.
// No constant step says so, but it can be asked when the code runs.
//
//===----------------------------------------------------------------------===//

#include "Neighbours.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using warp::ThreadVariance;

/// Operations from an index back to that of the thread.
constexpr int mostOperations = 6;

static bool mostlyFollows(Value value, const ThreadVariance &variance,
                          int depth = mostOperations) {
  auto isUniform = [&](Value v) {
    return variance.isUniform(v, warp::Scope::Lanes);
  };
  if (variance.step(value) == 1)
    return true;
  Operation *op = value.getDefiningOp();
  if (!op || depth == 0)
    return false;
  auto follows = [&](Value v) { return mostlyFollows(v, variance, depth - 1); };
  if (isa<arith::MinSIOp, arith::MaxSIOp, arith::MinUIOp, arith::MaxUIOp,
          arith::AddIOp>(op)) {
    Value x = op->getOperand(0), y = op->getOperand(1);
    return (isUniform(y) && follows(x)) || (isUniform(x) && follows(y));
  }
  if (isa<arith::SubIOp, arith::RemSIOp, arith::RemUIOp>(op))
    return isUniform(op->getOperand(1)) && follows(op->getOperand(0));
  if (auto choice = dyn_cast<arith::SelectOp>(op)) {
    Value x = choice.getTrueValue(), y = choice.getFalseValue();
    return !isUniform(choice.getCondition()) &&
           ((isUniform(y) && follows(x)) || (isUniform(x) && follows(y)) ||
            (follows(x) && follows(y)));
  }
  return false;
}

/// The number of a row, which is that of the next thread, too, in most cases.
static bool mostlyAgrees(Value value, const ThreadVariance &variance) {
  if (variance.isUniform(value, warp::Scope::Lanes))
    return true;
  Operation *op = value.getDefiningOp();
  return op && isa<arith::DivSIOp, arith::DivUIOp, arith::ShRUIOp>(op) &&
         variance.isUniform(op->getOperand(1), warp::Scope::Lanes) &&
         mostlyFollows(op->getOperand(0), variance);
}

bool warp::areMostlyNeighbours(ValueRange indices,
                               const ThreadVariance &variance) {
  return !indices.empty() && mostlyFollows(indices.back(), variance) &&
         llvm::all_of(indices.drop_back(), [&](Value index) {
           return mostlyAgrees(index, variance);
         });
}
