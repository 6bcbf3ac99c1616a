//===- PrivatizeAtomics.cpp - One atomic for many threads -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A sum into one element, `atomic_add(loss, 0, e)`, has every thread of a
// launch update the same address: a locked instruction each on the CPU, where
// it also keeps the loop over threads scalar, and a queue at one place of the
// memory on a GPU. The order of atomic updates is open, so the entry may
// combine those of its range (GPU: of its block) privately and publish the
// result once, at its end.
//
// An update qualifies when its old value is unused, its indices are the same
// for all threads, and nothing in the kernel does anything else to the array
// than update it in a way that commutes. Partial results of a sum may be
// combined in any order (`reassoc`), which lets LLVM keep one per lane. A
// component type narrower than 32 bits keeps its atomic: its partial sums
// would round. Gradients add up many contributions of similar size, so their
// partial sums have 64 bits.
//
// Short loops over a few such elements are unrolled first (UnrollUpdates.cpp).
//
// Updates that are the same element for the threads of a warp only, or in one
// iteration of a loop, are combined over the warp (WarpSums.cpp).
//
// What is left on the CPU are updates of elements that differ from thread to
// thread. An atomic instruction costs ten times a plain update, so for few
// threads it is quicker to run the launch on one of them without; its recipe is
// exclusive then. So it is in a deterministic launch if the order of its
// updates would show; on a GPU warp-lower-launch has made it one block.
//
// Runs between warp-lower-launch, which makes the loop, and warp-lower-arrays.
//
//===----------------------------------------------------------------------===//

#include "Analysis/CostModel.h"
#include "Atomics.h"
#include "BlockReduce.h"
#include "KernelFunction.h"
#include "UnrollUpdates.h"
#include "WarpSums.h"
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

namespace {

/// The private memory of one atomic, a slot for each component.
struct Accumulator {
  warp::AtomicComponentsOp op;
  warp::AtomicKind kind;
  /// Types of the partial results, with their sign.
  SmallVector<Type> types;
  SmallVector<Value> slots, identities;
};

/// Gives the atomics of one entry function their private accumulators.
class Privatizer {
public:
  Privatizer(LLVM::LLVMFuncOp entry)
      : entry(entry), first(&entry.getBody().front()), b(entry->getContext()) {}

  void run();
  /// Whether all updates whose order shows can be combined.
  bool coversOrder();
  /// After `run`: whether one thread is quicker than sharing the launch.
  bool isFasterAlone(int64_t threads, int64_t cost);

private:
  bool isInvariant(Value value) { return warp::isInvariant(value, first); }
  bool qualifies(warp::AtomicComponentsOp op);
  void privatize(warp::AtomicComponentsOp op);
  void publishRange(const Accumulator &sum, Value any);
  void publishBlock(const Accumulator &sum, Value any);
  void update(const Accumulator &sum, ValueRange totals);
  void count(double updates);
  void countSum(warp::AtomicComponentsOp op);
  int64_t blockDim() {
    return warp::getVariant(entry).getBlock();
  }
  Value cloneInvariant(Value value, IRMapping &clones) {
    return warp::cloneInvariant(b, value, first, clones);
  }
  Value makeSlot(Value initial);

  LLVM::LLVMFuncOp entry;
  Block *first;
  OpBuilder b;
  /// Cycles of the updates that each thread still makes: as the estimate of
  /// cost has them, plainly, and atomically.
  double estimated = 0, plain = 0, atomic = 0;
};

} // namespace

