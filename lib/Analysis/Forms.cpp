//===- Forms.cpp - Affine forms of integers -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Forms are found in two steps. The first one looks at operations alone, from
// operands to results, with arguments of blocks as symbols. The second one
// replaces those: a counter by `lower bound + step * trip`, what every
// iteration adds the same to by `init + that * trip`. So a loop's body is
// looked at once, and what is known about its arguments may be found by the
// forms of what it yields. Each value is looked at once however often it is
// used, and none by recursion: programs are as deep as they are long.
//
// Works on all phases: operators of the dialect, arith, and entries for a GPU.
//
//===----------------------------------------------------------------------===//

#include "Forms.h"

#include "GridReads.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using warp::Form;
using warp::Forms;
using warp::Symbol;
using warp::Term;

unsigned warp::getIntegerBits(Type type) {
  if (isa<IndexType>(type))
    return 64;
  auto integer = dyn_cast<IntegerType>(type);
  return integer ? integer.getWidth() : 0;
}

static std::optional<int64_t> getConstant(Value value) {
  IntegerAttr attr;
  if (!matchPattern(value, m_Constant(&attr)) ||
      attr.getValue().getBitWidth() > 64)
    return std::nullopt;
  return attr.getType().isUnsignedInteger() ? attr.getValue().getZExtValue()
                                            : attr.getValue().getSExtValue();
}

std::optional<int64_t> warp::getConstantInteger(Value value) {
  auto cast = value.getDefiningOp<CastOp>();
  if (!cast || getIntegerBits(cast.getSource().getType()) == 0)
    return getConstant(value);
  std::optional<int64_t> source = getConstantInteger(cast.getSource());
  unsigned bits = getIntegerBits(value.getType());
  // A number as a condition, or as a float, is what it was.
  if (!source || bits <= 1 || bits >= 64)
    return source;
  auto kept = APInt(64, *source, /*isSigned=*/true).trunc(bits);
  return value.getType().isUnsignedInteger()
             ? std::optional<int64_t>(kept.getZExtValue())
             : std::optional<int64_t>(kept.getSExtValue());
}

//===----------------------------------------------------------------------===//
// Symbols
//===----------------------------------------------------------------------===//

/// An extent is that of the array that views were taken of, unless a slice
/// changed it.
static Symbol getExtent(warp::DimOp op) {
  Value array = op.getArray();
  unsigned dim = op.getDim();
  while (Operation *view = array.getDefiningOp()) {
    if (auto part = dyn_cast<warp::ViewOp>(view))
      dim += part.getIndices().size();
    else if (auto slice = dyn_cast<warp::SliceOp>(view);
             slice ? slice.getDim() == dim
                   : !isa<warp::ComponentViewOp, warp::GradOp>(view))
      break;
    array = view->getOperand(0);
  }
  return {Symbol::Kind::Extent, dim, array.getAsOpaquePointer()};
}

/// The name of a value that is not decomposed.
static Symbol getSymbol(Value value) {
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    Operation *owner = argument.getOwner()->getParentOp();
    auto threads = dyn_cast_or_null<warp::ThreadsOp>(owner);
    if (threads && argument.getArgNumber() < threads.getIndices().size())
      return Symbol::thread(argument.getArgNumber());
    return Symbol::opaque(value);
  }
  if (value.getDefiningOp<warp::TidOp>())
    return Symbol::thread(cast<OpResult>(value).getResultNumber());
  if (auto dim = value.getDefiningOp<warp::DimOp>())
    return getExtent(dim);
  return Symbol::opaque(value);
}

