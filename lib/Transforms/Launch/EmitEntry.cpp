//===- EmitEntry.cpp - Kernel entry of a launch ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The entry that a launch calls gets the parameter block, reads the arguments
// from it once, and runs the group:
//
//   CPU   entry(block, begin, end) runs the linear indices [begin, end). The
//         last dimension varies fastest; rank 1 is one loop, higher ranks walk
//         rows, with the divisions that find a row done once per row. With
//         lanes, a loop takes full vectors of threads, and what is left is one
//         vector with a mask.
//   GPU   entry(block) is one thread, which warp-apply-schedules has mapped to
//         the grid. Sums of the threads are reduced over the block.
//
// The function has three blocks: what is read before threads run, the group in
// structured form, and the return.
//
//===----------------------------------------------------------------------===//

#include "EntryBuilder.h"
#include "GpuBlock.h"
#include "Tiles/TensorMapAttributes.h"
#include "Tiles/TileBuffers.h"
#include "Updates/Atomics.h"
#include "Updates/BlockReduce.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"
#include "warp/ExactSums.h"
#include "warp/Launch.h"
#include "warp/TensorMaps.h"

#include "mlir/IR/IRMapping.h"

namespace warp {
#define GEN_PASS_DEF_EMITENTRY
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::EntryBuilder;

/// The arguments before they were taken apart; warp-form-launch checked them.
static SmallVector<Type> getArgumentTypes(FunctionOpInterface kernel) {
  if (auto types = kernel->getAttrOfType<ArrayAttr>(warp::attr::argTypes))
    return llvm::to_vector(types.getAsValueRange<TypeAttr>());
  return llvm::to_vector(kernel.getArgumentTypes());
}

void EntryBuilder::createEntry() {
  MLIRContext *context = b.getContext();
  Type pointer = LLVM::LLVMPointerType::get(context);
  Type i64 = b.getI64Type();
  SmallVector<Type> types{pointer};
  if (!warp::getTarget(kernel).isSimt())
    types.append({i64, i64});
  auto type =
      LLVM::LLVMFunctionType::get(LLVM::LLVMVoidType::get(context), types);
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

  int64_t size = warp::layOutParameters(getArgumentTypes(kernel)).size;
  size += sizeof(warp::SumDescriptor) * warp::getSchedule(kernel).countSums();
  int64_t alignment = 8;
  if (auto maps = entry->getAttrOfType<ArrayAttr>(warp::attr::tensorMaps)) {
    alignment = warp::tensorMapAlignment;
    size = llvm::alignTo(size, alignment) + warp::tensorMapBytes * maps.size();
  }
  warp::getTarget(kernel).declareEntry(entry, size, alignment);
}

Value EntryBuilder::parameter(Type type, int64_t offset) {
  return warp::ParameterOp::create(b, loc, type, block, offset,
                                   /*packed=*/false, StringAttr());
}

/// Reads extents and arguments, and puts them in the place of the kernel's.
void EntryBuilder::readArguments() {
  for (int64_t i = 0; i < rank; ++i)
    dims.push_back(parameter(b.getI32Type(), offsetof(warp::LaunchHeader, dim) +
                                                 sizeof(int32_t) * i));
  SmallVector<Type> types = getArgumentTypes(kernel);
  warp::ParameterLayout layout = warp::layOutParameters(types);
  unsigned next = 0;
  for (auto [type, offset] : llvm::zip_equal(types, layout.offsets)) {
    SmallVector<warp::Leaf> leaves;
    warp::collectLeaves(type, offset, leaves);
    for (warp::Leaf leaf : leaves) {
      unsigned number = next++;
      bool packed = bool(kernel.getArgAttr(number, warp::attr::packed));
      auto name = kernel.getArgAttrOfType<StringAttr>(number, warp::attr::name);
      auto argument =
          warp::ParameterOp::create(b, loc, warp::getSignless(leaf.type), block,
                                    leaf.offset, packed, name);
      if (Attribute fact = kernel.getArgAttr(number, warp::attr::nonNegative))
        argument->setAttr(warp::attr::nonNegative, fact);
      kernel.getArgument(number).replaceAllUsesWith(argument);
    }
  }
}

//===----------------------------------------------------------------------===//
// Groups
//===----------------------------------------------------------------------===//

/// One thread of a block, or of a range, does it.
static void inlineOnce(warp::OnceOp once, function_ref<Value()> isFirst) {
  OpBuilder b(once);
  Block *target = once->getBlock();
  auto place = once->getIterator();
  if (isFirst) {
    auto branch = scf::IfOp::create(b, once.getLoc(), isFirst(),
                                    /*withElseRegion=*/false);
    target = branch.thenBlock();
    place = target->getTerminator()->getIterator();
  }
  Block &body = once.getBody().front();
  target->getOperations().splice(place, body.getOperations());
  once->erase();
}

/// On a CPU a block is one thread.
void EntryBuilder::lowerGroupOps() {
  bool gpu = warp::getTarget(entry).isSimt();
  // Threads that work on tiles are numbered along one axis.
  int64_t tileThreads = warp::tiles::getBlockThreads(entry);
  bool isWarp = tileThreads == warp::getTarget(entry).getSubgroupSize();
  auto number = [&](Location loc) -> Value {
    if (!gpu)
      return constant(b.getI32Type(), 0);
    return tileThreads ? warp::readGrid(b, loc, warp::GridValue::threadId)
                       : warp::threadInBlock(b, loc);
  };
  auto replace = [&](Operation *op, Value value) {
    op->getResult(0).replaceAllUsesWith(value);
    op->erase();
  };
  entry.walk([&](Operation *op) {
    b.setInsertionPoint(op);
    if (isa<warp::BarrierOp>(op)) {
      if (gpu && isWarp)
        warp::synchronizeWarp(b, op->getLoc());
      else if (gpu)
        warp::synchronizeBlock(b, op->getLoc());
      op->erase();
    } else if (isa<warp::ThreadNumberOp>(op)) {
      replace(op, number(op->getLoc()));
    } else if (auto extent = dyn_cast<warp::LaunchExtentOp>(op)) {
      replace(op, dims[extent.getAxis()]);
    } else if (isa<warp::LaunchReversedOp>(op)) {
      Type i32 = b.getI32Type();
      Value order = parameter(i32, offsetof(warp::LaunchHeader, reversed));
      replace(op, cmp(arith::CmpIPredicate::ne, order, constant(i32, 0)));
    }
  });
}

/// The thread as a schedule has mapped it to the grid (Schedules/); the values
/// that it yields are reduced over the block.
EntryBuilder::Values EntryBuilder::buildGpu() {
  Values sums = takeThread({});
  if (sums.empty())
    return sums;
  warp::BlockReduce reduce(b, loc, kernel->getParentOfType<ModuleOp>(),
                           variant.getBlockDim());
  SmallVector<warp::Reduced> reduced;
  for (auto [kind, type, sum, identity] : llvm::zip_equal(
           threads.getKinds(), threads.getTypes().getAsValueRange<TypeAttr>(),
           sums, identities(/*inLanes=*/false)))
    if (!type.isInteger(1))
      reduced.push_back({warp::AtomicKind(kind), sum, identity, type});
  SmallVector<Value> totals = reduce.reduce(reduced);
  Values combined;
  auto total = totals.begin();
  for (Value sum : sums)
    combined.push_back(sum.getType().isInteger(1) ? reduce.any(sum) : *total++);
  return combined;
}

void EntryBuilder::build() {
  bool gpu = warp::getTarget(kernel).isSimt();
  createEntry();
  Block *first = &entry.getBody().front();
  Block *body = b.createBlock(&entry.getBody());
  Block *exit = b.createBlock(&entry.getBody());
  b.setInsertionPointToEnd(exit);
  LLVM::ReturnOp::create(b, loc, ValueRange());
  b.setInsertionPointToEnd(first);
  readArguments();
  LLVM::BrOp::create(b, loc, ValueRange(), body);
  b.setInsertionPointToEnd(body);
  auto leave = LLVM::BrOp::create(b, loc, ValueRange(), exit);
  auto group = cast<warp::GroupOp>(threads->getParentOp());
  body->getOperations().splice(leave->getIterator(),
                               group.getBody().front().getOperations());

  b.setInsertionPoint(threads);
  Values sums = gpu ? buildGpu() : buildCpu();
  threads->replaceAllUsesWith(sums);
  threads->erase();
  SmallVector<warp::OnceOp> once;
  entry.walk([&](warp::OnceOp op) { once.push_back(op); });
  for (warp::OnceOp op : once) {
    auto isFirst = [&] {
      OpBuilder at(op);
      Value zero = arith::ConstantOp::create(at, loc, at.getI32IntegerAttr(0));
      return arith::CmpIOp::create(at, loc, arith::CmpIPredicate::eq,
                                   warp::threadInBlock(at, loc), zero)
          .getResult();
    };
    inlineOnce(op, gpu ? function_ref<Value()>(isFirst) : nullptr);
  }
  lowerGroupOps();
  kernel->erase();
}

namespace {

struct EmitEntry : warp::impl::EmitEntryBase<EmitEntry> {
  void getDependentDialects(DialectRegistry &registry) const override {
    EmitEntryBase::getDependentDialects(registry);
    warp::registerGpuDialect(registry);
  }

  void runOnOperation() override {
    warp::ThreadsOp threads = warp::findThreads(getOperation());
    if (!threads)
      return signalPassFailure();
    auto kernel = threads->getParentOfType<FunctionOpInterface>();
    if (warp::getTarget(kernel).isSimt() && !threads.getIndices().empty()) {
      threads.emitError("expects threads that are mapped to the grid, run "
                        "'--warp-apply-schedules' first");
      return signalPassFailure();
    }
    EntryBuilder(kernel, threads).build();
  }
};

} // namespace
