//===- LowerComposites.cpp - Scalar replacement of composites -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Takes warp IR to thread IR. One walk over a function, in program order:
// every value of the dialect gets the list of scalars (and arrays) that stand
// for it from then on, and every operation is replaced by operations on those.
//
//   operation               becomes                              in file
//   scf, func               itself, with flattened signatures    (this one)
//   builtin                 what its lowering emits              Lowerings/
//   other value operation   scalars picked or converted          ...Values.cpp
//   array access, output    the thread IR form of it             ...Arrays.cpp
//
// Operations are visited once and in place: no pattern driver, no second copy
// of the function, because this pass is on the way of every cold compile.
// Replaced was replaced stays until the end of the walk, so that lowerings can
// still ask the old operands for their types, and is erased backwards then.
//
//===----------------------------------------------------------------------===//

#include "LowerComposites.h"

#include "Lowerings/Lowerings.h"
#include "WarpDialect/LaneOps.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;
using namespace warp::lowering;

namespace warp {

//===----------------------------------------------------------------------===//
// Values
//===----------------------------------------------------------------------===//

static bool isThreadType(Type type) {
  return isa<FloatType, IndexType, ArrayType>(type) ||
         type.isSignlessInteger() || !isValue(type);
}

ArrayRef<Value> CompositeLowering::lookup(Value value) {
  auto [known, isNew] = ranges.try_emplace(value, pool.size(), 1u);
  if (isNew)
    pool.push_back(value);
  return ArrayRef(pool).slice(known->second.first, known->second.second);
}

SmallVector<Value> CompositeLowering::lookup(ValueRange values) {
  SmallVector<Value> flat;
  for (Value value : values)
    llvm::append_range(flat, lookup(value));
  return flat;
}

Scalars CompositeLowering::getScalars(Value value) {
  SmallVector<Type> types;
  if (isValue(value.getType()))
    flatten(value.getType(), types);
  else
    types.push_back(value.getType());
  Scalars scalars;
  for (auto [component, type] : llvm::zip_equal(lookup(value), types))
    scalars.push_back({&emitter, component, type});
  return scalars;
}

void CompositeLowering::map(Value from, ValueRange to) {
  ranges[from] = {static_cast<unsigned>(pool.size()),
                  static_cast<unsigned>(to.size())};
  llvm::append_range(pool, to);
}

void CompositeLowering::replace(Operation *op, ValueRange flat) {
  for (Value result : op->getResults()) {
    size_t count =
        isValue(result.getType()) ? getComponentCount(result.getType()) : 1;
    map(result, flat.take_front(count));
    flat = flat.drop_front(count);
  }
  assert(flat.empty() && "more values than the results hold");
  dead.push_back(op);
}

void CompositeLowering::replace(Operation *op, ArrayRef<Scalar> flat) {
  replace(op, llvm::map_to_vector(flat, [](Scalar x) { return x.value; }));
}

//===----------------------------------------------------------------------===//
// Functions and control flow
//===----------------------------------------------------------------------===//

SmallVector<Type> flattenToThreadTypes(TypeRange types) {
  SmallVector<Type> flat;
  for (Type type : types) {
    if (!isValue(type)) {
      flat.push_back(type);
      continue;
    }
    size_t first = flat.size();
    flatten(type, flat);
    for (Type &component : llvm::drop_begin(flat, first))
      component = isa<ArrayType>(component) ? component
                                            : getSignless(component);
  }
  return flat;
}

void CompositeLowering::convertArguments(Block &block) {
  if (llvm::all_of(block.getArgumentTypes(), isThreadType))
    return;
  unsigned count = block.getNumArguments();
  for (unsigned i = 0; i < count; ++i) {
    BlockArgument old = block.getArgument(i);
    SmallVector<Value> parts;
    for (Type type : flattenToThreadTypes(old.getType()))
      parts.push_back(block.addArgument(type, old.getLoc()));
    map(old, parts);
  }
  deadArguments.emplace_back(&block, count);
}

Operation *CompositeLowering::rebuild(Operation *op, ValueRange operands) {
  if (llvm::all_of(op->getResultTypes(), isThreadType)) {
    op->setOperands(operands);
    return op;
  }
  Operation *rebuilt = Operation::create(
      op->getLoc(), op->getName(), flattenToThreadTypes(op->getResultTypes()),
      operands, op->getDiscardableAttrDictionary(), op->getPropertiesStorage(),
      BlockRange(), op->getNumRegions());
  emitter.builder.insert(rebuilt);
  for (auto [to, from] :
       llvm::zip_equal(rebuilt->getRegions(), op->getRegions()))
    to.takeBody(from);
  replace(op, ValueRange(rebuilt->getResults()));
  return rebuilt;
}

/// Works for every operation of `scf` and `func`: they keep their regions and
/// get flattened operands and results.
LogicalResult CompositeLowering::lowerControlFlow(Operation *op) {
  op = rebuild(op, lookup(op->getOperands()));
  for (Region &region : op->getRegions())
    for (Block &block : region) {
      convertArguments(block);
      if (failed(lower(block)))
        return failure();
    }
  return success();
}

/// Canonicalises an `scf.if` that only chooses.
LogicalResult CompositeLowering::lowerSelect(arith::SelectOp op) {
  Value condition = lookupOne(op.getCondition());
  SmallVector<Value> yes = lookup(ValueRange(op.getTrueValue()));
  SmallVector<Value> no = lookup(ValueRange(op.getFalseValue()));
  SmallVector<Value> chosen;
  for (auto [a, b] : llvm::zip_equal(yes, no))
    chosen.push_back(arith::SelectOp::create(emitter.builder, op.getLoc(),
                                             condition, a, b));
  replace(op, ValueRange(chosen));
  return success();
}

LogicalResult CompositeLowering::lower(Block &block) {
  for (Operation &op : llvm::make_early_inc_range(block))
    if (failed(lower(&op)))
      return failure();
  return success();
}

LogicalResult CompositeLowering::lower(Operation *op) {
  emitter.moveTo(op);
  StringRef dialect = op->getName().getDialectNamespace();
  if (dialect == "scf" || dialect == "func")
    return lowerControlFlow(op);
  if (auto select = dyn_cast<arith::SelectOp>(op))
    return lowerSelect(select);
  if (dialect != "warp" || isa<MostTripsOp>(op)) {
    op->setOperands(lookup(op->getOperands()));
    return success();
  }
  if (auto done = lowerValueOp(op))
    return *done;
  if (auto done = lowerArrayOp(op))
    return *done;
  return lowerBuiltin(op);
}

void CompositeLowering::cleanUp() {
  for (Operation *op : llvm::reverse(dead))
    op->erase();
  for (auto [block, count] : deadArguments)
    block->eraseArguments(0, count);
}

//===----------------------------------------------------------------------===//
// Builtins
//===----------------------------------------------------------------------===//

static bool isHalf(Type type) {
  return isa<FloatType>(type) && type.getIntOrFloatBitWidth() == 16;
}

static void allowReassociation(ArrayRef<Scalar> sums) {
  for (Scalar sum : sums)
    if (auto add = sum.value.getDefiningOp<arith::AddFOp>())
      add.setFastmath(add.getFastmath() | arith::FastMathFlags::reassoc);
}

LogicalResult CompositeLowering::lowerBuiltin(Operation *op) {
  LoweringFunction function = lookupLowering(op->getName().getStringRef());
  if (!function)
    return op->emitOpError("has no lowering to scalars");

  Type single = emitter.builder.getF32Type();
  SmallVector<Scalars, 4> scalars;
  for (Value operand : op->getOperands()) {
    scalars.push_back(getScalars(operand));
    for (Scalar &x : scalars.back())
      if (isHalf(x.type))
        x = convert(x, single);
  }
  SmallVector<Parts, 4> operands;
  for (auto [value, parts] : llvm::zip_equal(op->getOperands(), scalars))
    operands.push_back({value.getType(), parts});

  Scalars results = function(emitter, operands);
  if (op->hasAttr(attr::anyOrder))
    allowReassociation(results);
  SmallVector<Type> types;
  for (Type type : op->getResultTypes())
    flatten(type, types);
  for (auto [x, type] : llvm::zip_equal(results, types))
    if (isHalf(type))
      x = convert(x, type);
  replace(op, results);
  return success();
}

//===----------------------------------------------------------------------===//
// A function
//===----------------------------------------------------------------------===//

/// Attributes of an argument go to each of its components.
static void convertSignature(FunctionOpInterface function) {
  auto type = cast<FunctionType>(function.getFunctionType());
  SmallVector<DictionaryAttr> argAttrs;
  for (auto [i, input] : llvm::enumerate(type.getInputs()))
    argAttrs.append(isValue(input) ? getComponentCount(input) : 1,
                    function.getArgAttrDict(i));
  bool hasArgAttrs = llvm::any_of(
      argAttrs, [](DictionaryAttr attrs) { return attrs && !attrs.empty(); });
  function.removeArgAttrsAttr();
  auto flattened = FunctionType::get(type.getContext(),
                                     flattenToThreadTypes(type.getInputs()),
                                     flattenToThreadTypes(type.getResults()));
  function.setFunctionTypeAttr(TypeAttr::get(flattened));
  if (hasArgAttrs)
    function.setAllArgAttrs(argAttrs);
}

LogicalResult lowerComposites(FunctionOpInterface function) {
  if (function.isExternal()) {
    convertSignature(function);
    return success();
  }
  Block &entry = function.getFunctionBody().front();
  CompositeLowering lowering(function.getContext(), &entry);
  lowering.convertArguments(entry);
  if (failed(lowering.lower(entry)))
    return failure();
  lowering.cleanUp();
  convertSignature(function);
  return success();
}

} // namespace warp
