//===- FoldZeroArguments.cpp - Versions without code of zero arguments ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Function versioning: a loop over a count that is zero, or a branch under a
// flag that is false, costs a launch registers, loads before the loop and an
// estimate of its work that is far too high. The general code says which
// arguments would leave out a good part of it (`switches`); launches in which
// they are zero get a version without that part (`zeros`). Only loops and
// branches are folded, and products keep the rounding that they have in the
// general code, so both versions have the same bits.
//
// Besides integers, an argument may be an array that the kernel does not write,
// for launches on the CPU: the host reads its first element if the array
// overlaps none that the launch writes.
//
//===----------------------------------------------------------------------===//

#include "Choices.h"
#include "KernelFunction.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

#include "llvm/ADT/TypeSwitch.h"

namespace warp {
#define GEN_PASS_DEF_FOLDZEROARGUMENTS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// Operations that are worth a version: at least so many, and such a part of
/// the kernel's.
static constexpr int64_t leastOperations = 8, leastPart = 10;
/// Bits of `#warp.variant`.
static constexpr unsigned mostArguments = 64;

//===----------------------------------------------------------------------===//
// Values
//===----------------------------------------------------------------------===//

namespace {

/// Integers that are known if some arguments are zero.
class Values {
public:
  void setZero(Value value) {
    known[value] = APInt::getZero(value.getType().getIntOrFloatBitWidth());
  }
  std::optional<APInt> find(Value value);

private:
  std::optional<APInt> compute(Operation *op);

