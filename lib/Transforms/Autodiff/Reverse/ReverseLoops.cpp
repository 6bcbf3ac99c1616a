//===- ReverseLoops.cpp - Reversal of counted loops -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The number of trips follows from the bounds. Iterations are numbered from
// zero in an unsigned integer, of 32 bits where nothing can overflow.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/Loops/LoopReversal.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using namespace warp::autodiff;

/// The constant that a bound is, maybe after a change of its sign.
static std::optional<int64_t> knownBound(Value bound) {
  APInt value;
  while (auto cast = bound.getDefiningOp<warp::CastOp>()) {
    if (!isa<IntegerType>(cast.getSource().getType()))
      return std::nullopt;
    bound = cast.getSource();
  }
  if (!matchPattern(bound, m_ConstantInt(&value)))
    return std::nullopt;
  return bound.getType().isUnsignedInteger()
             ? static_cast<int64_t>(value.getZExtValue())
             : value.getSExtValue();
}

namespace {

class ForReversal : public LoopReversal {
public:
  ForReversal(ReverseBuilder &reverse, scf::ForOp op)
      : LoopReversal(reverse, op), op(op),
        lower(knownBound(op.getLowerBound())),
        upper(knownBound(op.getUpperBound())), step(knownBound(op.getStep())) {
  }

  LogicalResult run();

private:
  ValueRange getStates() override { return op.getRegionIterArgs(); }
  ValueRange getNexts() override { return op.getYieldedValues(); }
  ValueRange getInits() override { return op.getInitArgs(); }
  Value getFinal(unsigned state) override {
    return reverse.recover(op.getResult(state));
  }
  Value getCounter() override { return op.getInductionVar(); }
  void recoverIteration(Value number) override;
  LogicalResult replayIteration() override {
    return reverse.replay(*op.getBody());
  }
  LogicalResult reverseIteration() override {
    return reverse.reverse(*op.getBody());
  }

  Value countTrips();
  Value widen(Value bound, Type type);

  scf::ForOp op;
  std::optional<int64_t> lower, upper, step;
};

} // namespace

Value ForReversal::widen(Value bound, Type type) {
  if (bound.getType() == type)
    return bound;
  if (isa<IndexType>(bound.getType()))
    return arith::IndexCastOp::create(b, loc, type, bound);
  if (op.getUnsignedCmp())
    return arith::ExtUIOp::create(b, loc, type, bound);
  return arith::ExtSIOp::create(b, loc, type, bound);
}

/// ceil((upper - lower) / step), or zero if there is nothing between them.
Value ForReversal::countTrips() {
  bool isNarrow = op.getInductionVar().getType().isInteger(32) && lower &&
                  *lower >= 0 && step;
  Type type = isNarrow ? b.getI32Type() : b.getI64Type();
  if (lower && upper && step && *step > 0 && !op.getUnsignedCmp()) {
    int64_t span = *upper > *lower ? *upper - *lower : 0;
    return constant(type, span / *step + (span % *step != 0));
  }
  Value first = widen(reverse.recover(op.getLowerBound()), type);
  Value last = widen(reverse.recover(op.getUpperBound()), type);
  auto order = op.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                   : arith::CmpIPredicate::slt;
  Value any = arith::CmpIOp::create(b, loc, order, first, last);
  Value span = lower == 0 ? last
                          : arith::SubIOp::create(b, loc, last, first);
  Value zero = constant(type, 0), one = constant(type, 1);
  Value trips = span;
  if (step != 1) {
    Value by = widen(reverse.recover(op.getStep()), type);
    trips = arith::SubIOp::create(b, loc, span, one);
    trips = arith::DivUIOp::create(b, loc, trips, by);
    trips = arith::AddIOp::create(b, loc, trips, one);
  }
  return arith::SelectOp::create(b, loc, any, trips, zero);
}

/// The induction variable is lower + number * step.
void ForReversal::recoverIteration(Value number) {
  Type type = op.getInductionVar().getType();
  Value at = number;
  if (isa<IndexType>(type))
    at = arith::IndexCastOp::create(b, loc, type, at);
  else if (at.getType().getIntOrFloatBitWidth() > type.getIntOrFloatBitWidth())
    at = arith::TruncIOp::create(b, loc, type, at);
  else if (at.getType() != type)
    at = arith::ExtUIOp::create(b, loc, type, at);
  if (step != 1)
    at = arith::MulIOp::create(b, loc, at, reverse.recover(op.getStep()));
  if (lower != 0)
    at = arith::AddIOp::create(b, loc, at,
                               reverse.recover(op.getLowerBound()));
  reverse.setRecovered(op.getInductionVar(), at);
}

LogicalResult ForReversal::run() {
  SmallVector<Value> cotangents;
  for (Value result : op.getResults())
    cotangents.push_back(reverse.takeCotangent(result));
  if (isZero(cotangents))
    return success();
  return reverseAll(countTrips(), cotangents);
}

LogicalResult warp::autodiff::reverseFor(ReverseBuilder &reverse,
                                         scf::ForOp op) {
  return ForReversal(reverse, op).run();
}
