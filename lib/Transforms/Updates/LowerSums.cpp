//===- LowerSums.cpp - Add to exact sums by integers ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each component of an update that warp-plan-updates has marked becomes a call
// that adds its digits to those of the element's sum. The sums of a launch lie
// in memory of their own, so an entry with no other atomics need not have its
// arrays to itself.
//
// A sum into one element for all threads is made by each range of threads in
// memory of its own, a stack frame that stays in the cache, and added to the
// element's at the end of the range. The device library has what that takes
// (DeviceLib/cpu/ExactSums.cpp). On a GPU the threads of a block make such a
// sum together (BlockSums.cpp).
//
//===----------------------------------------------------------------------===//

#include "Atomics.h"
#include "BlockSums.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "SumFunctions.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/WarpOps.h"
#include "warp/ExactSums.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

namespace warp {
#define GEN_PASS_DEF_LOWERSUMS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// The place of the descriptor of an exact update's sums.
static int64_t getDescriptor(Operation *op) {
  return warp::getUpdate(op).getSum();
}

namespace {

/// Rewrites the exact sums of one entry.
class SumLowering {
public:
  SumLowering(LLVM::LLVMFuncOp entry)
      : entry(entry), first(&entry.getBody().front()), b(entry->getContext()),
        functions(entry->getParentOfType<ModuleOp>(), warp::getTarget(entry)),
        debug(warp::getVariant(entry).getDebug()),
        shared(warp::getTarget(entry).isSimt() ||
               !warp::getSchedule(entry).getExclusive()) {}

  void lower(warp::AtomicComponentsOp op);

private:
  /// Memory of a range: terms that are not added yet, how many these are, and
  /// the digits of the others.
  struct RangeSum {
    Value terms, count, digits, touched;
  };

  /// A field of the sums' descriptor.
  Value read(Type type, int64_t offset);
  warp::SumPlace sums(int64_t descriptor);
  /// The numbers of an element's components, where its address is known.
  SmallVector<Value> numbers(warp::AtomicComponentsOp op, Value address);
  void lowerShared(warp::AtomicComponentsOp op);
  void lowerInRange(warp::AtomicComponentsOp op);
  void lowerInBlock(warp::AtomicComponentsOp op);
  /// The numbers of components at the end of the entry.
  SmallVector<Value> numbersAtEnd(warp::AtomicComponentsOp op);
  /// The term that an update adds.
  Value term(warp::AtomicComponentsOp op, Value component);
  Value makeZeros(Type word, int64_t count);
  RangeSum makeRangeSum(Type type);
  void callLibrary(StringRef name, ValueRange operands);
  Value constant(int64_t value) {
    return arith::ConstantOp::create(b, entry.getLoc(),
                                     b.getI64IntegerAttr(value));
  }

  LLVM::LLVMFuncOp entry;
  Block *first;
  OpBuilder b;
  warp::SumFunctions functions;
  bool debug, shared;
};

} // namespace

Value SumLowering::read(Type type, int64_t offset) {
  Location loc = entry.getLoc();
  Value block = entry.getArgument(0);
  Value from = LLVM::GEPOp::create(
      b, loc, block.getType(), b.getI8Type(), block,
      ArrayRef<LLVM::GEPArg>(int32_t(offset)), LLVM::GEPNoWrapFlags::inbounds);
  return LLVM::LoadOp::create(b, loc, type, from, 8, false, false,
                              /*isInvariant=*/true);
}

/// Read at the start of the entry, so that the loop over threads finds it done.
warp::SumPlace SumLowering::sums(int64_t descriptor) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(first);
  auto pointer = LLVM::LLVMPointerType::get(
      b.getContext(), warp::getTarget(entry).isSimt() ? 1 : 0);
  warp::SumPlace place;
  place.digits = read(pointer, descriptor);
  place.touched =
      read(pointer, descriptor + offsetof(warp::SumDescriptor, touched));
  place.count =
      read(b.getI64Type(), descriptor + offsetof(warp::SumDescriptor, count));
  return place;
}

