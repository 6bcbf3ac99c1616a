//===- Ranges.cpp - Integer range analysis --------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A negative index counts from the end, which costs a comparison and a select
// per access and hides from LLVM that neighbouring threads touch neighbouring
// elements. Most indices can be told not to be negative: thread indices, loop
// counters, extents, sums and products of such; and `i - 1` where a branch
// around the access lets only positive `i` pass.
//
// A range is what its type, its operation, its form, and the conditions around
// (RangeConditions.cpp) say together. As in Forms.cpp, each value is looked at
// once in a block, and none by recursion.
//
//===----------------------------------------------------------------------===//

#include "Ranges.h"

#include "GridReads.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;
using warp::Form;
using warp::Interval;
using warp::Ranges;
using warp::Symbol;
using warp::Use;
using Number = Interval::Number;

/// The range of launch indices: they and their successors fit 32 bits.
constexpr int64_t lastThread = INT32_MAX - 1;
/// A range that no sum reaches.
constexpr Number infinity = Number(1) << 100;

//===----------------------------------------------------------------------===//
// Arithmetic
//===----------------------------------------------------------------------===//

static Interval getTypeRange(Type type) {
  unsigned bits = std::max(warp::getIntegerBits(type), 1u);
  if (type.isUnsignedInteger() || bits == 1)
    return {0, (Number(1) << bits) - 1};
  return {-(Number(1) << (bits - 1)), (Number(1) << (bits - 1)) - 1};
}

static Number clamp(Number x) { return std::clamp(x, -infinity, infinity); }

static Number multiply(Number a, Number b) {
  Number product;
  if (!__builtin_mul_overflow(a, b, &product))
    return clamp(product);
  return (a < 0) == (b < 0) ? infinity : -infinity;
}

static Interval operator+(Interval a, Interval b) {
  return {clamp(a.low + b.low), clamp(a.high + b.high)};
}

static Interval operator-(Interval a, Interval b) {
  return {clamp(a.low - b.high), clamp(a.high - b.low)};
}

static Interval operator*(Interval a, Interval b) {
  auto [low, high] =
      std::minmax({multiply(a.low, b.low), multiply(a.low, b.high),
                   multiply(a.high, b.low), multiply(a.high, b.high)});
  return {low, high};
}

static Interval join(Interval a, Interval b) {
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}

static Interval intersect(Interval a, Interval b) {
  Interval both{std::max(a.low, b.low), std::min(a.high, b.high)};
  // Code under a contradiction is never executed.
  return both.low <= both.high ? both : a;
}

/// The range of a sum or product that may wrap at the bounds of its type.
static Interval fit(Interval range, Interval type, Use use) {
  if (range.isWithin(type))
    return range;
  return use == Use::Index ? intersect(type, range) : type;
}

/// The numbers of as many bits as both have, if none is negative.
static Interval joinBits(Interval a, Interval b) {
  Number high = 1;
  while (high <= std::max(a.high, b.high))
    high *= 2;
  return {0, high - 1};
}

/// The range of a quotient rounded towards zero, or down.
static Interval divide(Interval a, Interval b, Interval type) {
  if (a.low >= 0 && b.low >= 0)
    return {0, a.high / std::max(b.low, Number(1))};
  if (b.low < 1)
    return type;
  return {a.low < 0 ? -(-a.low / b.low) - 1 : a.low / b.high,
          a.high < 0 ? 0 : a.high / b.low};
}

