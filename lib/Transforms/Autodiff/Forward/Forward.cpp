//===- Forward.cpp - Forward mode: tangents of a kernel -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The dual of a kernel does all that the kernel does and carries a tangent
// beside every value that depends on an active array. An active array has a
// twin, an argument after those of the kernel, with a tangent for each of its
// elements: what is loaded from an array has the tangent that is loaded from
// its twin, and what is stored stores its tangent. So there is nothing to
// recover, and the order of the kernel's own statements is kept.
//
// Tangents along several directions share what is computed of the kernel: an
// active array has one twin per direction, and rules are applied once for each
// to the same primal values. Their common parts become one operation later.
//
//   operation               the dual has beside it          in file
//   builtin, value op       its rule (Rules.h)              (this one)
//   scf, call               tangents carried along          (this one)
//   call with a derivative  that derivative                 ForwardCalls.cpp
//   atomic min, max         the tangent of the winner       ForwardExtrema.cpp
//   load, store, atomic     the same on the twin            ForwardMemory.cpp
//   view, warp.grad         the same of the twin            ForwardMemory.cpp
//   which values            ForwardVaried.cpp
//
// The gradient of an array's twin is the twin of its gradient. Therefore an
// adjoint can be taken through this pass like any other kernel, which gives
// products of a Hessian with a vector.
//
//===----------------------------------------------------------------------===//

#include "Forward.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

Type getTangentType(Type type) {
  if (auto array = dyn_cast<ArrayType>(type)) {
    Type element = getGradientElement(array.getElementType());
    return element ? ArrayType::get(type.getContext(), array.getRank(), element)
                   : Type();
  }
  if (auto scratch = dyn_cast<ScratchType>(type)) {
    Type element = differentialType(scratch.getElementType());
    return element ? ScratchType::get(type.getContext(), scratch.getSlots(),
                                      element)
                   : Type();
  }
  return differentialType(type);
}

ForwardBuilder::ForwardBuilder(func::FuncOp primal, func::FuncOp dual,
                               const ForwardOptions &options)
    : builder(dual.getContext()), options(options), primal(primal), dual(dual),
      leaves(primal), varied(primal, leaves, options.active),
      directions(options.width) {}

LogicalResult ForwardBuilder::build() {
  Block &body = primal.getBody().front();
  for (auto [from, to] :
       llvm::zip_equal(body.getArguments(), dual.getArguments()))
    values.map(from, to);
  addTwins();
  if (options.winners)
    collectUpdates();
  builder.setInsertionPointToStart(&dual.getBody().front());
  if (failed(run(body)))
    return failure();
  func::ReturnOp::create(builder, primal.getLoc());
  return success();
}

//===----------------------------------------------------------------------===//
// Arguments
//===----------------------------------------------------------------------===//

static void collectArrays(Type type, SmallVectorImpl<ArrayType> &arrays) {
  if (auto array = dyn_cast<ArrayType>(type))
    arrays.push_back(array);
  else if (auto structure = dyn_cast<StructType>(type))
    for (Type field : structure.getFieldTypes())
      collectArrays(field, arrays);
}

