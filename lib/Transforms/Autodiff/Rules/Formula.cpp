//===- Formula.cpp - Operands and operations of derivative formulas -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Formula.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Matchers.h"

using namespace mlir;

namespace warp::autodiff {

static Expr create(Formula &formula, StringRef name, ArrayRef<Value> operands,
                   RuleContext &context) {
  Operation *op = createBuiltin(context.builder, context.loc, name, operands);
  assert(op && "a formula does not fit the types of its overload");
  return formula.wrap(op->getResult(0));
}

Value Formula::materialize(Expr expr, Type type) {
  if (!expr.isNumber())
    return expr.value;
  OpBuilder &b = context.builder;
  if (expr.number == 0)
    return zero(b, context.loc, type);
  auto scalar = cast<FloatType>(getElementScalar(type));
  return constant(b, context.loc, scalar, expr.number);
}

Expr Formula::callWhere(ArrayRef<Expr> args) {
  Expr condition = args[0], yes = args[1], no = args[2];
  if (condition.isNumber())
    return condition.number != 0 ? yes : no;
  if (yes.isNumber() && no.isNumber() && yes.number == no.number)
    return yes;
  Type type = yes.value  ? yes.value.getType()
              : no.value ? no.value.getType()
                         : getElementScalar(operands.back().getType());
  return create(*this, "where",
                {condition.value, materialize(yes, type),
                 materialize(no, type)},
                context);
}

/// Logic of conditions of which some are known.
static std::optional<Expr> foldLogic(StringRef name, ArrayRef<Expr> args) {
  if (name == "unot" && args[0].isNumber())
    return args[0].formula->number(args[0].number == 0);
  bool isAnd = name == "bit_and";
  if (!isAnd && name != "bit_or")
    return std::nullopt;
  for (auto [known, other] : {std::pair(args[0], args[1]),
                              std::pair(args[1], args[0])})
    if (known.isNumber())
      return isAnd == (known.number != 0) ? other : known;
  return std::nullopt;
}

Expr Formula::call(StringRef name, std::initializer_list<Expr> list) {
  ArrayRef<Expr> args(list);
  if (name == "where")
    return callWhere(args);
  if (auto folded = foldLogic(name, args))
    return *folded;
  Type type = getElementScalar(operands.back().getType());
  for (Expr arg : args)
    if (arg.value)
      type = arg.value.getType();
  SmallVector<Value, 3> values;
  for (Expr arg : args)
    values.push_back(materialize(arg, type));
  return create(*this, name, values, context);
}

/// A guard against what an operand may be is not needed for one that is known.
static bool isNonzeroConstant(Value value) {
  FloatAttr number;
  return matchPattern(value, m_Constant(&number)) &&
         number.getValue().isFiniteNonZero();
}

Expr Formula::unless(llvm::function_ref<Expr()> isSingular,
                     llvm::function_ref<Expr()> value, bool isReported) {
  if (context.singular == Singular::Strict ||
      (!isReported && isNonzeroConstant(operands.back())))
    return value();
  Expr singular = isSingular(), regular = value();
  // Zero times a finite number is zero already, and its derivative is not.
  if (!isReported)
    singular = call("bit_and", {singular, call("isnan", {regular})});
  if (context.singular == Singular::Report && context.report && isReported &&
      singular.value)
    context.report(
        call("bit_and", {singular, cotangent() != number(0)}).value);
  return call("where", {singular, number(0), regular});
}

/// Looks a few operations back, so that long sums and products stay cheap.
static bool mayBeInfinite(Value value, unsigned depth) {
  Operation *op = value.getDefiningOp();
  if (!op || depth == 0 || !differentialType(value.getType()))
    return false;
  // For a branch, the values that its regions yield.
  unsigned number = cast<OpResult>(value).getResultNumber();
  for (Region &region : op->getRegions())
    if (!region.empty()) {
      Operation *end = region.front().getTerminator();
      if (number < end->getNumOperands() &&
          mayBeInfinite(end->getOperand(number), depth - 1))
        return true;
    }
  if (!isDifferentiable(op))
    return false;
  return isSingular(op) || llvm::any_of(op->getOperands(), [&](Value operand) {
           return mayBeInfinite(operand, depth - 1);
         });
}

bool Formula::mayBeInfinite(Expr expr) {
  return expr.value && autodiff::mayBeInfinite(expr.value, 4);
}

/// True if an operation comes before the insertion point of `b`, on every path.
static bool isBefore(Operation *op, OpBuilder &b) {
  Block *block = b.getInsertionBlock();
  if (op->getBlock() == block)
    return b.getInsertionPoint() == block->end() ||
           op->isBeforeInBlock(&*b.getInsertionPoint());
  Operation *around =
      op->getBlock()->findAncestorOpInBlock(*block->getParentOp());
  return around && op->isBeforeInBlock(around);
}

Expr Formula::knownReciprocal(Expr divisor) {
  Value root = divisor.value;
  bool isTwice = false;
  if (auto product = root.getDefiningOp<MulOp>()) {
    APFloat factor(0.0f);
    if (!matchPattern(product->getOperand(0), m_ConstantFloat(&factor)) ||
        factor.convertToDouble() != 2)
      return number(0);
    root = product->getOperand(1);
    isTwice = true;
  }
  if (!root.getDefiningOp<SqrtOp>())
    return number(0);
  for (Operation *user : root.getUsers())
    if (isa<DivOp>(user) && matchPattern(user->getOperand(0), m_OneFloat()) &&
        isBefore(user, context.builder))
      return isTwice ? number(0.5) * wrap(user->getResult(0))
                     : wrap(user->getResult(0));
  return number(0);
}

void Formula::require(Expr condition, StringRef message) {
  if (!condition.isNumber() && context.singular != Singular::Strict)
    AssertOp::create(context.builder, context.loc, condition.value, message);
}

//===----------------------------------------------------------------------===//
// Operators
//===----------------------------------------------------------------------===//

static Expr combine(StringRef name, Expr a, Expr b) {
  return a.formula->call(name, {a, b});
}

Expr operator+(Expr a, Expr b) {
  if (a.isNumber() && b.isNumber())
    return a.formula->number(a.number + b.number);
  if (a.isNumber(0))
    return b;
  return b.isNumber(0) ? a : combine("add", a, b);
}

Expr operator-(Expr a, Expr b) {
  if (a.isNumber() && b.isNumber())
    return a.formula->number(a.number - b.number);
  if (a.isNumber(0))
    return -b;
  return b.isNumber(0) ? a : combine("sub", a, b);
}

Expr operator*(Expr a, Expr b) {
  if (a.isNumber() && b.isNumber())
    return a.formula->number(a.number * b.number);
  if (a.isNumber(0) || b.isNumber(1))
    return a;
  return b.isNumber(0) || a.isNumber(1) ? b : combine("mul", a, b);
}

Expr operator/(Expr a, Expr b) {
  if (a.isNumber() && b.isNumber())
    return a.formula->number(a.number / b.number);
  if (a.isNumber(0) || b.isNumber(1))
    return a;
  Expr inverse = b.isNumber() ? b : b.formula->knownReciprocal(b);
  return inverse.isNumber() ? combine("div", a, b) : a * inverse;
}

Expr operator-(Expr a) {
  return a.isNumber() ? a.formula->number(-a.number)
                      : a.formula->call("neg", {a});
}

#define WARP_COMPARISON(symbol, name)                                          \
  Expr operator symbol(Expr a, Expr b) {                                       \
    if (a.isNumber() && b.isNumber())                                          \
      return a.formula->number(a.number symbol b.number);                      \
    return combine(name, a, b);                                                \
  }
WARP_COMPARISON(==, "eq")
WARP_COMPARISON(!=, "ne")
WARP_COMPARISON(<, "lt")
WARP_COMPARISON(<=, "le")
WARP_COMPARISON(>, "gt")
WARP_COMPARISON(>=, "ge")
#undef WARP_COMPARISON

} // namespace warp::autodiff
