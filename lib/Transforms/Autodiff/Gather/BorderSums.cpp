//===- BorderSums.cpp - Stencil updates, split at borders -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Stencils keep to an array by indices that are clamped: `x[max(i - 1, 0)]`.
// All threads but those at a border add to an element at a constant distance,
// and these additions can be gathered:
//
//   g[max(i - 1, 0)] += v     ==>     if i - 1 >= 0: g[i - 1] += v
//                                     else:          g[max(i - 1, 0)] += v
//
// Periodic ones go on at the other end, `x[(i + 1) % n]`:
//
//   g[(i + 1) % n] += v       ==>     if i + 1 < n: g[i + 1] += v
//                                     else:         g[(i + 1) % n] += v
//
// The bounds have to be the same in all threads. Values are computed anew for
// each neighbour, so they have to be short arithmetic of elements near by: on
// CPUs, lanes make clamped additions as vectors anyway, and take less time than
// scattered loads or functions for three neighbours in place of one.
//
//===----------------------------------------------------------------------===//

#include "BorderSums.h"

#include "Analysis/Effects.h"
#include "Analysis/ThreadVariance.h"
#include "GatherGuard.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

namespace {

/// Uniformity over the threads of a launch. One analysis serves the values of
/// an adjoint: a split changes none of them.
class Uniformity {
public:
  explicit Uniformity(func::FuncOp adjoint) : adjoint(adjoint) {}

  bool holds(Value value) {
    if (getConstantInteger(value))
      return true;
    if (!variance)
      variance.emplace(adjoint, /*disjoint=*/true);
    return variance->isUniform(value, Scope::Launch);
  }
  bool isBound(Value value) { return holds(value) && isSpeculatable(value); }

private:
  func::FuncOp adjoint;
  std::optional<ThreadVariance> variance;
};

/// An index between bounds, or the rest of a division by a period.
struct Clamped {
  explicit Clamped(Uniformity &uniformity) : uniformity(uniformity) {}

  /// A thread index plus a constant, and a period as well if it `isLater`.
  Value inner;
  SmallVector<Value, 2> lows, highs;
  Value period;
  bool isLater = false;

  bool parse(Value value);
  bool hasBounds() const { return !lows.empty() || !highs.empty() || period; }
  Value getInner(OpBuilder &b, Location loc) const;
  Value isInside(OpBuilder &b, Location loc, Value index) const;

private:
  bool isBound(Value value) { return uniformity.isBound(value); }
  bool parseBound(Operation *op, SmallVectorImpl<Value> &bounds);
  bool parsePeriod(ModOp op);

  Uniformity &uniformity;
};

} // namespace

/// The larger, or smaller, of an index and a bound.
bool Clamped::parseBound(Operation *op, SmallVectorImpl<Value> &bounds) {
  for (unsigned i : {0, 1}) {
    if (!isBound(op->getOperand(i)))
      continue;
    bounds.push_back(op->getOperand(i));
    return parse(op->getOperand(1 - i));
  }
  return false;
}

/// `(i + 1) % n`, or `(i - 1 + n) % n`.
bool Clamped::parsePeriod(ModOp op) {
  inner = op->getOperand(0);
  period = op->getOperand(1);
  if (!isBound(period) || !inner.getType().isSignedInteger(32))
    return false;
  if (getShift(inner))
    return true;
  isLater = true;
  std::optional<Form> before = Forms().of(inner) - Forms().of(period);
  return before && getShift(*before);
}

bool Clamped::parse(Value value) {
  inner = value;
  Operation *op = value.getDefiningOp();
  if (auto rest = dyn_cast_or_null<ModOp>(op))
    return parsePeriod(rest);
  if (isa_and_nonnull<MaxOp>(op))
    return parseBound(op, lows);
  if (isa_and_nonnull<MinOp>(op))
    return parseBound(op, highs);
  if (isa_and_nonnull<ClampOp>(op)) {
    if (!isBound(op->getOperand(1)) || !isBound(op->getOperand(2)))
      return false;
    lows.push_back(op->getOperand(1));
    highs.push_back(op->getOperand(2));
    return parse(op->getOperand(0));
  }
  return getShift(value).has_value();
}

