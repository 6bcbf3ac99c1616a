//===- LowerLaunch.cpp - From one thread to the entry of a launch ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Thread IR describes one thread. The entry that a launch calls gets the
// parameter block, reads the arguments from it once, and runs the body:
//
//   CPU   entry(block, begin, end) runs the linear indices [begin, end). The
//         last dimension varies fastest; rank 1 is one loop, higher ranks walk
//         rows, with the divisions that find a row done once per row. The
//         innermost loop is marked parallel: threads of a launch are
//         independent, so LLVM may run several as lanes of a vector.
//   GPU   entry(block) is one thread. Its indices come from the grid, the last
//         dimension on axis x, and a guard replaces the loop. A launch that
//         does not fit the axes uses `warp.flat`: one 64-bit linear index.
//
// Whoever adds a fact about launches starts at `Launch::build`.
//
//===----------------------------------------------------------------------===//

#include "LowerLaunch.h"
#include "WarpDialect/ParameterLayout.h"
#include "warp/ExactSums.h"
#include "warp/Launch.h"

namespace warp {
#define GEN_PASS_DEF_LOWERLAUNCH
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::Launch;

/// The arguments before they were taken apart must add up to those that the
/// function has now.
LogicalResult Launch::collectArguments() {
  if (auto types = kernel->getAttrOfType<ArrayAttr>(warp::attr::argTypes)) {
    for (Attribute type : types) {
      auto typeAttr = dyn_cast<TypeAttr>(type);
      if (!typeAttr)
        return kernel.emitError("expects types in 'warp.arg_types', but got ")
               << type;
      argTypes.push_back(typeAttr.getValue());
    }
  } else {
    llvm::append_range(argTypes, kernel.getArgumentTypes());
  }
  SmallVector<Type> flattened;
  for (Type type : argTypes)
    warp::flatten(type, flattened);
  for (Type &type : flattened)
    type = warp::getSignless(type);
  if (kernel.getNumResults() != 0)
    return kernel.emitError("expects a kernel without results");
  if (!llvm::equal(flattened, kernel.getArgumentTypes()))
    return kernel.emitError("arguments do not match 'warp.arg_types'");
  if (!llvm::hasSingleElement(kernel.getFunctionBody()))
    return kernel.emitError("expects structured control flow");
  return success();
}

void Launch::createEntry() {
  MLIRContext *context = b.getContext();
  Type pointer = LLVM::LLVMPointerType::get(context);
  Type i64 = b.getI64Type();
  SmallVector<Type> types{pointer};
  if (!warp::isGpu(kernel))
    types.append({i64, i64});
  auto type = LLVM::LLVMFunctionType::get(
      LLVM::LLVMVoidType::get(context), types);
  b.setInsertionPoint(kernel);
  // The name is free once the kernel is gone.
  entry = LLVM::LLVMFuncOp::create(b, loc, kernel.getName(), type);
  for (NamedAttribute fact : kernel->getDiscardableAttrs())
    if (fact.getName().getValue().starts_with("warp."))
      entry->setAttr(fact.getName(), fact.getValue());
  entry->removeAttr(warp::kernelAttrName);
  entry->setAttr(warp::attr::entry, b.getUnitAttr());
  Block *first = entry.addEntryBlock(b);
  block = first->getArgument(0);
  b.setInsertionPointToStart(first);

  int64_t size = warp::layOutParameters(argTypes).size;
  size += sizeof(warp::SumDescriptor) * warp::getRecipe(kernel).countSums();
  if (!warp::isGpu(kernel)) {
    entry.setArgAttr(0, "llvm.noalias", b.getUnitAttr());
    entry.setArgAttr(0, "llvm.readonly", b.getUnitAttr());
    return;
  }
  entry.setCConv(LLVM::CConv::PTX_Kernel);
  auto bytes = LLVM::LLVMArrayType::get(b.getI8Type(), size);
  entry.setArgAttr(0, "llvm.byval", TypeAttr::get(bytes));
  entry.setArgAttr(0, "llvm.align", b.getI64IntegerAttr(8));
  auto limit = std::to_string(warp::getVariant(kernel).getBlock());
  entry.setPassthroughAttr(b.getArrayAttr(
      {b.getStrArrayAttr({"nvvm.maxntid", limit})}));
}

/// Appends how messages call each scalar and array of a value.
static void collectNames(Type type, const Twine &name,
                         SmallVectorImpl<std::string> &names) {
  auto record = dyn_cast<warp::StructType>(type);
  if (!record) {
    names.append(warp::isComposite(type) ? warp::getComponentCount(type) : 1,
                 name.str());
    return;
  }
  for (auto [field, fieldType] :
       llvm::zip(record.getFieldNames(), record.getFieldTypes()))
    collectNames(fieldType, name + "." + field.getValue(), names);
}

void Launch::readArguments() {
  for (int64_t i = 0; i < rank; ++i)
    dims.push_back(parameter(b.getI32Type(), offsetof(warp::LaunchHeader, dim) +
                                                 sizeof(int32_t) * i));
  warp::VariantAttr variant = warp::getVariant(kernel);
  auto names = kernel->getAttrOfType<ArrayAttr>(warp::attr::argNames);
  warp::ParameterLayout layout = warp::layOutParameters(argTypes);
  for (auto [i, type] : llvm::enumerate(argTypes)) {
    StringAttr name;
    if (names && i < names.size())
      name = dyn_cast<StringAttr>(names[i]);
    bool isArray = isa<warp::ArrayType>(type);
    bool isRegular = variant.isContiguous(i);
    bool packed = isArray && isRegular;
    SmallVector<warp::Leaf> leaves;
    warp::collectLeaves(type, layout.offsets[i], leaves);
    SmallVector<std::string> leafNames;
    if (name)
      collectNames(type, name.getValue(), leafNames);
    leafNames.resize(leaves.size());
    for (auto [leaf, leafName] : llvm::zip(leaves, leafNames)) {
      auto argument = warp::ParameterOp::create(
          b, loc, warp::getSignless(leaf.type), block, leaf.offset, packed,
          leafName.empty() ? StringAttr() : b.getStringAttr(leafName));
      if (isRegular && isa<IntegerType>(type) && !type.isInteger(1))
        argument->setAttr(warp::attr::nonNegative, b.getUnitAttr());
      arguments.push_back(argument);
    }
  }
}

/// Moves the kernel's body to the insertion point, with these thread indices.
void Launch::inlineBody(ValueRange indices) {
  Block &body = kernel.getFunctionBody().front();
  body.getTerminator()->erase();
  body.walk([&](warp::TidOp tid) {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPoint(tid);
    for (auto [i, result] : llvm::enumerate(tid.getResults())) {
      Type type = warp::getSignless(result.getType());
      Value index = i < indices.size() ? narrow(indices[i], type)
                                       : constant(type, 0);
      result.replaceAllUsesWith(index);
    }
    tid->erase();
  });
  for (auto [argument, value] :
       llvm::zip_equal(body.getArguments(), arguments))
    argument.replaceAllUsesWith(value);
  b.getInsertionBlock()->getOperations().splice(
      b.getInsertionPoint(), body.getOperations());
}

/// Ends `before` with a loop over [begin, end), which is not empty, that goes
/// on to `after`.
Block *Launch::buildInnerLoop(Block *before, Value begin, Value end,
                              Block *after, ArrayRef<Value> outer) {
  MLIRContext *context = b.getContext();
  Block *loop = b.createBlock(after, {b.getI64Type()}, {loc});
  b.setInsertionPointToEnd(before);
  LLVM::BrOp::create(b, loc, begin, loop);
  b.setInsertionPointToStart(loop);
  Value index = loop->getArgument(0);
  SmallVector<Value> indices(outer);
  indices.push_back(index);
  inlineBody(indices);
  Value next = add(index, constant(b.getI64Type(), 1));
  auto latch = LLVM::CondBrOp::create(
      b, loc, cmp(arith::CmpIPredicate::slt, next, end), loop,
      ValueRange(next), after, ValueRange());
  auto group = LLVM::AccessGroupAttr::get(context,
      DistinctAttr::create(b.getUnitAttr()));
  // What is left after vectorising is short; unrolling it costs compile time.
  auto unroll = LLVM::LoopUnrollAttr::get(context, b.getBoolAttr(true), {}, {},
                                          {}, {}, {}, {});
  latch.setLoopAnnotationAttr(LLVM::LoopAnnotationAttr::get(
      context, {}, {}, {}, unroll, {}, {}, {}, {}, {}, {}, b.getBoolAttr(true),
      {}, {}, {}, {group}));
  return loop;
}

void Launch::buildLoop() {
  Block *first = b.getInsertionBlock();
  Value begin = first->getArgument(1), end = first->getArgument(2);
  Block *exit = b.createBlock(&entry.getBody());
  Block *enter = b.createBlock(exit);
  b.setInsertionPointToEnd(first);
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::slt, begin, end),
                         enter, ValueRange(), exit, ValueRange());
  buildInnerLoop(enter, begin, end, exit, {});
  b.setInsertionPointToEnd(exit);
  LLVM::ReturnOp::create(b, loc, ValueRange());
}

