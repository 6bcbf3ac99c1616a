//===- RangeConditions.cpp - Ranges implied by branches -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A block runs if the branches around it let it: each comparison that must hold
// there bounds the difference of two values from below.
//
//===----------------------------------------------------------------------===//

#include "Ranges.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using warp::Form;
using warp::Interval;
using warp::Ranges;
using warp::Use;
using Predicate = arith::CmpIPredicate;

/// The comparison of integers as their type means it.
static std::optional<Predicate> getPredicate(Operation *op) {
  if (auto compare = dyn_cast<arith::CmpIOp>(op))
    return compare.getPredicate();
  if (!isa<warp::EqOp, warp::NeOp, warp::LtOp, warp::LeOp, warp::GtOp,
           warp::GeOp>(op) ||
      !isa<IntegerType>(op->getOperand(0).getType()))
    return std::nullopt;
  if (isa<warp::EqOp>(op))
    return Predicate::eq;
  if (isa<warp::NeOp>(op))
    return Predicate::ne;
  if (isa<warp::LtOp>(op))
    return Predicate::slt;
  if (isa<warp::LeOp>(op))
    return Predicate::sle;
  return isa<warp::GtOp>(op) ? Predicate::sgt : Predicate::sge;
}

void Ranges::addComparison(Operation *op, bool truth,
                           std::vector<Bound> &bounds) {
  std::optional<Predicate> predicate = getPredicate(op);
  Value left = op->getOperand(0), right = op->getOperand(1);
  if (!predicate || getIntegerBits(left.getType()) < 32)
    return;
  if (!truth)
    predicate = arith::invertPredicate(*predicate);
  auto add = [&](Value greater, Value less, int64_t least) {
    bounds.push_back(
        {forms.of(greater), forms.of(less), least, greater.getType()});
  };
  Form zero;
  switch (*predicate) {
  case Predicate::eq:
    add(left, right, 0);
    return add(right, left, 0);
  case Predicate::ne:
    // A value that is not negative and not 0 is positive.
    for (auto [value, other] : {std::pair(left, right), std::pair(right, left)})
      if (matchPattern(other, m_Zero()) && of(value).low >= 0)
        bounds.push_back({forms.of(value), zero, 1, value.getType()});
    return;
  case Predicate::sgt:
    return add(left, right, 1);
  case Predicate::sge:
    return add(left, right, 0);
  case Predicate::slt:
    return add(right, left, 1);
  case Predicate::sle:
    return add(right, left, 0);
  case Predicate::ult:
  case Predicate::ule:
    // Less than what is not negative is neither negative.
    if (of(right).low < 0)
      return;
    bounds.push_back({forms.of(left), zero, 0, left.getType()});
    return add(right, left, *predicate == Predicate::ult);
  case Predicate::ugt:
  case Predicate::uge:
    if (of(left).low < 0)
      return;
    bounds.push_back({forms.of(right), zero, 0, right.getType()});
    return add(left, right, *predicate == Predicate::ugt);
  }
}

/// Takes conjunctions apart, also those that evaluate their second part only if
/// need be.
void Ranges::addCondition(Value condition, bool truth,
                          std::vector<Bound> &bounds) {
  SmallVector<std::pair<Value, bool>> pending{{condition, truth}};
  DenseSet<Value> seen;
  while (!pending.empty()) {
    auto [part, holds] = pending.pop_back_val();
    Operation *op = part.getDefiningOp();
    if (!op || !seen.insert(part).second)
      continue;
    if (holds ? isa<arith::AndIOp, BitAndOp>(op)
              : isa<arith::OrIOp, BitOrOp>(op)) {
      pending.push_back({op->getOperand(0), holds});
      pending.push_back({op->getOperand(1), holds});
    } else if (isa<UNotOp>(op) || (isa<arith::XOrIOp>(op) &&
                                   matchPattern(op->getOperand(1), m_One()))) {
      pending.push_back({op->getOperand(0), !holds});
    } else if (auto branch = dyn_cast<scf::IfOp>(op)) {
      unsigned i = cast<OpResult>(part).getResultNumber();
      for (bool taken : {true, false}) {
        Value yielded = branch.thenYield().getOperand(i);
        Value other = branch.elseYield().getOperand(i);
        if (!taken)
          std::swap(yielded, other);
        std::optional<int64_t> constant = forms.of(other).getConstant();
        if (!constant || bool(*constant) == holds)
          continue;
        pending.push_back({branch.getCondition(), taken});
        pending.push_back({yielded, holds});
      }
    } else if (op->getNumOperands() == 2) {
      addComparison(op, holds, bounds);
    }
  }
}

/// Includes the conditions of enclosing blocks.
const std::vector<Ranges::Bound> &Ranges::getBounds(Block *block) {
  SmallVector<Block *> path;
  auto around = [](Block *inner) {
    Operation *op = inner->getParentOp();
    return op ? op->getBlock() : nullptr;
  };
  for (Block *b = block; b && !boundsAt.contains(b); b = around(b))
    path.push_back(b);
  while (!path.empty()) {
    Block *next = path.pop_back_val();
    std::vector<Bound> bounds;
    if (Block *outer = around(next))
      bounds = *boundsAt.at(outer);
    Operation *op = next->getParentOp();
    if (auto branch = dyn_cast_or_null<scf::IfOp>(op))
      addCondition(branch.getCondition(), next == branch.thenBlock(), bounds);
    else if (auto loop = dyn_cast_or_null<scf::WhileOp>(op);
             loop && next == loop.getAfterBody())
      addCondition(loop.getConditionOp().getCondition(), true, bounds);
    else if (auto counted = dyn_cast_or_null<scf::ForOp>(op);
             counted && !counted.getUnsignedCmp())
      bounds.push_back({forms.of(counted.getUpperBound()),
                        forms.of(counted.getInductionVar()), 1,
                        counted.getInductionVar().getType()});
    boundsAt[next] = std::make_unique<std::vector<Bound>>(std::move(bounds));
  }
  return *boundsAt.at(block);
}

/// By bounds of values whose difference to this one is constant. If the bound
/// is a difference of two values, or the value lies beyond it, a sum may have
/// wrapped in between.
void Ranges::refine(const Form &form, Place place, Interval &range) {
  auto [value, context] = place;
  Block *at = context.getPointer();
  if (!at || form.getConstant())
    return;
  Type type = value.getType();
  bool mayWrap = context.getInt() == Use::Exact;
  // The excess of a value over the difference of two others, if known.
  auto getExcess = [&](const Form &a, const Form &b) -> std::optional<int64_t> {
    std::optional<Form> difference = a - b;
    std::optional<Form> excess = difference ? form - *difference : std::nullopt;
    bool isKnown = excess && (excess->isExact || !mayWrap);
    return isKnown ? excess->getConstant() : std::nullopt;
  };
  for (const Bound &bound : getBounds(at)) {
    bool isAlike = !bound.type.isUnsignedInteger() &&
                   !type.isUnsignedInteger() && !mayWrap;
    if (bound.type != type && !isAlike)
      continue;
    if (auto more = getExcess(bound.greater, bound.less);
        more && (!mayWrap || (bound.less.getConstant() && *more <= 0))) {
      Interval::Number least = Interval::Number(bound.least) + *more;
      range.low = std::max(range.low, std::min(least, range.high));
    }
    if (auto more = getExcess(bound.less, bound.greater);
        more && (!mayWrap || (bound.greater.getConstant() && *more >= 0))) {
      Interval::Number most = Interval::Number(*more) - bound.least;
      range.high = std::min(range.high, std::max(most, range.low));
    }
  }
}
