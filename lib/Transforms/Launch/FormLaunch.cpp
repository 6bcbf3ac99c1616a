//===- FormLaunch.cpp - Launch region around a thread ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Thread IR describes one thread. Here its body becomes the region of
// `warp.threads` in a `warp.group`, with the thread's indices as arguments, and
// what the launch promises of an argument becomes an attribute of it: an array
// is packed, an integer not negative, and how messages call it.
//
//===----------------------------------------------------------------------===//

#include "HoistHandles.h"
#include "KernelFunction.h"
#include "Lanes/InStep.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TilePasses.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Builders.h"

namespace warp {
#define GEN_PASS_DEF_FORMLAUNCH
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// The arguments before they were taken apart, which must add up to those that
/// the function has now.
static LogicalResult collectArguments(FunctionOpInterface kernel,
                                      SmallVectorImpl<Type> &types) {
  if (auto list = kernel->getAttrOfType<ArrayAttr>(warp::attr::argTypes)) {
    for (Attribute type : list) {
      auto typeAttr = dyn_cast<TypeAttr>(type);
      if (!typeAttr)
        return kernel.emitError("expects types in 'warp.arg_types', but got ")
               << type;
      types.push_back(typeAttr.getValue());
    }
  } else {
    llvm::append_range(types, kernel.getArgumentTypes());
  }
  SmallVector<Type> flattened;
  for (Type type : types)
    warp::flatten(type, flattened);
  for (Type &type : flattened)
    type = warp::getSignless(type);
  if (!llvm::equal(flattened, kernel.getArgumentTypes()))
    return kernel.emitError("arguments do not match 'warp.arg_types'");
  if (!llvm::hasSingleElement(kernel.getFunctionBody()))
    return kernel.emitError("expects structured control flow");
  return success();
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

static void describeArguments(FunctionOpInterface kernel,
                              ArrayRef<Type> types) {
  Builder b(kernel.getContext());
  warp::VariantAttr variant = warp::getVariant(kernel);
  auto names = kernel->getAttrOfType<ArrayAttr>(warp::attr::argNames);
  unsigned next = 0;
  for (auto [i, type] : llvm::enumerate(types)) {
    StringAttr name;
    if (names && i < names.size())
      name = dyn_cast<StringAttr>(names[i]);
    SmallVector<warp::Leaf> leaves;
    warp::collectLeaves(type, 0, leaves);
    SmallVector<std::string> leafNames;
    if (name)
      collectNames(type, name.getValue(), leafNames);
    leafNames.resize(leaves.size());
    for (const std::string &leafName : leafNames) {
      unsigned argument = next++;
      if (isa<warp::ArrayType>(type) && variant.isPacked(i))
        kernel.setArgAttr(argument, warp::attr::packed, b.getUnitAttr());
      if (isa<IntegerType>(type) && !type.isInteger(1) &&
          variant.isNonNegative(i))
        kernel.setArgAttr(argument, warp::attr::nonNegative, b.getUnitAttr());
      if (!leafName.empty())
        kernel.setArgAttr(argument, warp::attr::name,
                          b.getStringAttr(leafName));
    }
  }
}

/// Moves the body into a region of threads.
static void formThreads(FunctionOpInterface kernel) {
  OpBuilder b(kernel.getContext());
  Location loc = kernel.getLoc();
  Block *body = &kernel.getFunctionBody().front();
  int64_t rank = warp::getVariant(kernel).getRank();

  b.setInsertionPointToStart(body);
  auto group = warp::GroupOp::create(b, loc);
  b.createBlock(&group.getBody());
  auto threads = warp::ThreadsOp::create(
      b, loc, TypeRange(), b.getDenseI32ArrayAttr({}), b.getTypeArrayAttr({}),
      /*lanes=*/IntegerAttr());
  SmallVector<Type> indexTypes(rank, b.getI32Type());
  Block *thread = b.createBlock(&threads.getBody(), {}, indexTypes,
                                SmallVector<Location>(rank, loc));
  auto end = warp::YieldOp::create(b, loc, ValueRange());
  thread->getOperations().splice(end->getIterator(), body->getOperations(),
                                 std::next(group->getIterator()),
                                 std::prev(body->end()));
  thread->walk([&](warp::TidOp tid) {
    for (auto [i, result] : llvm::enumerate(tid.getResults())) {
      OpBuilder at(tid);
      Value index = int64_t(i) < rank ? Value(thread->getArgument(i))
                                      : Value(arith::ConstantOp::create(
                                            at, loc, at.getI32IntegerAttr(0)));
      if (result.getType() != index.getType())
        index = arith::ExtSIOp::create(at, loc, result.getType(), index);
      result.replaceAllUsesWith(index);
    }
    tid->erase();
  });
}

namespace {

struct FormLaunch : warp::impl::FormLaunchBase<FormLaunch> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    SmallVector<Type> types;
    if (!kernel || failed(collectArguments(kernel, types)))
      return signalPassFailure();
    describeArguments(kernel, types);
    warp::hoistHandles(kernel);
    warp::VariantAttr variant = warp::getVariant(kernel);
    const warp::TargetInfo &target = warp::getTarget(kernel);
    bool mayBeInStep =
        (!target.isSimt() || target.has(warp::Feature::SubgroupMax)) &&
        !variant.getDebug() && !kernel->hasAttr(warp::attr::blockThreads);
    // Calls that stay may be made by some lanes only.
    getOperation()->walk([&](FunctionOpInterface function) {
      if (function != kernel || !mayBeInStep)
        warp::leaveStep(function);
    });
    formThreads(kernel);
  }
};

} // namespace
