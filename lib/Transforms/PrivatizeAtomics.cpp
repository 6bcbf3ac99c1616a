//===- PrivatizeAtomics.cpp - One atomic per range instead of per thread --===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A sum into one element, `atomic_add(loss, 0, e)`, has every thread of a CPU
// launch update the same address, which costs a locked instruction each and
// keeps the loop over threads scalar. The order of atomic updates is open, so
// the entry may combine those of its range privately and publish the result
// once, when the range is done.
//
// An update qualifies when its old value is unused, its indices are the same
// for all threads, and nothing in the kernel does anything else to the array
// than update it in a way that commutes. Partial results of a sum may be
// combined in any order (`reassoc`), which lets LLVM keep one per lane. A
// component type narrower than 32 bits keeps its atomic: its partial sums
// would round.
//
// What is left are updates of elements that differ from thread to thread. An
// atomic instruction costs ten times a plain update, so for few threads it is
// quicker to run the launch on one of them without; the entry is then marked
// `warp.exclusive`.
//
// Runs between warp-lower-launch, which makes the loop, and warp-lower-arrays.
//
//===----------------------------------------------------------------------===//

#include "Atomics.h"
#include "KernelFunction.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/IRMapping.h"

namespace warp {
#define GEN_PASS_DEF_PRIVATIZEATOMICS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// Subtracting is adding a negative.
static warp::AtomicKind combiningKind(warp::AtomicKind kind) {
  return kind == warp::AtomicKind::sub ? warp::AtomicKind::add : kind;
}

static bool canCombine(warp::AtomicKind kind) {
  using warp::AtomicKind;
  switch (combiningKind(kind)) {
  case AtomicKind::add:
  case AtomicKind::min:
  case AtomicKind::max:
    return true;
  default:
    return false;
  }
}

namespace {

/// Gives the atomics of one entry function their private accumulators.
class Privatizer {
public:
  Privatizer(LLVM::LLVMFuncOp entry)
      : entry(entry), first(&entry.getBody().front()), b(entry->getContext()) {}

  void run();
  /// After `run`: whether one thread is quicker than sharing the launch.
  bool isFasterAlone(int64_t threads, int64_t cost);

private:
  bool isInvariant(Value value);
  bool qualifies(warp::AtomicComponentsOp op);
  void privatize(warp::AtomicComponentsOp op);
  Value cloneInvariant(Value value, IRMapping &clones);
  Value identity(warp::AtomicKind kind, Type type, bool isUnsigned);
  Value makeSlot(Value initial);

