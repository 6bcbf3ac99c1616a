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
// iteration of a loop, are combined over the warp later (CombineOverWarps.cpp).
//
// What is left on the CPU are updates of elements that differ from thread to
// thread. An atomic instruction costs ten times a plain update, so it is
// quicker to do without, by one thread if only few would share the launch, or
// by all if each has copies of the arrays (CopiedArrays.h). The recipe is then
// exclusive. So it is in a deterministic launch if the order of updates would
// show, by one thread; on a GPU that is a launch of one block.
//
//===----------------------------------------------------------------------===//

#include "Analysis/CostModel.h"
#include "Atomics.h"
#include "CarryOut.h"
#include "CopiedArrays.h"
#include "KernelFunction.h"
#include "Schedule.h"
#include "UnrollUpdates.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TilePasses.h"
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

/// Gives the atomics of one kernel their private sums.
class Privatizer {
public:
  Privatizer(FunctionOpInterface kernel, warp::ThreadsOp threads)
      : threads(threads), first(&kernel.getFunctionBody().front()),
        thread(threads.getThread()), b(kernel->getContext()) {}

  void run();
  /// Whether all updates whose order shows can be combined.
  bool coversOrder();
  /// After `run`: whether one thread is quicker than sharing the launch.
  bool isFasterAlone(int64_t threads, int64_t cost);
  /// After `run`: lists the arrays that copies would spare atomic instructions,
  /// if those would spare all; whether there are any.
  bool offerCopies(FunctionOpInterface kernel, int64_t cost);

private:
  bool isInvariant(Value value) { return warp::isInvariant(value, first); }
  bool qualifies(warp::AtomicComponentsOp op);
  void privatize(warp::AtomicComponentsOp op);
  ValueRange yield(ArrayRef<warp::Carried> sums, ArrayRef<int32_t> kinds,
                   ArrayRef<Type> types);
  void publish(warp::AtomicComponentsOp op, ValueRange totals);
  void count(double updates);
  void countSum(warp::AtomicComponentsOp op);
  /// Cycles of what a thread does besides.
  double restOf(int64_t cost);

  warp::ThreadsOp threads;
  Block *first, *thread;
  OpBuilder b;
  /// Cycles of the updates that each thread still makes: as the estimate of
  /// cost has them, plainly, and atomically.
  double estimated = 0, plain = 0, atomic = 0;
};

} // namespace

bool Privatizer::qualifies(warp::AtomicComponentsOp op) {
  return warp::commutes(op) && isInvariant(op.getArray()) &&
         warp::canCarryOut(op->getBlock(), thread) &&
         llvm::all_of(op.getIndices(),
                      [&](Value index) { return isInvariant(index); }) &&
         llvm::all_of(op.getResultTypes(), [](Type type) {
           return type.getIntOrFloatBitWidth() >= 32;
         });
}

void Privatizer::privatize(warp::AtomicComponentsOp op) {
  Location loc = op.getLoc();
  warp::AtomicKind kind = warp::combiningKind(op.getKind());
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(
      cast<warp::ArrayType>(op.getArray().getType()).getElementType(), 0,
      leaves);
  bool isGradient = op.getArray().getDefiningOp<warp::GradOp>() != nullptr;
  bool negates = op.getKind() == warp::AtomicKind::sub;
  SmallVector<warp::Carried> sums;
  SmallVector<int32_t> kinds;
  SmallVector<Type> types;
  OpBuilder atStart = OpBuilder::atBlockBegin(thread);
  b.setInsertionPoint(op);
  for (auto [leaf, component] : llvm::zip_equal(leaves, op.getComponents())) {
    bool widens = isGradient && leaf.type.isF32();
    Type type = widens ? b.getF64Type() : leaf.type;
    Value value = component, identity =
                                 warp::identity(atStart, loc, kind, type);
    if (widens)
      value = arith::ExtFOp::create(b, loc, type, value);
    if (negates)
      value = warp::negate(b, loc, value);
    auto combine = [=](OpBuilder &b, Value x, Value y) {
      return warp::combine(b, loc, kind, x, y, type, /*anyOrder=*/true);
    };
    sums.push_back({value, identity, combine});
    kinds.push_back(int32_t(kind));
    types.push_back(type);
  }
  // Where a group never gets here the array is left alone: it may be null.
  bool isSure = op->getBlock() == thread;
  if (!isSure) {
    auto flag = [&](OpBuilder &b, bool value) -> Value {
      return arith::ConstantOp::create(b, loc, b.getBoolAttr(value));
    };
    auto combine = [=](OpBuilder &b, Value x, Value y) -> Value {
      return arith::OrIOp::create(b, loc, x, y);
    };
    sums.push_back({flag(b, true), flag(atStart, false), combine});
    kinds.push_back(int32_t(warp::AtomicKind::bit_or));
    types.push_back(b.getI1Type());
  }
  warp::carryOut(sums, op->getBlock(), thread);
  ValueRange totals = yield(sums, kinds, types);
  b.setInsertionPointToEnd(threads->getBlock());
  if (!isSure) {
    auto any = scf::IfOp::create(b, loc, totals.back(), /*withElse=*/false);
    b.setInsertionPointToStart(any.thenBlock());
    totals = totals.drop_back();
  }
  publish(op, totals);
  op->erase();
}