SmallVector<Value> SumLowering::numbers(warp::AtomicComponentsOp op,
                                        Value address) {
  Location loc = op.getLoc();
  int64_t descriptor = getDescriptor(op);
  Value base;
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(first);
    base =
        read(b.getI64Type(), descriptor + offsetof(warp::SumDescriptor, base));
  }
  unsigned bits = op.getResultTypes()[0].isF32() ? 2 : 3;
  Value distance = arith::SubIOp::create(b, loc, address, base);
  Value number = arith::ShRUIOp::create(b, loc, distance, constant(bits));
  SmallVector<Value> list;
  for (warp::Leaf leaf : warp::leavesOf(op))
    list.push_back(
        arith::AddIOp::create(b, loc, number, constant(leaf.offset >> bits)));
  return list;
}

Value SumLowering::term(warp::AtomicComponentsOp op, Value component) {
  if (op.getKind() == warp::AtomicKind::add)
    return component;
  return arith::NegFOp::create(b, op.getLoc(), component);
}

SmallVector<Value> SumLowering::numbersAtEnd(warp::AtomicComponentsOp op) {
  b.setInsertionPoint(entry.getBody().back().getTerminator());
  IRMapping clones;
  SmallVector<Value> indices;
  for (Value index : op.getIndices())
    indices.push_back(warp::cloneInvariant(b, index, first, clones));
  Value array = warp::cloneInvariant(b, op.getArray(), first, clones);
  Value address = warp::AddressOp::create(b, op.getLoc(), array, indices);
  return numbers(op, address);
}

void SumLowering::lowerShared(warp::AtomicComponentsOp op) {
  Location loc = op.getLoc();
  b.setInsertionPoint(op);
  Value address =
      warp::AddressOp::create(b, loc, op.getArray(), op.getIndices());
  if (debug) {
    Value inside = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne,
                                         address, constant(0));
    auto guard = scf::IfOp::create(b, loc, inside, /*withElseRegion=*/false);
    b.setInsertionPointToStart(guard.thenBlock());
  }
  warp::SumPlace place = sums(getDescriptor(op));
  for (auto [number, component] :
       llvm::zip_equal(numbers(op, address), op.getComponents())) {
    place.number = number;
    functions.add(b, loc, place, term(op, component), shared);
  }
}

/// Memory of the range, all zero.
Value SumLowering::makeZeros(Type word, int64_t count) {
  Location loc = entry.getLoc();
  Type type = LLVM::LLVMArrayType::get(word, count);
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  Value memory = LLVM::AllocaOp::create(b, loc, pointer, type, constant(1), 8);
  Value zero = LLVM::ZeroOp::create(b, loc, type);
  LLVM::StoreOp::create(b, loc, zero, memory);
  return memory;
}

/// Calls a function of the device library.
void SumLowering::callLibrary(StringRef name, ValueRange operands) {
  auto module = entry->getParentOfType<ModuleOp>();
  auto function = module.lookupSymbol<LLVM::LLVMFuncOp>(name);
  if (!function) {
    OpBuilder inModule = OpBuilder::atBlockBegin(module.getBody());
    auto type =
        LLVM::LLVMFunctionType::get(LLVM::LLVMVoidType::get(b.getContext()),
                                    llvm::to_vector(operands.getTypes()));
    function = LLVM::LLVMFuncOp::create(inModule, entry.getLoc(), name, type);
  }
  LLVM::CallOp::create(b, entry.getLoc(), function, operands);
}