  LLVM::LLVMFuncOp entry;
  Block *first;
  OpBuilder b;
  /// Components that are still updated by each thread.
  int64_t remaining = 0;
};

} // namespace

/// The same for every thread of the range, and safe to compute again.
bool Privatizer::isInvariant(Value value) {
  if (value.getParentBlock() == first)
    return true;
  Operation *op = value.getDefiningOp();
  return op && isPure(op) && op->getNumRegions() == 0 &&
         llvm::all_of(op->getOperands(),
                      [&](Value operand) { return isInvariant(operand); });
}

bool Privatizer::qualifies(warp::AtomicComponentsOp op) {
  if (!op->use_empty() || !canCombine(op.getKind()))
    return false;
  if (!op.getArray().getDefiningOp<warp::ParameterOp>() ||
      !llvm::all_of(op.getIndices(), [&](Value i) { return isInvariant(i); }))
    return false;
  for (Type type : op.getComponents().getTypes())
    if (type.getIntOrFloatBitWidth() < 32)
      return false;
  return llvm::all_of(op.getArray().getUsers(), [&](Operation *user) {
    if (isa<warp::DimOp>(user))
      return true;
    auto other = dyn_cast<warp::AtomicComponentsOp>(user);
    return other && other->use_empty() &&
           combiningKind(other.getKind()) == combiningKind(op.getKind());
  });
}

/// A value at the current insertion point, which `first` dominates.
Value Privatizer::cloneInvariant(Value value, IRMapping &clones) {
  if (value.getParentBlock() == first)
    return value;
  if (Value known = clones.lookupOrNull(value))
    return known;
  Operation *op = value.getDefiningOp();
  for (Value operand : op->getOperands())
    clones.map(operand, cloneInvariant(operand, clones));
  b.clone(*op, clones);
  return clones.lookup(value);
}

Value Privatizer::identity(warp::AtomicKind kind, Type type, bool isUnsigned) {
  Location loc = entry.getLoc();
  if (auto floatType = dyn_cast<FloatType>(type)) {
    const llvm::fltSemantics &semantics = floatType.getFloatSemantics();
    APFloat value = kind == warp::AtomicKind::add
                        ? APFloat::getZero(semantics, /*Negative=*/true)
                        : APFloat::getInf(semantics,
                                          kind == warp::AtomicKind::max);
    return arith::ConstantOp::create(b, loc, b.getFloatAttr(type, value));
  }
  unsigned width = type.getIntOrFloatBitWidth();
  APInt value = APInt::getZero(width);
  if (kind == warp::AtomicKind::min)
    value = isUnsigned ? APInt::getMaxValue(width)
                       : APInt::getSignedMaxValue(width);
  if (kind == warp::AtomicKind::max && !isUnsigned)
    value = APInt::getSignedMinValue(width);
  return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
}

/// Memory at the start of the entry, for mem2reg to take away again.
Value Privatizer::makeSlot(Value initial) {
  Location loc = entry.getLoc();
  Value one = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  Value slot = LLVM::AllocaOp::create(b, loc, pointer, initial.getType(), one);
  LLVM::StoreOp::create(b, loc, initial, slot);
  return slot;
}

void Privatizer::privatize(warp::AtomicComponentsOp op) {
  Location loc = op.getLoc();
  warp::AtomicKind kind = combiningKind(op.getKind());
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(
      cast<warp::ArrayType>(op.getArray().getType()).getElementType(), 0,
      leaves);

  b.setInsertionPoint(first->getTerminator());
  SmallVector<Value> slots;
  for (auto [leaf, value] : llvm::zip_equal(leaves, op.getComponents()))
    slots.push_back(makeSlot(identity(kind, value.getType(),
                                      leaf.type.isUnsignedInteger())));
  // A thread that never gets here must leave the array alone: it may be null.
  Type flagType = b.getI32Type();
  Value never = arith::ConstantOp::create(b, loc, b.getIntegerAttr(flagType, 0));
  Value reached = makeSlot(never);

  b.setInsertionPoint(op);
  for (auto [leaf, slot, value] :
       llvm::zip_equal(leaves, slots, op.getComponents())) {
    Value partial = LLVM::LoadOp::create(b, loc, value.getType(), slot);
    Value next = warp::combine(b, loc, op.getKind(), partial, value, leaf.type,
                               /*anyOrder=*/true);
    LLVM::StoreOp::create(b, loc, next, slot);
  }
  Value once = arith::ConstantOp::create(b, loc, b.getIntegerAttr(flagType, 1));
  Value flag = LLVM::LoadOp::create(b, loc, flagType, reached);
  LLVM::StoreOp::create(b, loc, arith::OrIOp::create(b, loc, flag, once),
                        reached);

  b.setInsertionPoint(entry.getBody().back().getTerminator());
  Value final = LLVM::LoadOp::create(b, loc, flagType, reached);
  Value any = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, final,
                                    never);
  auto publish = scf::IfOp::create(b, loc, any, /*withElseRegion=*/false);
  b.setInsertionPointToStart(publish.thenBlock());
  IRMapping clones;
  SmallVector<Value> indices, totals;
  for (Value index : op.getIndices())
    indices.push_back(cloneInvariant(index, clones));
  for (auto [slot, value] : llvm::zip_equal(slots, op.getComponents()))
    totals.push_back(LLVM::LoadOp::create(b, loc, value.getType(), slot));
  warp::AtomicComponentsOp::create(b, loc, op.getResultTypes(), kind, totals,
                                   op.getArray(), indices);
  op->erase();
}

void Privatizer::run() {
  SmallVector<warp::AtomicComponentsOp> found;
  entry.walk([&](warp::AtomicComponentsOp op) {
    if (qualifies(op))
      found.push_back(op);
    else
      remaining += op.getComponents().size();
  });
  entry.walk([&](warp::AtomicCasOp) { ++remaining; });
  for (warp::AtomicComponentsOp op : found)
    privatize(op);
}

/// Times in cycles: two operations take one, a plain update two, an atomic
/// one twenty, which `cost` has counted already.
bool Privatizer::isFasterAlone(int64_t threads, int64_t cost) {
  if (remaining == 0)
    return false;
  double updates = double(remaining);
  double rest = std::max(0.0, double(cost) - 20 * updates) / 2;
  return rest + 2 * updates < (rest + 20 * updates) / double(threads);
}

namespace {

struct PrivatizeAtomics : warp::impl::PrivatizeAtomicsBase<PrivatizeAtomics> {
  void runOnOperation() override {
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    auto function = dyn_cast<LLVM::LLVMFuncOp>(entry.getOperation());
    // A debugging launch names the thread that fails, so each does its own.
    if (!function || warp::isGpu(entry) || entry->hasAttr(warp::attr::debug))
      return;
    Privatizer privatizer(function);
    privatizer.run();
    if (privatizer.isFasterAlone(warp::getFact(entry, warp::attr::threads, 16),
                                 warp::getFact(entry, warp::attr::cost, 0)))
      entry->setAttr(warp::attr::exclusive, UnitAttr::get(&getContext()));
  }
};

} // namespace