/// Has the threads yield values more: their combinations over the group.
ValueRange Privatizer::yield(ArrayRef<warp::Carried> sums,
                             ArrayRef<int32_t> kinds, ArrayRef<Type> types) {
  SmallVector<int32_t> allKinds(threads.getKinds());
  llvm::append_range(allKinds, kinds);
  SmallVector<Type> allTypes(threads.getTypes().getAsValueRange<TypeAttr>());
  llvm::append_range(allTypes, types);
  SmallVector<Type> results(threads.getResultTypes());
  Operation *end = threads.getYield();
  for (const warp::Carried &sum : sums) {
    results.push_back(sum.value.getType());
    end->insertOperands(end->getNumOperands(), sum.value);
  }
  unsigned before = threads.getNumResults();
  b.setInsertionPoint(threads);
  auto made = warp::ThreadsOp::create(
      b, threads.getLoc(), results, b.getDenseI32ArrayAttr(allKinds),
      b.getTypeArrayAttr(allTypes), threads.getLanesAttr());
  made.getBody().takeBody(threads.getBody());
  threads->replaceAllUsesWith(made->getResults().take_front(before));
  threads->erase();
  threads = made;
  return made->getResults().drop_front(before);
}

/// One thread adds totals to the array.
void Privatizer::publish(warp::AtomicComponentsOp op, ValueRange totals) {
  Location loc = op.getLoc();
  auto once = warp::OnceOp::create(b, loc);
  b.createBlock(&once.getBody());
  IRMapping clones;
  SmallVector<Value> indices;
  for (Value index : op.getIndices())
    indices.push_back(warp::cloneInvariant(b, index, first, clones));
  Value array = warp::cloneInvariant(b, op.getArray(), first, clones);
  SmallVector<Value> components;
  for (auto [total, type] : llvm::zip_equal(totals, op.getResultTypes()))
    components.push_back(
        total.getType() == type
            ? total
            : arith::TruncFOp::create(b, loc, type, total));
  warp::AtomicComponentsOp::create(b, loc, op.getResultTypes(),
                                   warp::combiningKind(op.getKind()),
                                   components, array, indices);
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
  plain += warp::cost::plainUpdate * updates;
  atomic += warp::cost::atomic * updates;
}

/// An exact sum into the same element for all threads needs no atomic
/// instructions.
void Privatizer::countSum(warp::AtomicComponentsOp op) {
  double updates = double(op.getComponents().size()) * estimatedTrips(op);
  bool isShared = !llvm::all_of(
      op.getIndices(), [&](Value index) { return isInvariant(index); });
  estimated += warp::cost::atomic * updates;
  plain += warp::cost::exactSum * updates;
  atomic += (isShared ? warp::cost::atomicExactSum : warp::cost::exactSum) *
            updates;
}