Value Clamped::getInner(OpBuilder &b, Location loc) const {
  if (!isLater)
    return inner;
  return SubOp::create(b, loc, TypeRange(inner.getType()),
                       ValueRange{inner, period})
      ->getResult(0);
}

/// True if no bound changes the index.
Value Clamped::isInside(OpBuilder &b, Location loc, Value index) const {
  Value all;
  auto add = [&](Value condition) {
    all = !all ? condition
               : BitAndOp::create(b, loc, TypeRange(b.getI1Type()),
                                  ValueRange{all, condition})
                     ->getResult(0);
  };
  auto compare = [&]<typename Op>(Op, Value bound) {
    add(Op::create(b, loc, TypeRange(b.getI1Type()), ValueRange{index, bound})
            ->getResult(0));
  };
  for (Value low : lows)
    compare(GeOp(), low);
  for (Value high : highs)
    compare(LeOp(), high);
  if (period) {
    compare(GeOp(),
            ConstantOp::create(b, loc, b.getIntegerAttr(index.getType(), 0)));
    compare(LtOp(), period);
  }
  return all;
}

/// Rests of divisions take lanes more time than they save.
static bool isNear(Value index, Uniformity &uniformity) {
  Clamped clamped(uniformity);
  return uniformity.holds(index) || (clamped.parse(index) && !clamped.period);
}

/// True if the value of an addition, the indices and conditions are short
/// arithmetic of elements near the thread's own.
static bool isShort(AccumulateOp sum, Uniformity &uniformity) {
  auto isCheap = [&](Operation *op) {
    if (op->hasTrait<OpTrait::ConstantLike>() ||
        op->hasTrait<OpTrait::IsTerminator>())
      return true;
    if (isPlainRead(op))
      return llvm::all_of(cast<AccessOp>(op).getIndices(), [&](Value index) {
        return isNear(index, uniformity);
      });
    return isa<TidOp, GradOp, DimOp, AddOp, SubOp, MulOp, NegOp, MinOp, MaxOp,
               ClampOp, ModOp, EqOp, NeOp, LtOp, LeOp, GtOp, GeOp, BitAndOp,
               BitOrOp, UNotOp, CastOp, ExtractOp, ConstructOp, scf::IfOp>(op);
  };
  return llvm::all_of(getSlice(sum), [&](Operation *op) {
    return !op->walk([&](Operation *inner) {
                return isCheap(inner) ? WalkResult::advance()
                                      : WalkResult::interrupt();
              }).wasInterrupted();
  });
}

/// Splits an addition; the one at the border, or null if it has no bounds.
static Operation *split(AccumulateOp sum, Uniformity &uniformity) {
  OpBuilder b(sum);
  Location loc = sum.getLoc();
  SmallVector<Value> indices(sum.getIndices());
  Value inside;
  for (Value &index : indices) {
    Clamped clamped(uniformity);
    if (!clamped.parse(index) || !clamped.hasBounds())
      continue;
    Value inner = clamped.getInner(b, loc);
    Value here = clamped.isInside(b, loc, inner);
    inside = !inside ? here
                     : BitAndOp::create(b, loc, TypeRange(b.getI1Type()),
                                        ValueRange{inside, here})
                           ->getResult(0);
    index = inner;
  }
  if (!inside)
    return nullptr;
  auto branch = scf::IfOp::create(b, loc, inside, /*withElseRegion=*/true);
  sum->moveBefore(branch.thenYield());
  Operation *border = sum->clone();
  branch.elseBlock()->getOperations().insert(branch.elseYield()->getIterator(),
                                             border);
  sum.getIndicesMutable().assign(indices);
  return border;
}

llvm::DenseSet<Operation *> splitBorders(func::FuncOp adjoint) {
  Uniformity uniformity(adjoint);
  SmallVector<AccumulateOp> sums;
  adjoint.walk([&](AccumulateOp sum) {
    if (!sum->getParentOfType<LoopLikeOpInterface>() &&
        isShort(sum, uniformity))
      sums.push_back(sum);
  });
  llvm::DenseSet<Operation *> borders;
  for (AccumulateOp sum : sums)
    if (Operation *border = split(sum, uniformity))
      borders.insert(border);
  return borders;
}

} // namespace warp::autodiff
