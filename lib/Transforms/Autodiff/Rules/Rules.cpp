//===- Rules.cpp - Derivatives of single operations -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Rules.h"
#include "Formula.h"
#include "RulesByFunction.h"
#include "RulesOfComposites.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/TileOps.h"

#include "llvm/ADT/StringMap.h"

using namespace mlir;

namespace warp::autodiff {

//===----------------------------------------------------------------------===//
// The table
//===----------------------------------------------------------------------===//

namespace {
/// The rule of one overload.
struct RuleEntry {
  llvm::StringLiteral opName;
  unsigned overload;
  /// Cotangent of one operand.
  Expr (*adjoint)(Formula &, unsigned operand);
  /// Tangent of the result. Without, it is the sum of the adjoints with each
  /// tangent for `g`, or of the operation itself with each operand replaced.
  Expr (*tangent)(Formula &);
  bool bySubstitution;
  bool needsResult;
  bool isSingular;
};

#include "WarpDialect/Derivatives.inc"
} // namespace

static const RuleEntry *lookupRule(Operation *op) {
  static const llvm::StringMap<const RuleEntry *> firstOf = [] {
    llvm::StringMap<const RuleEntry *> map;
    for (const RuleEntry &entry : ruleTable)
      map.try_emplace(entry.opName, &entry);
    return map;
  }();
  const RuleEntry *entry = firstOf.lookup(op->getName().getStringRef());
  if (!entry)
    return nullptr;
  auto match = matchBuiltin(cast<BuiltinOp>(op).getSpec(), op->getContext(),
                            op->getOperandTypes());
  for (; match && entry != std::end(ruleTable) &&
         entry->opName == op->getName().getStringRef();
       ++entry)
    if (entry->overload == match->overload)
      return entry;
  return nullptr;
}

/// The rule of an operation whose record says `RuleByFunction`.
struct FunctionRule {
  RuleFunction pullback = nullptr, pushforward = nullptr;
};

static FunctionRule lookupFunctionRule(Operation *op) {
  static const llvm::StringMap<FunctionRule> table = {
#define WARP_RULE_BY_FUNCTION(Name)                                            \
  {Name##Op::getOperationName(), {pullback##Name, pushforward##Name}},
#include "WarpDialect/Derivatives.inc"
  };
  return table.lookup(op->getName().getStringRef());
}

static DerivativeKind getDerivative(Operation *op) {
  auto builtin = dyn_cast<BuiltinOp>(op);
  return builtin ? builtin.getSpec().derivative : DerivativeKind::None;
}

bool needsResults(Operation *op) {
  const RuleEntry *rule = lookupRule(op);
  return rule ? rule->needsResult : bool(lookupFunctionRule(op).pullback);
}

bool isSingular(Operation *op) {
  const RuleEntry *rule = lookupRule(op);
  return rule && rule->isSingular;
}

bool isDifferentiable(Operation *op) {
  return isa<BuiltinOp>(op) ? getDerivative(op) == DerivativeKind::Function
                            : isCompositeOp(op);
}

bool hasRule(Operation *op) {
  return isCompositeOp(op) || lookupRule(op) ||
         lookupFunctionRule(op).pullback ||
         getDerivative(op) == DerivativeKind::Zero;
}

/// Reports an operation that nothing differentiates.
static LogicalResult refuse(Operation *op) {
  auto builtin = dyn_cast<BuiltinOp>(op);
  if (!builtin)
    return op->emitError("operation '")
           << op->getName() << "' has no derivative";
  StringRef name = builtin.getSpec().pythonName;
  if (isDifferentiable(op))
    return op->emitError("'") << name << "' has to be expanded before it is "
                                         "differentiated";
  return op->emitError("'")
         << name << "' has no derivative, but a gradient reaches its operands; "
         << "write stop_gradient(...) around them, or a custom derivative";
}

//===----------------------------------------------------------------------===//
// Both modes
//===----------------------------------------------------------------------===//

FailureOr<SmallVector<Value>>
pullback(RuleContext &context, Operation *op, ValueRange operands,
         ValueRange results, ArrayRef<Value> cotangents,
         ArrayRef<bool> wanted) {
  SmallVector<Value> adjoints(op->getNumOperands());
  if (getDerivative(op) == DerivativeKind::Zero ||
      llvm::none_of(cotangents, [](Value g) { return bool(g); }))
    return adjoints;
  if (isCompositeOp(op)) {
    pullbackComposite(context, op, operands, cotangents[0], wanted, adjoints);
    return adjoints;
  }
  if (FunctionRule rule = lookupFunctionRule(op); rule.pullback)
    return rule.pullback(context, {op, operands, results, cotangents, wanted});
  const RuleEntry *rule = lookupRule(op);
  if (!rule)
    return refuse(op);
  Formula formula(context, operands, results);
  formula.seed = cotangents[0];
  for (unsigned i = 0; i < adjoints.size(); ++i) {
    Type type = differentialType(operands[i].getType());
    if (!wanted[i] || !type)
      continue;
    Expr adjoint = rule->adjoint(formula, i);
    if (!adjoint.isNumber(0))
      adjoints[i] = formula.materialize(adjoint, type);
  }
  return adjoints;
}

/// The sum over the operands of what their tangents do to the result.
static Value sumTangents(RuleContext &context, Operation *op,
                         const RuleEntry &rule, Formula &formula,
                         ValueRange operands, ArrayRef<Value> tangents) {
  Value sum;
  for (unsigned i = 0; i < tangents.size(); ++i) {
    if (!tangents[i])
      continue;
    Value term;
    if (rule.bySubstitution) {
      SmallVector<Value, 3> replaced(operands);
      replaced[i] = tangents[i];
      term = createBuiltin(context.builder, context.loc,
                           cast<BuiltinOp>(op).getSpec(), replaced)
                 ->getResult(0);
    } else {
      formula.seed = tangents[i];
      Expr partial = rule.adjoint(formula, i);
      if (!partial.isNumber(0))
        term = formula.materialize(partial, tangents[i].getType());
    }
    sum = add(context.builder, context.loc, sum, term);
  }
  return sum;
}

FailureOr<SmallVector<Value>> pushforward(RuleContext &context, Operation *op,
                                          ValueRange operands,
                                          ValueRange results,
                                          ArrayRef<Value> tangents) {
  SmallVector<Value> derivatives(op->getNumResults());
  if (getDerivative(op) == DerivativeKind::Zero ||
      llvm::none_of(tangents, [](Value t) { return bool(t); }) ||
      llvm::none_of(op->getResultTypes(), differentialType))
    return derivatives;
  if (isCompositeOp(op)) {
    derivatives[0] = pushforwardComposite(context, op, operands, tangents);
    return derivatives;
  }
  if (FunctionRule rule = lookupFunctionRule(op); rule.pushforward) {
    SmallVector<bool> all(op->getNumOperands(), true);
    return rule.pushforward(context, {op, operands, results, tangents, all});
  }
  const RuleEntry *rule = lookupRule(op);
  if (!rule)
    return refuse(op);
  Formula formula(context, operands, results);
  if (!rule->tangent) {
    derivatives[0] =
        sumTangents(context, op, *rule, formula, operands, tangents);
    return derivatives;
  }
  formula.tangents = tangents;
  for (Value tangent : tangents)
    if (tangent && !formula.seed)
      formula.seed = tangent;
  Expr tangent = rule->tangent(formula);
  if (!tangent.isNumber(0))
    derivatives[0] = formula.materialize(
        tangent, differentialType(op->getResult(0).getType()));
  return derivatives;
}

//===----------------------------------------------------------------------===//
// Differentials
//===----------------------------------------------------------------------===//

Type differentialType(Type type) {
  if (auto tile = dyn_cast<TileType>(type)) {
    Type element = differentialType(tile.getElementType());
    return element ? TileType::get(type.getContext(), tile.getShape(), element)
                   : Type();
  }
  Type scalar = isScalar(type) || isComposite(type) ? getElementScalar(type)
                                                    : Type();
  if (!scalar || !isFloat(scalar))
    return {};
  if (scalar.getIntOrFloatBitWidth() >= 32)
    return type;
  return withElementScalar(type, Float32Type::get(type.getContext()));
}

Value constant(OpBuilder &builder, Location loc, FloatType type,
               double number) {
  return ConstantOp::create(builder, loc, FloatAttr::get(type, number));
}

Value zero(OpBuilder &builder, Location loc, Type type) {
  if (auto tile = dyn_cast<TileType>(type))
    return TileSplatOp::create(builder, loc, type,
                               zero(builder, loc, tile.getElementType()));
  if (isComposite(type))
    return ConstructOp::create(builder, loc, type, ValueRange());
  if (auto scalar = dyn_cast<FloatType>(type))
    return constant(builder, loc, scalar, 0);
  return ConstantOp::create(
      builder, loc, cast<TypedAttr>(builder.getIntegerAttr(type, 0)));
}

Value isLeft(OpBuilder &builder, Location loc, Value left, Value value) {
  auto builtin = [&](StringRef name, ValueRange operands) {
    return createBuiltin(builder, loc, name, operands)->getResult(0);
  };
  Value isEqual = builtin("eq", {left, value});
  if (!isa<FloatType>(value.getType()))
    return isEqual;
  return builtin("where", {builtin("isnan", value), builtin("isnan", left),
                           isEqual});
}

Value add(OpBuilder &builder, Location loc, Value a, Value b) {
  if (!a || !b)
    return a ? a : b;
  if (isa<TileType>(a.getType()))
    return mapTiles(builder, loc, {a, b}, [&](ValueRange elements) {
      return add(builder, loc, elements[0], elements[1]);
    });
  return createBuiltin(builder, loc, "add", {a, b})->getResult(0);
}

Value mapTiles(OpBuilder &builder, Location loc, ValueRange inputs,
               function_ref<Value(ValueRange)> function) {
  SmallVector<Type> elements;
  ArrayRef<int64_t> shape;
  for (Value input : inputs) {
    auto tile = dyn_cast<TileType>(input.getType());
    elements.push_back(tile ? tile.getElementType() : input.getType());
    if (tile)
      shape = tile.getShape();
  }
  Region body;
  Value result;
  {
    OpBuilder::InsertionGuard guard(builder);
    Block *block = builder.createBlock(
        &body, {}, elements, SmallVector<Location>(elements.size(), loc));
    result = function(block->getArguments());
    TileYieldOp::create(builder, loc, result);
  }
  Type type = TileType::get(builder.getContext(), shape, result.getType());
  auto map = TileMapOp::create(builder, loc, TypeRange(type), inputs);
  map.getBody().takeBody(body);
  return map.getResult(0);
}

Value addInAnyOrder(OpBuilder &builder, Location loc, Value sum, Value term) {
  Value total = add(builder, loc, sum, term);
  total.getDefiningOp()->setAttr(attr::anyOrder, builder.getUnitAttr());
  return total;
}

//===----------------------------------------------------------------------===//
// Half precision
//===----------------------------------------------------------------------===//

namespace {
/// Finds or makes the f32 form of values of 16 bits. Results of arithmetic
/// are computed again rather than converted: otherwise a partial derivative
/// would be zero because a product vanished on the way.
class Widening {
public:
  Widening(OpBuilder &builder, Location loc) : builder(builder), loc(loc) {}

  Value widen(Value value) {
    Type type = differentialType(value.getType());
    if (!type || type == value.getType())
      return value;
    if (Value known = wide.lookup(value))
      return known;
    Value found = recompute(value);
    if (!found)
      found = CastOp::create(builder, loc, type, value);
    return wide[value] = found;
  }

private:
  Value recompute(Value value) {
    Operation *op = value.getDefiningOp();
    if (!op || left == 0 || !isa<BuiltinOp>(op) || !isDifferentiable(op) ||
        op->getNumResults() != 1)
      return {};
    --left;
    SmallVector<Value, 3> operands;
    for (Value operand : op->getOperands())
      operands.push_back(widen(operand));
    return createBuiltin(builder, loc, cast<BuiltinOp>(op).getSpec(), operands)
        ->getResult(0);
  }

  OpBuilder &builder;
  Location loc;
  llvm::DenseMap<Value, Value> wide;
  /// Operations that may still be made.
  int left = 32;
};
} // namespace

Value widen(OpBuilder &builder, Location loc, Value value) {
  return Widening(builder, loc).widen(value);
}

} // namespace warp::autodiff