SumLowering::RangeSum SumLowering::makeRangeSum(Type type) {
  unsigned width = type.getIntOrFloatBitWidth();
  RangeSum sum;
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  Type terms = LLVM::LLVMArrayType::get(type, warp::termsInBuffer);
  sum.terms = LLVM::AllocaOp::create(b, entry.getLoc(), pointer, terms,
                                     constant(1), 64);
  sum.count = makeZeros(b.getI64Type(), 1);
  sum.digits = makeZeros(b.getI64Type(), warp::countDigits(width) + 1);
  sum.touched = makeZeros(b.getI32Type(), warp::countMarks(width));
  return sum;
}

void SumLowering::lowerInRange(warp::AtomicComponentsOp op) {
  Location loc = op.getLoc();
  Type type = op.getResultTypes()[0];
  unsigned width = type.getIntOrFloatBitWidth();
  std::string suffix = "_f" + std::to_string(width);
  SmallVector<RangeSum> own;
  b.setInsertionPoint(first->getTerminator());
  for (unsigned i = 0; i < op.getNumResults(); ++i)
    own.push_back(makeRangeSum(type));
  b.setInsertionPoint(op);
  for (auto [sum, component] : llvm::zip_equal(own, op.getComponents()))
    callLibrary(
        "warp_append_to_sum" + suffix,
        {sum.terms, sum.count, sum.digits, sum.touched, term(op, component)});

  warp::SumPlace place = sums(getDescriptor(op));
  for (auto [number, sum] : llvm::zip_equal(numbersAtEnd(op), own)) {
    place.number = number;
    Value count = LLVM::LoadOp::create(b, loc, b.getI64Type(), sum.count);
    callLibrary("warp_flush_sum" + suffix,
                {sum.terms, count, sum.digits, sum.touched});
    functions.addSum(b, loc, place, sum.digits, sum.touched, width, shared);
  }
}

void SumLowering::lowerInBlock(warp::AtomicComponentsOp op) {
  Location loc = op.getLoc();
  unsigned width = op.getResultTypes()[0].getIntOrFloatBitWidth();
  SmallVector<Value> windows;
  b.setInsertionPoint(first->getTerminator());
  for (unsigned i = 0; i < op.getNumResults(); ++i)
    windows.push_back(warp::makeWindow(b, loc, width));
  b.setInsertionPoint(op);
  warp::SumPlace place = sums(getDescriptor(op));
  Value address =
      warp::AddressOp::create(b, loc, op.getArray(), op.getIndices());
  for (auto [number, component, window] :
       llvm::zip_equal(numbers(op, address), op.getComponents(), windows)) {
    place.number = number;
    functions.addToWindow(b, loc, place, term(op, component), window);
  }

  auto module = entry->getParentOfType<ModuleOp>();
  int64_t blockDim = warp::getVariant(entry).getBlockDim();
  for (auto [number, window] : llvm::zip_equal(numbersAtEnd(op), windows)) {
    place.number = number;
    warp::addWindows(b, loc, module, functions, place, window, width, blockDim);
  }
}

void SumLowering::lower(warp::AtomicComponentsOp op) {
  if (warp::getUpdate(op).getScope() != warp::UpdateScope::group)
    lowerShared(op);
  else if (warp::getTarget(entry).isSimt())
    lowerInBlock(op);
  else
    lowerInRange(op);
  op->erase();
}

namespace {

struct LowerSums : warp::impl::LowerSumsBase<LowerSums> {
  void getDependentDialects(DialectRegistry &registry) const override {
    LowerSumsBase::getDependentDialects(registry);
    warp::registerGpuDialect(registry);
  }

  void runOnOperation() override {
    auto entry = dyn_cast_or_null<LLVM::LLVMFuncOp>(
        warp::findEntry(getOperation()).getOperation());
    if (!entry)
      return;
    SmallVector<warp::AtomicComponentsOp> found;
    entry.walk([&](warp::AtomicComponentsOp op) {
      if (warp::getUpdate(op).isExact())
        found.push_back(op);
    });
    SumLowering lowering(entry);
    for (warp::AtomicComponentsOp op : found)
      lowering.lower(op);
  }
};

} // namespace