  DenseMap<Value, std::optional<APInt>> known;
};

} // namespace

std::optional<APInt> Values::find(Value value) {
  APInt constant;
  if (matchPattern(value, m_ConstantInt(&constant)))
    return constant;
  auto [place, isNew] = known.try_emplace(value, std::nullopt);
  if (!isNew)
    return place->second;
  Operation *op = value.getDefiningOp();
  if (!op || op->getNumResults() != 1 || op->getNumRegions() != 0 ||
      !isa<arith::ArithDialect>(op->getDialect()))
    return std::nullopt;
  std::optional<APInt> found = compute(op);
  known[value] = found;
  return found;
}

std::optional<APInt> Values::compute(Operation *op) {
  auto operand = [&](unsigned i) { return find(op->getOperand(i)); };
  if (auto select = dyn_cast<arith::SelectOp>(op)) {
    std::optional<APInt> condition = operand(0);
    return condition ? operand(condition->isZero() ? 2 : 1) : std::nullopt;
  }
  // One operand that is known may be enough.
  if (isa<arith::AndIOp, arith::MulIOp>(op))
    for (unsigned i : {0, 1})
      if (std::optional<APInt> one = operand(i); one && one->isZero())
        return one;
  if (isa<arith::OrIOp>(op))
    for (unsigned i : {0, 1})
      if (std::optional<APInt> one = operand(i); one && one->isAllOnes())
        return one;
  SmallVector<APInt, 2> values;
  for (unsigned i = 0; i < op->getNumOperands(); ++i) {
    std::optional<APInt> value = operand(i);
    if (!value)
      return std::nullopt;
    values.push_back(*value);
  }
  Type type = op->getResult(0).getType();
  if (values.empty() || !isa<IntegerType>(type))
    return std::nullopt;
  unsigned width = type.getIntOrFloatBitWidth();
  const APInt &x = values.front(), &y = values.back();
  if (auto compare = dyn_cast<arith::CmpIOp>(op))
    return APInt(1, arith::applyCmpPredicate(compare.getPredicate(), x, y));
  return llvm::TypeSwitch<Operation *, std::optional<APInt>>(op)
      .Case([&](arith::AddIOp) { return x + y; })
      .Case([&](arith::SubIOp) { return x - y; })
      .Case([&](arith::MulIOp) { return x * y; })
      .Case([&](arith::AndIOp) { return x & y; })
      .Case([&](arith::OrIOp) { return x | y; })
      .Case([&](arith::XOrIOp) { return x ^ y; })
      .Case([&](arith::MinSIOp) { return llvm::APIntOps::smin(x, y); })
      .Case([&](arith::MaxSIOp) { return llvm::APIntOps::smax(x, y); })
      .Case([&](arith::ExtSIOp) { return x.sext(width); })
      .Case([&](arith::ExtUIOp) { return x.zext(width); })
      .Case([&](arith::TruncIOp) { return x.trunc(width); })
      .Default([](Operation *) { return std::nullopt; });
}

//===----------------------------------------------------------------------===//
// Loops and branches
//===----------------------------------------------------------------------===//

/// True if a loop has no iteration.
static bool isEmpty(scf::ForOp loop, Values &values) {
  std::optional<APInt> first = values.find(loop.getLowerBound());
  std::optional<APInt> end = values.find(loop.getUpperBound());
  if (!first || !end)
    return false;
  return loop.getUnsignedCmp() ? first->uge(*end) : first->sge(*end);
}

/// The arm that a branch does not take; null if that is not known.
static Region *getLeftOut(scf::IfOp branch, Values &values) {
  std::optional<APInt> condition = values.find(branch.getCondition());
  if (!condition)
    return nullptr;
  return condition->isZero() ? &branch.getThenRegion()
                             : &branch.getElseRegion();
}

/// The region that is left out; null if there is none.
static Region *getLeftOut(Operation *op, Values &values) {
  if (auto loop = dyn_cast<scf::ForOp>(op))
    return isEmpty(loop, values) ? &loop.getRegion() : nullptr;
  if (auto branch = dyn_cast<scf::IfOp>(op))
    return getLeftOut(branch, values);
  return nullptr;
}

/// Products that a loop or branch uses, or gives, are used by no sum in the
/// general code, or by one in another block: they are rounded.
static void keepRounding(Operation *op) {
  auto keep = [](Value value) {
    if (auto product = value.getDefiningOp<arith::MulFOp>())
      product->setAttr(warp::exactAttrName, UnitAttr::get(value.getContext()));
  };
  llvm::for_each(op->getOperands(), keep);
  op->walk([&](Operation *inner) {
    for (Value operand : inner->getOperands())
      if (operand.getParentRegion() != inner->getParentRegion() ||
          inner->hasTrait<OpTrait::IsTerminator>())
        keep(operand);
  });
}

static void fold(Operation *op, Region *leftOut) {
  keepRounding(op);
  if (auto loop = dyn_cast<scf::ForOp>(op)) {
    loop.replaceAllUsesWith(loop.getInitArgs());
    return op->erase();
  }
  auto branch = cast<scf::IfOp>(op);
  Region &taken = leftOut == &branch.getThenRegion() ? branch.getElseRegion()
                                                     : branch.getThenRegion();
  if (!taken.empty()) {
    Block &body = taken.front();
    Operation *end = body.getTerminator();
    op->replaceAllUsesWith(end->getOperands());
    end->erase();
    op->getBlock()->getOperations().splice(op->getIterator(),
                                           body.getOperations());
  }
  op->erase();
}

//===----------------------------------------------------------------------===//
// The pass
//===----------------------------------------------------------------------===//

namespace {

/// An argument of a launch that may leave out code, and the values that are its
/// zero.
struct Switch {
  unsigned number;
  SmallVector<Value> values;
};

struct FoldZeroArguments
    : warp::impl::FoldZeroArgumentsBase<FoldZeroArguments> {
  void runOnOperation() override;

private:
  void collectSwitches();
  void addElements(unsigned number, Value array);
  uint64_t findUseful();
  bool isUseful(const Switch &one, ArrayRef<Operation *> places, int64_t all);
  void foldZeros(uint64_t zeros);
  void eraseUnused();

  FunctionOpInterface kernel;
  SmallVector<Switch> switches;
};

} // namespace

/// Adds an array whose first element the host may read in place of the kernel.
void FoldZeroArguments::addElements(unsigned number, Value array) {
  auto type = cast<warp::ArrayType>(array.getType());
  if (warp::getTarget(kernel).isSimt() ||
      !isa<IntegerType>(type.getElementType()))
    return;
  Switch one{number, {}};
  for (Operation *user : array.getUsers()) {
    auto load = dyn_cast<warp::AccessOp>(user);
    if (!load || load.mayWrite())
      return;
    if (user->getNumResults() == 1 &&
        llvm::all_of(load.getIndices(),
                     [](Value index) { return matchPattern(index, m_Zero()); }))
      one.values.push_back(user->getResult(0));
  }
  if (!one.values.empty())
    switches.push_back(std::move(one));
}

void FoldZeroArguments::collectSwitches() {
  switches.clear();
  auto declared = kernel->getAttrOfType<ArrayAttr>(warp::attr::argTypes);
  if (!declared)
    return;
  unsigned next = 0;
  for (auto [i, attribute] : llvm::enumerate(declared)) {
    auto typeAttr = dyn_cast<TypeAttr>(attribute);
    SmallVector<warp::Leaf> leaves;
    if (typeAttr)
      warp::collectLeaves(typeAttr.getValue(), 0, leaves);
    unsigned place = next;
    next += leaves.size();
    if (!typeAttr || i >= mostArguments || next > kernel.getNumArguments())
      return;
    if (leaves.empty())
      continue; // A struct without fields.
    Value argument = kernel.getArgument(place);
    if (isa<warp::ArrayType>(typeAttr.getValue()))
      addElements(i, argument);
    else if (isa<IntegerType>(typeAttr.getValue()))
      switches.push_back({unsigned(i), {argument}});
  }
}

/// True if an argument would leave out enough if it were zero.
bool FoldZeroArguments::isUseful(const Switch &one,
                                 ArrayRef<Operation *> places, int64_t all) {
  Values values;
  for (Value value : one.values)
    values.setZero(value);
  DenseSet<Region *> regions;
  int64_t count = 0;
  for (Operation *place : places) {
    bool isInside = false;
    for (Region *outer = place->getParentRegion(); outer && !isInside;
         outer = outer->getParentRegion())
      isInside = regions.contains(outer);
    Region *region = isInside ? nullptr : getLeftOut(place, values);
    if (!region)
      continue;
    regions.insert(region);
    region->walk([&](Operation *) { ++count; });
  }
  return count >= leastOperations && count * leastPart >= all;
}

uint64_t FoldZeroArguments::findUseful() {
  SmallVector<Operation *> places;
  int64_t all = 0;
  kernel->walk<WalkOrder::PreOrder>([&](Operation *op) {
    ++all;
    if (isa<scf::ForOp, scf::IfOp>(op))
      places.push_back(op);
  });
  uint64_t useful = 0;
  if (!places.empty())
    for (const Switch &one : switches)
      if (isUseful(one, places, all))
        useful |= uint64_t(1) << one.number;
  return useful;
}

/// Erases loads and arithmetic that nobody uses any more.
void FoldZeroArguments::eraseUnused() {
  SmallVector<Operation *> ops;
  kernel->walk<WalkOrder::PreOrder>([&](Operation *op) { ops.push_back(op); });
  for (Operation *op : llvm::reverse(ops))
    if (isOpTriviallyDead(op))
      op->erase();
}

void FoldZeroArguments::foldZeros(uint64_t zeros) {
  auto names = kernel->getAttrOfType<ArrayAttr>(warp::attr::argNames);
  Values values;
  std::string list;
  for (const Switch &one : switches) {
    if (!(zeros >> one.number & 1))
      continue;
    for (Value value : one.values)
      values.setZero(value);
    if (names && one.number < names.size())
      if (auto name = dyn_cast<StringAttr>(names[one.number]))
        list += (list.empty() ? "" : ", ") + name.str();
  }
  SmallVector<Operation *> places;
  kernel->walk([&](Operation *op) {
    if (isa<scf::ForOp, scf::IfOp>(op))
      places.push_back(op);
  });
  // From the innermost on, so that none is erased before its turn.
  bool isLess = false;
  for (Operation *place : places)
    if (Region *region = getLeftOut(place, values)) {
      fold(place, region);
      isLess = true;
    }
  if (!isLess)
    return;
  eraseUnused();
  warp::noteChoice(kernel, "left out", "loops and branches",
                   Twine("zero in such launches: ") + list);
}

void FoldZeroArguments::runOnOperation() {
  kernel = warp::findKernel(getOperation());
  if (!kernel)
    return signalPassFailure();
  warp::VariantAttr variant = warp::getVariant(kernel);
  if (variant.getDebug() || variant.getDeterministic())
    return;
  collectSwitches();
  if (variant.getZeros())
    return foldZeros(variant.getZeros());
  if (uint64_t useful = findUseful())
    warp::setSchedule(kernel, warp::getSchedule(kernel).withSwitches(useful));
}