void Privatizer::run() {
  SmallVector<warp::AtomicComponentsOp> found;
  threads.walk([&](warp::AtomicComponentsOp op) {
    if (qualifies(op))
      found.push_back(op);
    else if (op->hasAttr(warp::attr::sum))
      countSum(op);
    else
      count(double(op.getComponents().size()) * estimatedTrips(op));
  });
  threads.walk([&](warp::AtomicCasOp op) { count(estimatedTrips(op)); });
  for (warp::AtomicComponentsOp op : found)
    privatize(op);
}

bool Privatizer::coversOrder() {
  WalkResult result = threads.walk([&](Operation *op) {
    auto atomic = dyn_cast<warp::AtomicComponentsOp>(op);
    return warp::dependsOnOrder(op) && !(atomic && qualifies(atomic))
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

/// Two operations take one cycle.
double Privatizer::restOf(int64_t cost) {
  return std::max(0.0, double(cost) - estimated) / 2;
}

bool Privatizer::isFasterAlone(int64_t threads, int64_t cost) {
  if (atomic == 0)
    return false;
  double rest = restOf(cost);
  return rest + plain < (rest + atomic) / double(threads);
}

bool Privatizer::offerCopies(FunctionOpInterface kernel, int64_t cost) {
  if (atomic == 0)
    return false;
  double rest = restOf(cost) / warp::cost::gainOfLanes;
  warp::CopiedArrays copied{warp::findCopied(kernel),
                            (rest + plain) / warp::cost::cyclesPerNanosecond,
                            (rest + atomic) / warp::cost::cyclesPerNanosecond};
  if (copied.list.empty())
    return false;
  warp::attachCopied(kernel, copied);
  return true;
}

namespace {

struct PrivatizeAtomics : warp::impl::PrivatizeAtomicsBase<PrivatizeAtomics> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    warp::ThreadsOp threads = warp::findThreads(kernel);
    if (!threads) {
      kernel.emitError("expects a kernel in phase 'launch'");
      return signalPassFailure();
    }
    if (kernel->hasAttr(warp::attr::blockThreads))
      return;
    // A debugging launch names the thread that fails, so each does its own.
    warp::VariantAttr variant = warp::getVariant(kernel);
    bool debug = variant.getDebug();
    if (!debug)
      warp::unrollUpdates(kernel);
    Privatizer privatizer(kernel, threads);
    if (!warp::isGpu(kernel))
      runOnCpu(kernel, privatizer, debug);
    else if (variant.isDeterministic() && warp::hasOrderedUpdates(kernel))
      runInOneBlock(kernel, privatizer, debug);
    else if (!debug && variant.hasWholeWarps())
      privatizer.run();
  }

  void runOnCpu(FunctionOpInterface kernel, Privatizer &privatizer, bool debug) {
    warp::VariantAttr variant = warp::getVariant(kernel);
    warp::RecipeAttr recipe = warp::getRecipe(kernel);
    bool exclusive = variant.isDeterministic() && warp::hasOrderedUpdates(kernel);
    if (exclusive)
      warp::noteChoice(kernel, "updates", "plain, by one thread",
                       "sums are in one order");
    if (!debug) {
      int64_t threads = variant.getThreads(), cost = recipe.getCost();
      privatizer.run();
      bool alone = privatizer.isFasterAlone(threads, cost);
      if (alone)
        warp::noteChoice(kernel, "updates", "plain, by one thread",
                         "atomic ones by several would take longer");
      bool copies = !variant.isDeterministic() && threads > 1 &&
                    variant.getDisjoint() &&
                    privatizer.offerCopies(kernel, cost);
      if (copies)
        warp::noteChoice(kernel, "updates", "plain, in copies of arrays",
                         "where a launch is large enough to merge them");
      exclusive |= alone || copies;
    }
    if (exclusive)
      warp::setRecipe(kernel, recipe.withExclusive());
  }

  /// The block combines its threads' results in a fixed order; where they
  /// cannot be combined, it has a single thread.
  void runInOneBlock(Operation *kernel, Privatizer &privatizer, bool debug) {
    int64_t threads = warp::getVariant(kernel).getBlock();
    if (debug || threads % 32 != 0 || !privatizer.coversOrder())
      threads = 1;
    else
      privatizer.run();
    warp::RecipeAttr recipe = warp::getRecipe(kernel).withExclusive();
    warp::setRecipe(kernel, recipe.withItems(threads));
  }
};

} // namespace