/// Indices of the dimensions before the last, from the linear number of a row.
SmallVector<Value> Launch::unravel(Value row, int count) {
  SmallVector<Value> indices(count);
  for (int d = count - 1; d > 0; --d) {
    Value extent = narrow(dims[d], row.getType());
    Value rest = div(row, extent);
    indices[d] = sub(row, mul(rest, extent));
    row = rest;
  }
  indices[0] = row;
  return indices;
}

void Launch::buildRows() {
  Block *first = b.getInsertionBlock();
  Type i64 = b.getI64Type();
  Type rowType = index32 ? b.getI32Type() : i64;
  Value begin = first->getArgument(1), end = first->getArgument(2);
  Block *exit = b.createBlock(&entry.getBody());
  Block *enter = b.createBlock(exit);
  Block *row = b.createBlock(exit, {i64}, {loc});
  Block *rowEnd = b.createBlock(exit);

  b.setInsertionPointToEnd(first);
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::slt, begin, end),
                         enter, ValueRange(), exit, ValueRange());
  b.setInsertionPointToEnd(enter);
  Value one = constant(i64, 1), zero = constant(i64, 0);
  Value width = narrow(dims[rank - 1], i64);
  auto rowOf = [&](Value linear) {
    Value divided = div(narrow(linear, rowType), narrow(width, rowType));
    return narrow(divided, i64);
  };
  Value firstRow = rowOf(begin);
  Value lastRow = rowOf(sub(end, one));
  Value firstColumn = sub(begin, mul(firstRow, width));
  Value endColumn = sub(end, mul(lastRow, width));
  LLVM::BrOp::create(b, loc, firstRow, row);

  b.setInsertionPointToEnd(row);
  Value number = row->getArgument(0);
  Value isFirst = cmp(arith::CmpIPredicate::eq, number, firstRow);
  Value isLast = cmp(arith::CmpIPredicate::eq, number, lastRow);
  Value from = arith::SelectOp::create(b, loc, isFirst, firstColumn, zero);
  Value to = arith::SelectOp::create(b, loc, isLast, endColumn, width);
  SmallVector<Value> outer = unravel(narrow(number, rowType), rank - 1);
  buildInnerLoop(row, from, to, rowEnd, outer);

  b.setInsertionPointToEnd(rowEnd);
  Value next = add(number, one);
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::sle, next, lastRow),
                         row, ValueRange(next), exit, ValueRange());
  b.setInsertionPointToEnd(exit);
  LLVM::ReturnOp::create(b, loc, ValueRange());
}

namespace {

struct LowerLaunch : warp::impl::LowerLaunchBase<LowerLaunch> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel || failed(Launch(kernel).build()))
      signalPassFailure();
  }
};

} // namespace
