//===- LoopSchedule.cpp - Loops in tiles of one iteration per lane --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LoopSchedule.h"

#include "mlir/IR/Matchers.h"

using namespace mlir;

bool warp::hasFewerTrips(scf::ForOp loop, int64_t trips) {
  APInt first, last;
  return matchPattern(loop.getLowerBound(), m_ConstantInt(&first)) &&
         matchPattern(loop.getUpperBound(), m_ConstantInt(&last)) &&
         last.getSExtValue() - first.getSExtValue() < trips;
}

bool warp::hasWarpTiles(scf::ForOp loop, const ThreadVariance &variance,
                        llvm::SetVector<Value> &compared) {
  auto isUniform = [&](Value bound) {
    return variance.strideIfEqual(bound, loop, compared) == 0;
  };
  Type type = loop.getInductionVar().getType();
  int64_t warpSize =
      getTarget(loop->getParentOfType<FunctionOpInterface>()).getSubgroupSize();
  return matchPattern(loop.getStep(), m_One()) &&
         !hasFewerTrips(loop, 2 * warpSize) && isa<IntegerType>(type) &&
         type.getIntOrFloatBitWidth() >= 32 &&
         isUniform(loop.getLowerBound()) && isUniform(loop.getUpperBound());
}

Value warp::LoopSchedule::endOfTiles(ArrayRef<Value> compared, int64_t size) {
  Value first = loop.getLowerBound(), last = loop.getUpperBound();
  Value any =
      arith::CmpIOp::create(b, loc,
                            loop.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                                  : arith::CmpIPredicate::slt,
                            first, last);
  Value trips = arith::SubIOp::create(b, loc, last, first);
  trips = bitAnd(trips, constant(counterType(), -size));
  Value together = isWarpTogether(b, loc, compared);
  trips = arith::SelectOp::create(b, loc, bitAnd(any, together), trips,
                                  constant(counterType(), 0));
  return add(first, trips);
}

void warp::LoopSchedule::buildBody(
    scf::ForOp made,
    function_ref<SmallVector<Value>(Value, ValueRange)> build) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(made.getBody());
  SmallVector<Value> yielded =
      build(made.getInductionVar(), made.getRegionIterArgs());
  if (!yielded.empty())
    scf::YieldOp::create(b, made.getLoc(), yielded);
}
