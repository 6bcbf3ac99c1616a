//===- LowerArrays.cpp - Arrays become pointers, extents, strides ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One walk over the entry, operations before what they contain and definitions
// before uses. An operation on arrays is replaced on the spot; the parts of
// every array are remembered in a table (`known`), so a view of a view costs
// nothing and the strides of a packed array are constants. Arrays that pass
// through control flow (a branch that yields one of two) are packed into an
// LLVM struct there, and the types of the operation are changed in place.
// LowerViews.cpp has where arrays come from, LowerElements.cpp their accesses.
//
//===----------------------------------------------------------------------===//

#include "Analysis/GeometryMemory.h"
#include "ArrayLowering.h"
#include "ForwardElements.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "LowerFunctions.h"
#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

namespace warp {
#define GEN_PASS_DEF_LOWERARRAYS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;

/// Addresses on a thread's stack are none of a GPU's global memory.
static bool hasThreadMemory(ModuleOp module) {
  return module
      .walk([](LibraryCallOp op) {
        return op.getCallee() == threadMemory ? WalkResult::interrupt()
                                              : WalkResult::advance();
      })
      .wasInterrupted();
}

/// True if there is something to report outside of debug launches, too.
static bool hasAssertions(LLVM::LLVMFuncOp entry) {
  return entry
      .walk([](AssertOp op) {
        return op.getAlways() ? WalkResult::interrupt() : WalkResult::advance();
      })
      .wasInterrupted();
}

ArrayLowering::ArrayLowering(LLVM::LLVMFuncOp entry)
    : entry(entry), module(entry->getParentOfType<ModuleOp>()),
      b(entry.getContext()), loc(entry.getLoc()), target(getTarget(entry)),
      gpu(target.isSimt()), index32(getVariant(entry).getIndex32()),
      debug(getVariant(entry).getDebug()), isKept(entry->hasAttr(attr::kept)),
      exclusive(!gpu && getSchedule(entry).getExclusive()) {
  MLIRContext *context = b.getContext();
  i8 = b.getI8Type();
  i32 = b.getI32Type();
  i64 = b.getI64Type();
  pointer = LLVM::LLVMPointerType::get(context);
  dataPointer =
      LLVM::LLVMPointerType::get(context, gpu && !hasThreadMemory(module));
}

LogicalResult ArrayLowering::run() {
  forwardStores(entry);
  if (gpu && !debug && !entry->hasAttr(attr::blockThreads) && !isKept &&
      !entry->hasAttr(attr::keepsCalls))
    staged = findStagedAccesses(entry);
  findWindows();
  SmallVector<Operation *> operations;
  entry.walk<WalkOrder::PreOrder>(
      [&](Operation *op) { operations.push_back(op); });
  for (Operation *op : operations)
    if (auto array = dyn_cast<ArrayAtOp>(op); array && isGeometryMemory(array))
      geometry.insert(array);
  if (debug || hasAssertions(entry)) {
    b.setInsertionPointToStart(&entry.getBody().front());
    mlir::Value block = entry.getArgument(0);
    errorRecord = LLVM::LoadOp::create(
        b, loc, i64, advance(block, offsetof(LaunchHeader, errorRecord)), 8);
  }
  makeTables(operations);
  if (isKept)
    llvm::for_each(entry.getArguments(),
                   [&](BlockArgument argument) { convert(argument); });
  for (Operation *op : operations)
    if (op != entry)
      lower(op);
  for (Operation *op : llvm::reverse(dead))
    op->erase();
  if (!sites.empty())
    entry->setAttr(attr::sites, b.getArrayAttr(sites));
  return failure(malformed);
}

void ArrayLowering::lower(Operation *op) {
  b.setInsertionPoint(op);
  loc = op->getLoc();
  bool replaced = true;
  if (auto parameter = dyn_cast<ParameterOp>(op))
    lowerParameter(parameter);
  else if (auto view = dyn_cast<ViewOp>(op))
    lowerView(view);
  else if (auto slice = dyn_cast<SliceOp>(op))
    lowerSlice(slice);
  else if (auto view = dyn_cast<IndexDimOp>(op))
    lowerIndexDim(view);
  else if (auto view = dyn_cast<ComponentViewOp>(op))
    lowerComponentView(view);
  else if (auto dim = dyn_cast<DimOp>(op))
    lowerDim(dim);
  else if (auto stride = dyn_cast<StrideOp>(op))
    lowerStride(stride);
  else if (auto pointer = dyn_cast<PointerOp>(op))
    lowerPointer(pointer);
  else if (auto array = dyn_cast<ArrayAtOp>(op))
    lowerArrayAt(array);
  else if (auto grad = dyn_cast<GradOp>(op))
    lowerGrad(grad);
  else if (isa<BlockMemoryOp>(op) || getPlaceBehind(op))
    ; // Arrays there ask for it.
  else if (auto load = dyn_cast<LoadComponentsOp>(op))
    lowerLoad(load);
  else if (auto store = dyn_cast<StoreComponentsOp>(op))
    lowerStore(store);
  else if (auto atomic = dyn_cast<AtomicComponentsOp>(op))
    lowerAtomic(atomic);
  else if (auto cas = dyn_cast<AtomicCasOp>(op))
    lowerAtomicCas(cas);
  else if (auto load = dyn_cast<LoadLanesOp>(op))
    lowerLanes(load);
  else if (auto store = dyn_cast<StoreLanesOp>(op))
    lowerLanes(store);
  else if (auto update = dyn_cast<UpdateLanesOp>(op))
    lowerLanes(update);
  else if (auto address = dyn_cast<AddressOp>(op))
    lowerAddress(address);
  else if (auto scratch = dyn_cast<ScratchOp>(op))
    lowerScratch(scratch);
  else if (auto load = dyn_cast<ScratchLoadOp>(op))
    lowerScratch(load);
  else if (auto store = dyn_cast<ScratchStoreOp>(op))
    lowerScratch(store);
  else if (auto get = dyn_cast<TableGetOp>(op))
    lowerTable(get);
  else if (auto printf = dyn_cast<PrintfOp>(op))
    lowerPrintf(printf);
  else if (auto assertion = dyn_cast<AssertOp>(op))
    lowerAssert(assertion);
  else if (auto check = dyn_cast<CheckIndexOp>(op))
    lowerCheckIndex(check);
  else
    replaced = false;
  if (replaced)
    dead.push_back(op);
  else
    convertControlFlow(op);
}

/// Changes array types of operands, results and block arguments in place. Calls
/// get addresses of a thread's memory.
void ArrayLowering::convertControlFlow(Operation *op) {
  for (OpOperand &operand : op->getOpOperands())
    if (isa<warp::ArrayType>(operand.get().getType()))
      operand.set(pack(operand.get()));
    else if (isa<ScratchType>(operand.get().getType()))
      operand.set(LLVM::PtrToIntOp::create(b, loc, i64,
                                           scratches.lookup(operand.get())));
  for (mlir::Value result : op->getResults())
    convert(result);
  for (Region &region : op->getRegions())
    for (Block &block : region)
      for (mlir::Value argument : block.getArguments())
        convert(argument);
}

/// Gives an array the type that it has in control flow and in calls.
void ArrayLowering::convert(mlir::Value value) {
  auto array = dyn_cast<warp::ArrayType>(value.getType());
  if (!array)
    return;
  packedTypes[value] = array;
  value.setType(getDescriptorType(array.getRank()));
}

namespace {
struct LowerArrays : warp::impl::LowerArraysBase<LowerArrays> {
  void getDependentDialects(DialectRegistry &registry) const override {
    LowerArraysBase::getDependentDialects(registry);
    warp::registerGpuDialect(registry);
  }

  void runOnOperation() override {
    auto entry = dyn_cast_or_null<LLVM::LLVMFuncOp>(
        findEntry(getOperation()).getOperation());
    if (!entry)
      return signalPassFailure();
    ArrayLowering lowering(entry);
    SmallVector<LLVM::LLVMFuncOp> functions;
    if (entry->hasAttr(attr::keepsCalls))
      functions = emitFunctions(entry, [&](mlir::Type type) {
        auto array = dyn_cast<warp::ArrayType>(type);
        return array ? lowering.getDescriptorType(array.getRank()) : type;
      });
    if (failed(lowering.run()))
      return signalPassFailure();
    for (LLVM::LLVMFuncOp function : functions)
      if (failed(ArrayLowering(function).run()))
        return signalPassFailure();
    if (functions.empty())
      return;
    lowerCalls(entry);
    llvm::for_each(functions, lowerCalls);
  }
};
} // namespace