/// True if a form is a sum of what is never negative: then it is not either,
/// unless it wraps. Unsigned values are such if they are used as unsigned.
static bool isSumOfNonNegatives(const Form &form, bool asUnsigned) {
  auto isNonNegative = [&](Symbol symbol) {
    if (symbol.kind != Symbol::Kind::Opaque)
      return true;
    Value value = symbol.getValue();
    if (value.getType().isUnsignedInteger())
      return asUnsigned;
    auto argument = dyn_cast<BlockArgument>(value);
    auto loop = argument
                    ? dyn_cast<scf::ForOp>(argument.getOwner()->getParentOp())
                    : nullptr;
    return loop && loop.getInductionVar() == value &&
           getConstant(loop.getLowerBound()).value_or(-1) >= 0;
  };
  return form.constant >= 0 && llvm::all_of(form.terms, [&](const Term &term) {
           return term.factor > 0 && llvm::all_of(term.product, isNonNegative);
         });
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

/// Operands that the form of a value is made of.
static SmallVector<Value, 2> getParts(Value value) {
  Operation *op = value.getDefiningOp();
  if (!op || warp::getIntegerBits(value.getType()) < 32 || getConstant(value))
    return {};
  if (isa<arith::AddIOp, arith::SubIOp, arith::MulIOp, arith::ShLIOp,
          warp::AddOp, warp::SubOp, warp::MulOp, warp::LShiftOp>(op))
    return {op->getOperand(0), op->getOperand(1)};
  if (isa<arith::SelectOp, warp::WhereOp>(op))
    return {op->getOperand(1), op->getOperand(2)};
  if (isa<arith::ExtSIOp, arith::ExtUIOp, arith::IndexCastOp, arith::TruncIOp,
          warp::CastOp, warp::NegOp, warp::PosOp>(op) &&
      warp::getIntegerBits(op->getOperand(0).getType()) > 1 &&
      !warp::getGridRead(value))
    return {op->getOperand(0)};
  auto branch = dyn_cast<scf::IfOp>(op);
  if (!branch)
    return {};
  unsigned i = cast<OpResult>(value).getResultNumber();
  return {branch.thenYield().getOperand(i), branch.elseYield().getOperand(i)};
}

/// A narrower number made wider, or a wider one made narrower.
std::optional<Form> Forms::combineCast(Operation *op) {
  Value source = op->getOperand(0);
  Form form = *raws.at(source);
  unsigned from = getIntegerBits(source.getType());
  unsigned to = getIntegerBits(op->getResult(0).getType());
  bool fromUnsigned = source.getType().isUnsignedInteger();
  bool toUnsigned = op->getResult(0).getType().isUnsignedInteger();
  std::optional<Symbol> symbol = form.getSymbol();
  // A sum may have left the range of its type; a symbol is a number of its own.
  bool fits =
      form.getConstant() ||
      (symbol && (symbol->kind != Symbol::Kind::Opaque ||
                  getIntegerBits(symbol->getValue().getType()) <= from));
  // The same bits are another number if the sign is read in another way.
  if (to <= from && (!fromUnsigned || toUnsigned))
    return form.reduced(to);
  bool isSigned = isa<arith::ExtSIOp, arith::IndexCastOp>(op) ||
                  (isa<CastOp>(op) && !fromUnsigned);
  if (!isSigned && !isSumOfNonNegatives(form, /*asUnsigned=*/to > from))
    return std::nullopt;
  form.isExact &= fits;
  return form;
}

/// From the forms of the operands; none if the value is a symbol.
std::optional<Form> Forms::combine(Value value) {
  if (auto constant = getConstant(value))
    return Form(*constant);
  SmallVector<Value, 2> parts = getParts(value);
  if (parts.empty())
    return std::nullopt;
  Operation *op = value.getDefiningOp();
  const Form &first = *raws.at(parts.front());
  if (isa<NegOp>(op))
    return Form(-1) * first;
  if (isa<PosOp>(op))
    return first;
  if (parts.size() == 1)
    return combineCast(op);
  const Form &second = *raws.at(parts.back());
  if (isa<arith::AddIOp, AddOp>(op))
    return first + second;
  if (isa<arith::SubIOp, SubOp>(op))
    return first - second;
  if (isa<arith::MulIOp, MulOp>(op))
    return first * second;
  if (isa<arith::ShLIOp, LShiftOp>(op)) {
    std::optional<int64_t> by = second.getConstant();
    bool isKnown = by && *by >= 0 && *by < getIntegerBits(value.getType());
    return isKnown ? first * Form(int64_t(uint64_t(1) << *by)) : std::nullopt;
  }
  bool isExact = first.isExact && second.isExact;
  return isExact && first.equals(second) ? std::optional(first) : std::nullopt;
}

const Form &Forms::raw(Value value) {
  if (auto found = raws.find(value); found != raws.end())
    return *found->second;
  SmallVector<Value> pending{value};
  while (!pending.empty()) {
    Value next = pending.back();
    bool isReady = true;
    for (Value part : getParts(next))
      if (!raws.contains(part)) {
        pending.push_back(part);
        isReady = false;
      }
    if (!isReady)
      continue;
    pending.pop_back();
    if (raws.contains(next))
      continue;
    std::optional<Form> form = combine(next);
    if (form)
      form = form->reduced(getIntegerBits(next.getType()));
    raws[next] = std::make_unique<Form>(form.value_or(Form(getSymbol(next))));
  }
  return *raws.at(value);
}

//===----------------------------------------------------------------------===//
// Loops
//===----------------------------------------------------------------------===//

/// The form with the values that a while loop passes on instead of those that
/// its second region calls them by.
Form Forms::expandPassed(Operation *loop, const Form &form) {
  auto while_ = dyn_cast<scf::WhileOp>(loop);
  if (!while_)
    return form;
  Form expanded = form;
  for (auto [argument, passed] : llvm::zip_equal(
           while_.getAfterArguments(), while_.getConditionOp().getArgs())) {
    Symbol symbol = Symbol::opaque(argument);
    std::optional<Form> factor = expanded.coefficientOf(symbol);
    if (!expanded.has(symbol) || !factor)
      continue;
    std::optional<Form> term = *factor * raw(passed);
    if (std::optional<Form> sum =
            term ? expanded.without(symbol) + *term : std::nullopt)
      expanded = *sum;
  }
  return expanded;
}

/// A value that a loop carries from iteration to iteration.
std::optional<Form> Forms::resolveCarried(Operation *loop, Value carried,
                                          Value init, Value yielded) {
  Symbol symbol = Symbol::opaque(carried);
  Form next = expandPassed(loop, raw(yielded));
  std::optional<Form> factor = next.coefficientOf(symbol);
  Form added = next.without(symbol);
  if (!factor || factor->getConstant() != 1 || !added.isDefinedOutside(loop))
    return std::nullopt;
  std::optional<Form> grown = Form(Symbol::trip(loop)) * added;
  std::optional<Form> sum = grown ? raw(init) + *grown : std::nullopt;
  return sum ? substitute(*sum, getIntegerBits(carried.getType()))
             : std::nullopt;
}

std::optional<Form> Forms::resolveArgument(BlockArgument argument) {
  Operation *owner = argument.getOwner()->getParentOp();
  unsigned number = argument.getArgNumber();
  unsigned bits = getIntegerBits(argument.getType());
  if (auto loop = dyn_cast_or_null<scf::ForOp>(owner)) {
    if (argument != loop.getInductionVar())
      return resolveCarried(loop, argument, loop.getInitArgs()[number - 1],
                            loop.getYieldedValues()[number - 1]);
    std::optional<Form> grown = Form(Symbol::trip(loop)) * raw(loop.getStep());
    std::optional<Form> counter =
        grown ? raw(loop.getLowerBound()) + *grown : std::nullopt;
    return counter ? substitute(*counter, bits) : std::nullopt;
  }
  auto loop = dyn_cast_or_null<scf::WhileOp>(owner);
  if (!loop)
    return std::nullopt;
  if (argument.getOwner() == loop.getAfterBody())
    return substitute(raw(loop.getConditionOp().getArgs()[number]), bits);
  return resolveCarried(loop, argument, loop.getInits()[number],
                        loop.getYieldOp().getOperand(number));
}

/// True if a form without resolved symbols is a number that `bits` hold, and so
/// are the numbers that its symbol stands for.
bool Forms::isNumber(const Form &form, unsigned bits) {
  std::optional<Symbol> symbol = form.getSymbol();
  if (!symbol || symbol->kind != Symbol::Kind::Opaque)
    return symbol || form.getConstant();
  Value value = symbol->getValue();
  return getIntegerBits(value.getType()) <= bits &&
         (!isa<BlockArgument>(value) || resolve(*symbol).isNumber);
}

/// A counter does not wrap before its loop ends; what else a loop adds up may.
const Forms::Resolved &Forms::resolve(Symbol symbol) {
  auto found = resolved.find(symbol.key);
  if (found != resolved.end())
    return *found->second;
  auto argument = cast<BlockArgument>(symbol.getValue());
  Operation *owner = argument.getOwner()->getParentOp();
  unsigned bits = getIntegerBits(argument.getType());
  Form form = resolveArgument(argument).value_or(Form(symbol)).reduced(bits);
  bool isNumber = form.getSymbol() == symbol || form.getConstant();
  if (auto loop = dyn_cast_or_null<scf::ForOp>(owner);
      loop && loop.getInductionVar() == argument)
    isNumber = !loop.getUnsignedCmp() &&
               this->isNumber(raw(loop.getLowerBound()), bits) &&
               raw(loop.getStep()).getConstant().value_or(0) > 0;
  else if (auto loop = dyn_cast_or_null<scf::WhileOp>(owner);
           loop && argument.getOwner() == loop.getAfterBody())
    isNumber = this->isNumber(
        raw(loop.getConditionOp().getArgs()[argument.getArgNumber()]), bits);
  return *(resolved[symbol.key] =
               std::make_unique<Resolved>(Resolved{form, isNumber}));
}

/// The form of a value of that many bits with arguments of blocks resolved.
std::optional<Form> Forms::substitute(const Form &form, unsigned bits) {
  Form sum(form.constant);
  sum.isExact = form.isExact;
  for (const Term &term : form.terms) {
    Form product(term.factor);
    for (Symbol symbol : term.product) {
      Form factor(symbol);
      if (symbol.kind == Symbol::Kind::Opaque &&
          isa<BlockArgument>(symbol.getValue())) {
        const Resolved &known = resolve(symbol);
        factor = known.form;
        factor.isExact &= known.isNumber ||
                          getIntegerBits(symbol.getValue().getType()) >= bits;
      }
      std::optional<Form> longer = product * factor;
      if (!longer)
        return std::nullopt;
      product = std::move(*longer);
    }
    std::optional<Form> longer = sum + product;
    if (!longer)
      return std::nullopt;
    sum = std::move(*longer);
  }
  return sum;
}

const Form &Forms::of(Value value) {
  if (auto found = forms.find(value); found != forms.end())
    return *found->second;
  const Form &unresolved = raw(value);
  unsigned bits = getIntegerBits(value.getType());
  Form form = substitute(unresolved, bits).value_or(unresolved).reduced(bits);
  return *(forms[value] = std::make_unique<Form>(std::move(form)));
}

std::optional<Form> Forms::countTrips(Operation *op) {
  auto loop = cast<scf::ForOp>(op);
  std::optional<Form> span =
      of(loop.getUpperBound()) - of(loop.getLowerBound());
  std::optional<int64_t> step = of(loop.getStep()).getConstant();
  if (!span || !step || *step < 1)
    return std::nullopt;
  if (auto constant = span->getConstant())
    return Form(*constant > 0 ? (*constant + *step - 1) / *step : 0);
  if (span->getDivisor() % *step != 0)
    return std::nullopt;
  Form trips = *span;
  trips.constant /= *step;
  for (Term &term : trips.terms)
    term.factor /= *step;
  return trips;
}