bool Privatizer::qualifies(warp::AtomicComponentsOp op) {
  return warp::commutes(op) &&
         llvm::all_of(op.getIndices(),
                      [&](Value index) { return isInvariant(index); }) &&
         llvm::all_of(op.getResultTypes(), [](Type type) {
           return type.getIntOrFloatBitWidth() >= 32;
         });
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
  Accumulator sum;
  sum.op = op;
  sum.kind = warp::combiningKind(op.getKind());
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(
      cast<warp::ArrayType>(op.getArray().getType()).getElementType(), 0,
      leaves);
  bool isGradient = op.getArray().getDefiningOp<warp::GradOp>() != nullptr;

  b.setInsertionPoint(first->getTerminator());
  for (warp::Leaf leaf : leaves) {
    bool widens = isGradient && leaf.type.isF32();
    sum.types.push_back(widens ? b.getF64Type() : leaf.type);
    sum.identities.push_back(
        warp::identity(b, loc, sum.kind, sum.types.back()));
    sum.slots.push_back(makeSlot(sum.identities.back()));
  }
  // A thread that never gets here must leave the array alone: it may be null.
  Type flagType = b.getI32Type();
  Value never = arith::ConstantOp::create(b, loc, b.getIntegerAttr(flagType, 0));
  Value reached = makeSlot(never);

  b.setInsertionPoint(op);
  for (auto [type, slot, component] :
       llvm::zip_equal(sum.types, sum.slots, op.getComponents())) {
    Value value = component;
    if (type.isF64() && !value.getType().isF64())
      value = arith::ExtFOp::create(b, loc, type, value);
    Value partial = LLVM::LoadOp::create(b, loc, value.getType(), slot);
    Value next = warp::combine(b, loc, op.getKind(), partial, value, type,
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
  if (warp::isGpu(entry))
    publishBlock(sum, any);
  else
    publishRange(sum, any);
  op->erase();
}

/// Totals of a CPU range go to the array if `any` thread of it got there.
void Privatizer::publishRange(const Accumulator &sum, Value any) {
  Location loc = entry.getLoc();
  auto publish = scf::IfOp::create(b, loc, any, /*withElseRegion=*/false);
  b.setInsertionPointToStart(publish.thenBlock());
  SmallVector<Value> totals;
  for (auto [slot, initial] : llvm::zip_equal(sum.slots, sum.identities))
    totals.push_back(LLVM::LoadOp::create(b, loc, initial.getType(), slot));
  update(sum, totals);
}

/// On a GPU the threads of a block combine what they have first.
void Privatizer::publishBlock(const Accumulator &sum, Value any) {
  Location loc = entry.getLoc();
  warp::BlockReduce block(b, loc, entry->getParentOfType<ModuleOp>(),
                          blockDim());
  auto publish = scf::IfOp::create(b, loc, block.any(any),
                                   /*withElseRegion=*/false);
  b.setInsertionPointToStart(publish.thenBlock());
  SmallVector<Value> totals;
  for (auto [type, slot, initial] :
       llvm::zip_equal(sum.types, sum.slots, sum.identities)) {
    Value own = LLVM::LoadOp::create(b, loc, initial.getType(), slot);
    totals.push_back(block.reduce(sum.kind, own, initial, type));
  }
  auto once = scf::IfOp::create(b, loc, block.isFirst(),
                                /*withElseRegion=*/false);
  b.setInsertionPointToStart(once.thenBlock());
  update(sum, totals);
}

void Privatizer::update(const Accumulator &sum, ValueRange totals) {
  warp::AtomicComponentsOp op = sum.op;
  IRMapping clones;
  SmallVector<Value> indices;
  for (Value index : op.getIndices())
    indices.push_back(cloneInvariant(index, clones));
  Value array = cloneInvariant(op.getArray(), clones);
  SmallVector<Value> components;
  for (auto [total, type] : llvm::zip_equal(totals, op.getResultTypes()))
    components.push_back(
        total.getType() == type
            ? total
            : arith::TruncFOp::create(b, op.getLoc(), type, total));
  warp::AtomicComponentsOp::create(b, op.getLoc(), op.getResultTypes(),
                                   sum.kind, components, array, indices);
}

/// How often an operation runs per thread, as the estimate of cost has it.
static double estimatedTrips(Operation *op) {
  double trips = 1;
  for (Operation *parent = op->getParentOp(); parent;
       parent = parent->getParentOp())
    if (isa<scf::ForOp, scf::WhileOp>(parent))
      trips *= warp::cost::loopTrips;
  return trips;
}

void Privatizer::count(double updates) {
  estimated += warp::cost::atomic * updates;
  plain += 2 * updates;
  atomic += warp::cost::atomic * updates;
}

/// An exact sum takes a float apart for two updates or three. One into the same
/// element for all threads needs no atomic instructions.
void Privatizer::countSum(warp::AtomicComponentsOp op) {
  double updates = double(op.getComponents().size()) * estimatedTrips(op);
  bool isShared = !llvm::all_of(
      op.getIndices(), [&](Value index) { return isInvariant(index); });
  estimated += warp::cost::atomic * updates;
  plain += 15 * updates;
  atomic += (isShared ? 50 : 15) * updates;
}

void Privatizer::run() {
  SmallVector<warp::AtomicComponentsOp> found;
  entry.walk([&](warp::AtomicComponentsOp op) {
    if (qualifies(op))
      found.push_back(op);
    else if (op->hasAttr(warp::attr::sum))
      countSum(op);
    else
      count(double(op.getComponents().size()) * estimatedTrips(op));
  });
  entry.walk([&](warp::AtomicCasOp op) { count(estimatedTrips(op)); });
  for (warp::AtomicComponentsOp op : found)
    privatize(op);
}

bool Privatizer::coversOrder() {
  WalkResult result = entry.walk([&](Operation *op) {
    auto atomic = dyn_cast<warp::AtomicComponentsOp>(op);
    return warp::dependsOnOrder(op) && !(atomic && qualifies(atomic))
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

/// Two operations take one cycle.
bool Privatizer::isFasterAlone(int64_t threads, int64_t cost) {
  if (atomic == 0)
    return false;
  double rest = std::max(0.0, double(cost) - estimated) / 2;
  return rest + plain < (rest + atomic) / double(threads);
}

namespace {

struct PrivatizeAtomics : warp::impl::PrivatizeAtomicsBase<PrivatizeAtomics> {
  void runOnOperation() override {
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    auto function = dyn_cast<LLVM::LLVMFuncOp>(entry.getOperation());
    if (!function)
      return;
    // A debugging launch names the thread that fails, so each does its own.
    bool debug = warp::getVariant(entry).getDebug();
    if (!debug)
      warp::unrollUpdates(function);
    if (!warp::isGpu(entry))
      runOnCpu(function, debug);
    else if (warp::getRecipe(entry).getExclusive())
      runInOneBlock(function, debug);
    else if (!debug)
      runOnGpu(function);
  }

  void runOnGpu(LLVM::LLVMFuncOp entry) {
    if (warp::getVariant(entry).hasWholeWarps())
      Privatizer(entry).run();
    if (!warp::getVariant(entry).isDeterministic())
      warp::combineOverWarps(entry);
  }

  void runOnCpu(LLVM::LLVMFuncOp entry, bool debug) {
    bool alone = warp::getVariant(entry).isDeterministic() &&
                 warp::hasOrderedUpdates(entry);
    Privatizer privatizer(entry);
    if (!debug) {
      privatizer.run();
      alone |= privatizer.isFasterAlone(warp::getVariant(entry).getThreads(),
                                        warp::getRecipe(entry).getCost());
    }
    if (alone)
      warp::setRecipe(entry, warp::getRecipe(entry).withExclusive());
  }

  /// The block combines its threads' results in a fixed order; where they
  /// cannot be combined, it has a single thread.
  void runInOneBlock(LLVM::LLVMFuncOp entry, bool debug) {
    int64_t threads = warp::getVariant(entry).getBlock();
    Privatizer privatizer(entry);
    if (debug || threads % 32 != 0 || !privatizer.coversOrder())
      threads = 1;
    else
      privatizer.run();
    warp::setRecipe(entry, warp::getRecipe(entry).withItems(threads));
  }
};

} // namespace