/// The range of a remainder that has the sign of the dividend.
static Interval remainder(Interval a, Interval b, Interval type) {
  if (b.low < 1)
    return a.low >= 0 ? Interval{0, a.high} : type;
  return {a.low >= 0 ? 0 : std::max(a.low, 1 - b.high),
          a.high < 0 ? 0 : std::min(a.high, b.high - 1)};
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

/// A thread index of a launch in an entry is what is left of a 64-bit counter,
/// or the block's first index plus the one within; nothing else is marked so.
static bool isMarkedThread(Operation *op) {
  constexpr auto noWrap =
      arith::IntegerOverflowFlags::nsw | arith::IntegerOverflowFlags::nuw;
  if (auto sum = dyn_cast<arith::AddIOp>(op))
    return bitEnumContainsAll(sum.getOverflowFlags(), noWrap);
  auto trunc = dyn_cast<arith::TruncIOp>(op);
  return trunc && trunc.getOverflowFlags() != arith::IntegerOverflowFlags::none;
}

/// The range of a result, by the ranges of the operands.
static Interval transfer(Operation *op, ArrayRef<Interval> of, Interval type,
                         Use use) {
  if (isMarkedThread(op))
    return {0, lastThread};
  if (isa<arith::AddIOp, warp::AddOp>(op))
    return fit(of[0] + of[1], type, use);
  if (isa<arith::SubIOp, warp::SubOp>(op))
    return fit(of[0] - of[1], type, use);
  if (isa<arith::MulIOp, warp::MulOp>(op))
    return fit(of[0] * of[1], type, use);
  if (isa<warp::NegOp>(op))
    return fit({-of[0].high, -of[0].low}, type, use);
  if (isa<arith::DivSIOp, warp::FloorDivOp, warp::DivOp>(op))
    return intersect(type, divide(of[0], of[1], type));
  if (isa<arith::RemSIOp, warp::ModOp>(op))
    return intersect(type, remainder(of[0], of[1], type));
  bool areNonNegative = of[0].low >= 0 && of.back().low >= 0;
  if (isa<arith::DivUIOp>(op))
    return areNonNegative ? divide(of[0], of[1], type) : type;
  // By a positive number it is less than that, also if of a negative one.
  if (isa<arith::RemUIOp>(op))
    return areNonNegative   ? remainder(of[0], of[1], type)
           : of[1].low >= 1 ? Interval{0, of[1].high - 1}
                            : type;
  if (isa<arith::MinSIOp, warp::MinOp>(op))
    return {std::min(of[0].low, of[1].low), std::min(of[0].high, of[1].high)};
  if (isa<arith::MaxSIOp, warp::MaxOp>(op))
    return {std::max(of[0].low, of[1].low), std::max(of[0].high, of[1].high)};
  if (isa<arith::MinUIOp, arith::MaxUIOp>(op) && areNonNegative)
    return join(of[0], of[1]);
  if (isa<arith::AndIOp, warp::BitAndOp>(op) &&
      (of[0].low >= 0 || of[1].low >= 0))
    return {0, std::min(of[0].low >= 0 ? of[0].high : infinity,
                        of[1].low >= 0 ? of[1].high : infinity)};
  if (isa<arith::OrIOp, arith::XOrIOp, warp::BitOrOp, warp::BitXorOp>(op))
    return areNonNegative ? joinBits(of[0], of[1]) : type;
  if (isa<arith::ShRSIOp, arith::ShRUIOp, warp::RShiftOp>(op))
    return areNonNegative ? Interval{0, of[0].high} : type;
  return type;
}

/// The range of a cast number.
static Interval transferCast(Operation *op, Interval of, Interval type) {
  if (isMarkedThread(op))
    return {0, lastThread};
  if (of.isWithin(type) && !(isa<arith::ExtUIOp>(op) && of.low < 0))
    return of;
  unsigned bits = warp::getIntegerBits(op->getOperand(0).getType());
  if (isa<arith::ExtUIOp>(op) && bits != 0)
    return {0, (Number(1) << bits) - 1};
  return type;
}

static bool isNumberCast(Operation *op) {
  return isa<arith::ExtSIOp, arith::ExtUIOp, arith::TruncIOp,
             arith::IndexCastOp, warp::CastOp>(op) &&
         warp::getIntegerBits(op->getOperand(0).getType()) != 0;
}

/// True if the range of a result follows from those of the operands.
static bool hasTransfer(Operation *op) {
  auto isNumber = [](Type type) { return warp::getIntegerBits(type) != 0; };
  return op->getNumOperands() == (isa<warp::NegOp>(op) ? 1 : 2) &&
         llvm::all_of(op->getOperandTypes(), isNumber) &&
         isa<arith::AddIOp, arith::SubIOp, arith::MulIOp, arith::DivSIOp,
             arith::DivUIOp, arith::RemSIOp, arith::RemUIOp, arith::MinSIOp,
             arith::MaxSIOp, arith::MinUIOp, arith::MaxUIOp, arith::AndIOp,
             arith::OrIOp, arith::XOrIOp, arith::ShRSIOp, arith::ShRUIOp,
             warp::AddOp, warp::SubOp, warp::MulOp, warp::NegOp, warp::DivOp,
             warp::FloorDivOp, warp::ModOp, warp::MinOp, warp::MaxOp,
             warp::BitAndOp, warp::BitOrOp, warp::BitXorOp, warp::RShiftOp>(op);
}

/// For an index, whether what it is computed from may be taken not to wrap.
static bool isPartOfIndex(Operation *op) {
  return isNumberCast(op) ||
         isa<arith::AddIOp, arith::SubIOp, arith::MulIOp, arith::SelectOp,
             warp::AddOp, warp::SubOp, warp::MulOp, warp::NegOp, warp::WhereOp,
             scf::IfOp>(op);
}

/// The values that a range is derived from: the symbols of a sum, then the
/// operands.
SmallVector<Ranges::Place, 2> Ranges::getParts(Place place) {
  auto [value, context] = place;
  SmallVector<Place, 2> parts;
  for (const Term &term : forms.of(value).terms)
    for (Symbol symbol : term.product)
      if (symbol.kind == Symbol::Kind::Opaque && symbol.getValue() != value)
        parts.push_back({symbol.getValue(), context});
  Block *at = context.getPointer();
  Operation *op = value.getDefiningOp();
  if (!op) {
    auto argument = cast<BlockArgument>(value);
    auto loop = dyn_cast<scf::ForOp>(argument.getOwner()->getParentOp());
    if (loop && loop.getInductionVar() == value)
      for (Value bound : {loop.getLowerBound(), loop.getUpperBound()})
        parts.push_back({bound, Context(at, Use::Exact)});
    return parts;
  }
  if (!isPartOfIndex(op))
    context.setInt(Use::Exact);
  if (auto branch = dyn_cast<scf::IfOp>(op)) {
    unsigned i = cast<OpResult>(value).getResultNumber();
    for (scf::YieldOp yield : {branch.thenYield(), branch.elseYield()})
      parts.push_back(
          {yield.getOperand(i),
           Context(at ? yield->getBlock() : nullptr, context.getInt())});
  } else if (isa<arith::SelectOp, WhereOp>(op)) {
    parts.push_back({op->getOperand(1), context});
    parts.push_back({op->getOperand(2), context});
  } else if (hasTransfer(op) || isNumberCast(op) || isa<ClampOp>(op)) {
    for (Value operand : op->getOperands())
      parts.push_back({operand, context});
  }
  return parts;
}

Interval Ranges::fromArgument(BlockArgument argument, Context context) {
  Interval type = getTypeRange(argument.getType());
  Operation *owner = argument.getOwner()->getParentOp();
  if (auto function = dyn_cast<FunctionOpInterface>(owner))
    return function.getArgAttr(argument.getArgNumber(), attr::nonNegative)
               ? Interval{0, type.high}
               : type;
  auto loop = dyn_cast<scf::ForOp>(owner);
  if (!loop || loop.getInductionVar() != argument)
    return type;
  // Beyond 2^31 trips an index is out of bounds, like a sum that overflows.
  if (loop.getUnsignedCmp() && context.getInt() == Use::Exact)
    return type;
  context.setInt(Use::Exact);
  Number low = known.at({loop.getLowerBound(), context}).low;
  Number last = known.at({loop.getUpperBound(), context}).high - 1;
  return {low, std::max(low, loop.getUnsignedCmp() ? type.high : last)};
}

/// By what a value is computed from, and no other facts.
Interval Ranges::fromOperation(Place place) {
  auto [value, context] = place;
  if (auto argument = dyn_cast<BlockArgument>(value))
    return fromArgument(argument, context);
  Operation *op = value.getDefiningOp();
  Interval type = getTypeRange(value.getType());
  if (getGridRead(value))
    return {0, INT32_MAX};
  if (op->hasAttr(attr::nonNegative))
    return {0, type.high};
  bool isChoice = isa<scf::IfOp, arith::SelectOp, WhereOp>(op);
  if (!isChoice && !hasTransfer(op) && !isNumberCast(op) && !isa<ClampOp>(op))
    return type;
  // The last parts are those that the operation itself has.
  SmallVector<Interval, 3> of;
  for (Place part : getParts(place))
    of.push_back(known.at(part));
  auto last = [&](size_t count) { return ArrayRef(of).take_back(count); };
  if (isChoice)
    return join(last(2)[0], last(2)[1]);
  if (isa<ClampOp>(op))
    return intersect(type, {last(3)[1].low, last(3)[2].high});
  if (isNumberCast(op))
    return transferCast(op, of.back(), type);
  return transfer(op, last(op->getNumOperands()), type, context.getInt());
}

Interval Ranges::ofSymbol(Symbol symbol, Place place) {
  switch (symbol.kind) {
  case Symbol::Kind::Thread:
    return {0, lastThread};
  case Symbol::Kind::Trip:
    return {0, infinity};
  case Symbol::Kind::Extent:
    return {0, INT32_MAX};
  case Symbol::Kind::Opaque:
    return symbol.getValue() == place.first
               ? fromOperation(place)
               : known.at({symbol.getValue(), place.second});
  }
  llvm_unreachable("no such symbol");
}

Interval Ranges::fromForm(const Form &form, Place place) {
  Interval sum{form.constant, form.constant};
  for (const Term &term : form.terms) {
    Interval product{term.factor, term.factor};
    for (Symbol symbol : term.product)
      product = product * ofSymbol(symbol, place);
    sum = sum + product;
  }
  return sum;
}

Interval Ranges::combine(Place place) {
  auto [value, context] = place;
  const Form &form = forms.of(value);
  Interval type = getTypeRange(value.getType());
  Interval range = intersect(type, fromOperation(place));
  Use use = context.getInt();
  if (form.isExact || use == Use::Index)
    range = intersect(range, fit(fromForm(form, place), type, use));
  refine(form, place, range);
  return range;
}

Interval Ranges::of(Value value, Block *at, Use use) {
  Place asked{value, Context(at, use)};
  SmallVector<Place> pending{asked};
  while (!pending.empty()) {
    Place next = pending.back();
    bool isReady = true;
    for (Place part : getParts(next))
      if (!known.contains(part)) {
        pending.push_back(part);
        isReady = false;
      }
    if (!isReady)
      continue;
    pending.pop_back();
    if (!known.contains(next)) {
      Interval range = combine(next);
      known.try_emplace(next, range);
    }
  }
  return known.at(asked);
}

bool warp::isNonNegative(Value index, Block *at) {
  Forms forms;
  Ranges ranges(forms);
  return ranges.of(index, nullptr, Use::Index).low >= 0 ||
         (at && ranges.of(index, at, Use::Index).low >= 0);
}