void ForwardBuilder::addTwins() {
  SmallVector<ArrayType> arrays;
  for (Type type : primal.getArgumentTypes())
    collectArrays(type, arrays);
  for (auto [leaf, array] : llvm::enumerate(arrays)) {
    twins.emplace_back();
    bool isActive = options.active.empty() || options.active[leaf];
    Type type = isActive ? getTangentType(array) : Type();
    if (!type)
      continue;
    for (unsigned direction = 0; direction < options.width; ++direction)
      twins.back().push_back(addHidden(
          dual,
          HiddenAttr::get(dual.getContext(), HiddenKind::Tangent, leaf,
                          direction),
          type));
  }
  for (BlockArgument argument : primal.getArguments())
    if (isa<ArrayType>(argument.getType()))
      for (auto [tangents, twin] :
           llvm::zip(directions, twins[leaves.of(argument)[0]]))
        tangents[argument] = twin;
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

SmallVector<Value> ForwardBuilder::lookup(ValueRange primals) const {
  return llvm::map_to_vector(primals,
                             [&](Value v) { return values.lookup(v); });
}

void ForwardBuilder::forget(ValueRange primals) {
  for (TangentMap &tangents : directions)
    for (Value primal : primals)
      tangents.erase(primal);
}

Value ForwardBuilder::getTangentOrZero(Value primal,
                                       const TangentMap &tangents) {
  if (Value tangent = tangents.lookup(primal))
    return tangent;
  return zero(builder, primal.getLoc(), differentialType(primal.getType()));
}

LogicalResult ForwardBuilder::run(Block &block) {
  for (Operation &op : block.without_terminator())
    if (failed(run(&op)))
      return failure();
  return success();
}

LogicalResult ForwardBuilder::run(Operation *op) {
  if (op->getNumRegions() != 0)
    return runRegions(op);
  if (options.winners)
    if (auto done = runForWinners(op))
      return *done;
  if (auto call = dyn_cast<func::CallOp>(op))
    return runCall(call);
  Operation *clone = builder.clone(*op, values);
  // An operation with results starts without tangents each time it is run.
  forget(op->getResults());
  bool isMemory = false;
  for (TangentMap &tangents : directions) {
    auto done = runMemory(op, clone, tangents);
    isMemory = done.has_value();
    if (!isMemory)
      break;
    if (failed(*done))
      return failure();
  }
  return isMemory ? success() : runRule(op, clone);
}

LogicalResult ForwardBuilder::runRule(Operation *op, Operation *clone) {
  bool isVaried = llvm::any_of(op->getOperands(), [&](Value operand) {
    return directions[0].contains(operand);
  });
  if (!isVaried || llvm::none_of(op->getResultTypes(), differentialType))
    return success();
  RuleContext context{builder, op->getLoc(), options.singular};
  if (options.countRepeated)
    context.report = [this, op](Value isRepeated) {
      countRepeated(op->getLoc(), isRepeated);
    };
  // One basis suits one direction.
  bool areWidened =
      !llvm::equal(clone->getResultTypes(),
                   llvm::map_range(clone->getResultTypes(), differentialType));
  if (options.countRepeated && directions.size() == 1 && !areWidened)
    context.replace = [this, op](unsigned result, Value value) {
      values.map(op->getResult(result), value);
    };
  auto widenAll = [&](ValueRange range) {
    return llvm::map_to_vector(range, [&](Value value) {
      return widen(builder, op->getLoc(), value);
    });
  };
  SmallVector<Value> operands = widenAll(clone->getOperands());
  SmallVector<Value> results = widenAll(clone->getResults());
  for (TangentMap &tangents : directions) {
    auto seeds = llvm::map_to_vector(op->getOperands(), [&](Value operand) {
      return tangents.lookup(operand);
    });
    auto derivatives = pushforward(context, op, operands, results, seeds);
    if (failed(derivatives))
      return failure();
    for (auto [result, tangent] :
         llvm::zip_equal(op->getResults(), *derivatives))
      if (tangent)
        tangents[result] = tangent;
  }
  return success();
}

void ForwardBuilder::countRepeated(Location loc, Value isRepeated) {
  Type arrayType =
      ArrayType::get(builder.getContext(), 1, builder.getIntegerType(32, true));
  if (!counters)
    counters = addHidden(
        dual, HiddenAttr::get(dual.getContext(), HiddenKind::Counters, -1, 0),
        arrayType);
  countOne(builder, loc, isRepeated, counters, repeatedPlaces);
}

/// The body of the function in place of the call, unless the function has a
/// derivative of its own.
LogicalResult ForwardBuilder::runCall(func::CallOp op) {
  auto callee =
      SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(op,
                                                         op.getCalleeAttr());
  if (callee && hasOwnDerivative(callee))
    return runCustom(op, callee);
  if (!callee || callee.isExternal())
    return op.emitError("the call of '")
           << op.getCallee() << "' has no tangents: its body is not known";
  auto bind = [&](ValueRange from, ValueRange to) {
    for (auto [a, b] : llvm::zip_equal(from, to)) {
      values.map(b, values.lookup(a));
      forget(b);
      for (TangentMap &tangents : directions)
        if (Value tangent = tangents.lookup(a))
          tangents[b] = tangent;
    }
  };
  Block &body = callee.getBody().front();
  bind(op.getOperands(), body.getArguments());
  if (failed(run(body)))
    return failure();
  bind(body.getTerminator()->getOperands(), op.getResults());
  return success();
}

//===----------------------------------------------------------------------===//
// Control flow
//===----------------------------------------------------------------------===//

LogicalResult
ForwardBuilder::appendTangents(Location loc, ValueRange range,
                               ArrayRef<unsigned> carried,
                               SmallVectorImpl<Value> &to) {
  for (TangentMap &tangents : directions)
    for (unsigned i : carried) {
      if (isa<ArrayType>(range[i].getType()) && !tangents.lookup(range[i]))
        return emitError(loc, "an array with tangents and one without them are "
                              "exchanged here; give both arrays tangents");
      to.push_back(getTangentOrZero(range[i], tangents));
    }
  return success();
}

void ForwardBuilder::openBlock(Region &region, Block &from, unsigned first,
                               ArrayRef<unsigned> carried) {
  Block *to = builder.createBlock(&region);
  for (BlockArgument argument : from.getArguments())
    values.map(argument,
               to->addArgument(argument.getType(), argument.getLoc()));
  for (TangentMap &tangents : directions)
    for (unsigned i : carried) {
      BlockArgument argument = from.getArgument(first + i);
      tangents[argument] = to->addArgument(getTangentType(argument.getType()),
                                           argument.getLoc());
    }
}

LogicalResult ForwardBuilder::closeBlock(Block &from, unsigned first,
                                         ArrayRef<unsigned> carried) {
  Operation *end = from.getTerminator();
  SmallVector<Value> operands = lookup(end->getOperands());
  if (failed(appendTangents(end->getLoc(), end->getOperands().drop_front(first),
                            carried, operands)))
    return failure();
  Operation *clone = end->cloneWithoutRegions();
  clone->setOperands(operands);
  builder.insert(clone);
  return success();
}

/// `scf.if`, `scf.for` and `scf.while`: what they carry and yield, with its
/// tangents after it.
LogicalResult ForwardBuilder::runRegions(Operation *op) {
  Region &region = op->getRegion(0);
  bool isWhile = isa<scf::WhileOp>(op), isFor = isa<scf::ForOp>(op);
  if (!isWhile && !isFor && !isa<scf::IfOp>(op))
    return op->emitError("operation '") << op->getName()
                                        << "' has no tangents";
  // Bounds of a loop, the condition of a branch; the counter of a loop.
  unsigned facts = isFor ? 3 : isWhile ? 0 : 1, counters = isFor ? 1 : 0;
  SmallVector<unsigned> results = varied.select(op->getResults());
  SmallVector<unsigned> carried;
  if (isFor || isWhile)
    carried = varied.select(region.getArguments().drop_front(counters));

  SmallVector<Value> operands = lookup(op->getOperands());
  if (failed(appendTangents(op->getLoc(), op->getOperands().drop_front(facts),
                            carried, operands)))
    return failure();
  SmallVector<Type> types(op->getResultTypes());
  for (unsigned direction = 0; direction < options.width; ++direction)
    for (unsigned i : results)
      types.push_back(getTangentType(op->getResult(i).getType()));
  Operation *rebuilt = Operation::create(
      op->getLoc(), op->getName(), types, operands,
      op->getDiscardableAttrDictionary(), op->getPropertiesStorage(),
      BlockRange(), op->getNumRegions());
  builder.insert(rebuilt);

  OpBuilder::InsertionGuard guard(builder);
  for (auto [i, from] : llvm::enumerate(op->getRegions())) {
    if (from.empty())
      continue;
    bool isCondition = isWhile && i == 0;
    bool isAfter = isWhile && i == 1;
    openBlock(rebuilt->getRegion(i), from.front(), counters,
              isAfter ? results : carried);
    if (failed(run(from.front())) ||
        failed(closeBlock(from.front(), isCondition ? 1 : 0,
                          isCondition || (!isFor && !isWhile) ? results
                                                              : carried)))
      return failure();
  }
  forget(op->getResults());
  unsigned next = op->getNumResults();
  for (unsigned i = 0; i < op->getNumResults(); ++i)
    values.map(op->getResult(i), rebuilt->getResult(i));
  for (TangentMap &tangents : directions)
    for (unsigned i : results)
      tangents[op->getResult(i)] = rebuilt->getResult(next++);
  return success();
}

} // namespace warp::autodiff
