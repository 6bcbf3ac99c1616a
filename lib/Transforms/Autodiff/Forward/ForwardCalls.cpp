//===- ForwardCalls.cpp - Tangents of calls -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A function with a derivative of its own is called, not inlined, up to here.
// Its pushforward gives the tangents of its results if it has one. Otherwise
// they follow from its pullback, which is linear in the cotangents: component k
// of the result has the tangent
//
//   sum over arguments of <pullback(arguments, e_k), tangent>
//
// with one call for each component, whatever the number of directions.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/Reverse/Cotangents.h"
#include "Forward.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

using namespace mlir;

namespace warp::autodiff {

//===----------------------------------------------------------------------===//
// Arrays among the arguments
//===----------------------------------------------------------------------===//

/// The first operation on an array or a view of it that is asked for; looks
/// into functions that it is passed to.
static Operation *findUse(Value array,
                          function_ref<bool(Operation *)> isMeant) {
  for (OpOperand &use : array.getUses()) {
    Operation *user = use.getOwner();
    Value inner;
    if (isMeant(user))
      return user;
    if (isa<ArrayViewOp>(user)) {
      inner = user->getResult(0);
    } else if (auto call = dyn_cast<func::CallOp>(user)) {
      auto callee = SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(
          call, call.getCalleeAttr());
      if (callee && !callee.isExternal())
        inner = callee.getArgument(use.getOperandNumber());
    }
    if (Operation *found = inner ? findUse(inner, isMeant) : nullptr)
      return found;
  }
  return nullptr;
}

Operation *findWrite(Value array) {
  return findUse(array, [](Operation *user) {
    auto access = dyn_cast<AccessOp>(user);
    return access && access.mayWrite();
  });
}

/// Rejects arrays whose tangents the derivative of the function does not know.
static LogicalResult checkArrays(func::CallOp op, func::FuncOp callee,
                                 func::FuncOp pullback,
                                 const TangentMap &tangents) {
  auto isGradient = [](Operation *user) { return isa<GradOp>(user); };
  for (auto [i, operand] : llvm::enumerate(op.getOperands())) {
    if (!isa<ArrayType>(operand.getType()) || !tangents.contains(operand))
      continue;
    Operation *write = findWrite(callee.getArgument(i));
    Operation *gradient = findUse(pullback.getArgument(i), isGradient);
    if (!write && !gradient)
      continue;
    InFlightDiagnostic error =
        op.emitError("the derivative of '")
        << callee.getName() << "' has no tangents of its array, argument "
        << i + 1 << ": pass elements of the array, and return what is to be "
        << "stored";
    error.attachNote((write ? write : gradient)->getLoc())
        << (write ? "the array is written here"
                  : "gradients of the array are updated here");
    return error;
  }
  return success();
}

//===----------------------------------------------------------------------===//
// Calls
//===----------------------------------------------------------------------===//

static ValueRange withoutResiduals(ValueRange results, func::FuncOp callee) {
  auto count = callee->getAttrOfType<IntegerAttr>(attr::residuals);
  return results.drop_back(count ? count.getInt() : 0);
}

static Value converted(OpBuilder &builder, Value value, Type type) {
  return value.getType() == type
             ? value
             : CastOp::create(builder, value.getLoc(), type, value).getResult();
}

bool hasOwnDerivative(func::FuncOp callee) {
  return callee->hasAttr(attr::vjp) || callee->hasAttr(attr::jvp);
}

LogicalResult ForwardBuilder::runCustom(func::CallOp op, func::FuncOp callee) {
  auto clone = cast<func::CallOp>(builder.clone(*op, values));
  forget(op.getResults());
  auto vjp = callee->getAttrOfType<FlatSymbolRefAttr>(attr::vjp);
  // Without a pullback it is a function of values that stays a call.
  auto pullback =
      vjp ? SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(callee, vjp)
          : func::FuncOp();
  if (pullback && failed(checkArrays(op, callee, pullback, directions[0])))
    return failure();
  bool isVaried = llvm::any_of(op.getOperands(), [&](Value operand) {
    return differentialType(operand.getType()) &&
           directions[0].contains(operand);
  });
  if (!isVaried)
    return success();
  ValueRange results = withoutResiduals(op.getResults(), callee);
  if (auto jvp = callee->getAttrOfType<FlatSymbolRefAttr>(attr::jvp))
    pushCustom(op, clone, results, jvp);
  else
    transposeCustom(op, clone, results, vjp);
  return success();
}

/// Functions know no wider floats: they take tangents in their own types.
void ForwardBuilder::pushCustom(func::CallOp op, func::CallOp clone,
                                ValueRange results,
                                FlatSymbolRefAttr pushforward) {
  Location loc = op.getLoc();
  SmallVector<Value> receivers = llvm::filter_to_vector(
      results, [](Value v) { return bool(differentialType(v.getType())); });
  SmallVector<Type> types(ValueRange(receivers).getTypes());
  for (TangentMap &tangents : directions) {
    SmallVector<Value> operands(clone.getOperands());
    for (Value operand : op.getOperands())
      if (differentialType(operand.getType()))
        operands.push_back(converted(
            builder, getTangentOrZero(operand, tangents), operand.getType()));
    auto call = func::CallOp::create(builder, loc, types,
                                     pushforward.getValue(), operands);
    for (auto [result, tangent] : llvm::zip_equal(receivers, call.getResults()))
      tangents[result] = converted(builder, tangent,
                                   differentialType(result.getType()));
  }
}

/// The composite, or scalar, with 1 at one component and 0 elsewhere.
static Value unit(OpBuilder &builder, Location loc, Type type, int64_t at) {
  auto scalar = cast<FloatType>(getElementScalar(type));
  Value one = constant(builder, loc, scalar, 1);
  if (!isComposite(type))
    return one;
  SmallVector<Value> components(getComponentCount(type),
                                constant(builder, loc, scalar, 0));
  components[at] = one;
  return ConstructOp::create(builder, loc, type, components);
}

static Value dot(OpBuilder &builder, Location loc, Value a, Value b) {
  auto multiply = [&](Value x, Value y) -> Value {
    return createBuiltin(builder, loc, "mul", {x, y})->getResult(0);
  };
  Type type = a.getType();
  if (!isComposite(type))
    return multiply(a, b);
  Value sum;
  for (int64_t i = 0, n = getComponentCount(type); i < n; ++i) {
    auto at = getSlotIndices(builder, loc, type, i);
    auto pick = [&](Value composite) -> Value {
      return ExtractOp::create(builder, loc, getElementScalar(type), composite,
                               at);
    };
    sum = add(builder, loc, sum, multiply(pick(a), pick(b)));
  }
  return sum;
}

/// The cotangents of arguments, with their tangents.
Value ForwardBuilder::dotTangents(func::CallOp op, ValueRange cotangents,
                                  const TangentMap &tangents) {
  Value sum;
  for (Value operand : op.getOperands()) {
    Type type = differentialType(operand.getType());
    if (!type)
      continue;
    Value cotangent = cotangents.front();
    cotangents = cotangents.drop_front();
    if (Value tangent = tangents.lookup(operand))
      sum = add(builder, op.getLoc(), sum,
                dot(builder, op.getLoc(), converted(builder, cotangent, type),
                    tangent));
  }
  return sum;
}

void ForwardBuilder::transposeCustom(func::CallOp op, func::CallOp clone,
                                     ValueRange results,
                                     FlatSymbolRefAttr pullback) {
  Location loc = op.getLoc();
  SmallVector<Value> operands(clone.getOperands());
  llvm::append_range(operands, clone.getResults().drop_front(results.size()));
  size_t firstSeed = operands.size();
  SmallVector<Value> receivers = llvm::filter_to_vector(
      results, [](Value v) { return bool(differentialType(v.getType())); });
  for (Value result : receivers)
    operands.push_back(zero(builder, loc, result.getType()));
  SmallVector<Type> types = llvm::filter_to_vector(
      op.getOperandTypes(), [](Type t) { return bool(differentialType(t)); });
  for (auto [i, result] : llvm::enumerate(receivers)) {
    Type type = result.getType();
    int64_t count = isComposite(type) ? getComponentCount(type) : 1;
    SmallVector<SmallVector<Value>, 1> components(directions.size());
    for (int64_t k = 0; k < count; ++k) {
      SmallVector<Value> seeded(operands);
      seeded[firstSeed + i] = unit(builder, loc, type, k);
      auto call = func::CallOp::create(builder, loc, types,
                                       pullback.getValue(), seeded);
      for (auto [found, tangents] : llvm::zip_equal(components, directions))
        found.push_back(dotTangents(op, call.getResults(), tangents));
    }
    for (auto [found, tangents] : llvm::zip_equal(components, directions))
      tangents[result] =
          isComposite(type)
              ? ConstructOp::create(builder, loc, differentialType(type), found)
                    .getResult()
              : found[0];
  }
}

} // namespace warp::autodiff
