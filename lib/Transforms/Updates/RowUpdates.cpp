//===- RowUpdates.cpp - Sums along rows of threads on GPUs ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The adjoint of a loop over the row of a thread adds to a gradient that no
// other thread touches, by a load, a sum and a store:
//
//   for k: g[i, k] = g[i, k] + v         for k: atomic_add(g, i, k, v)
//
// The lanes of a warp are in different rows: each load brings a line of 128
// bytes for a lane, of which the next iterations find little in the cache, as
// the rows of all threads together have more lines than it holds. An atomic
// addition whose result nobody needs goes to the second-level cache with its
// four bytes, and nothing waits for it.
//
// Sums of neighbours are one stretch of memory, which loads and stores move at
// the memory's bandwidth, so only rows count; and only arrays that the loop
// does not read besides. A product that was added with one rounding now has
// two.
//
//===----------------------------------------------------------------------===//

#include "RowUpdates.h"

#include "Analysis/ThreadVariance.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using namespace warp;

/// The load of the element that a store replaces, if all components of it are
/// sums of the loaded one and something else.
static LoadComponentsOp findLoad(StoreComponentsOp store) {
  LoadComponentsOp load;
  for (auto [i, value] : llvm::enumerate(store.getComponents())) {
    Operation *sum = value.getDefiningOp();
    if (!sum || !isa<arith::AddFOp, math::FmaOp>(sum) || !sum->hasOneUse() ||
        sum->getBlock() != store->getBlock())
      return {};
    bool isFused = isa<math::FmaOp>(sum);
    Value loaded;
    for (Value operand :
         isFused ? sum->getOperands().take_back(1) : sum->getOperands())
      if (auto from = operand.getDefiningOp<LoadComponentsOp>();
          from && from.getArray() == store.getArray() &&
          llvm::equal(from.getIndices(), store.getIndices()) &&
          operand == from.getResult(i) && operand.hasOneUse() &&
          from->getBlock() == store->getBlock() && (!load || load == from)) {
        load = from;
        loaded = operand;
        break;
      }
    if (!loaded)
      return {};
  }
  return load;
}

/// True if nothing between two operations of a block may write to memory.
static bool isUndisturbed(Operation *from, Operation *to) {
  for (Operation *op = from->getNextNode(); op != to; op = op->getNextNode())
    if (!isMemoryEffectFree(op) && !isa<LoadComponentsOp>(op))
      return false;
  return true;
}

/// True if each thread walks along a row, and neighbours along others.
static bool isAlongRow(StoreComponentsOp store,
                       const ThreadVariance &variance) {
  auto loop = store->getParentOfType<scf::ForOp>();
  if (!loop || store.getIndices().size() < 2)
    return false;
  Value last = store.getIndices().back();
  auto isUniform = [&](Value index) {
    return variance.isUniform(index, Scope::Lanes);
  };
  return isUniform(last) && !loop.isDefinedOutsideOfLoop(last) &&
         !llvm::all_of(store.getIndices().drop_back(), isUniform);
}

/// True if nothing else in the loops around a sum reads the array: it would
/// wait for the second-level cache.
static bool isOnlySummed(LoadComponentsOp load) {
  Operation *outermost = nullptr;
  for (Operation *parent = load->getParentOp(); parent;
       parent = parent->getParentOp())
    if (isa<scf::ForOp, scf::WhileOp>(parent))
      outermost = parent;
  WalkResult result = outermost->walk([&](LoadComponentsOp other) {
    return other != load && other.getArray() == load.getArray()
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

static void makeAtomic(StoreComponentsOp store, LoadComponentsOp load) {
  OpBuilder b(store);
  Location loc = store.getLoc();
  SmallVector<Value> added;
  for (auto [i, value] : llvm::enumerate(store.getComponents())) {
    Operation *sum = value.getDefiningOp();
    if (auto fused = dyn_cast<math::FmaOp>(sum))
      added.push_back(
          arith::MulFOp::create(b, loc, fused.getA(), fused.getB()));
    else
      added.push_back(sum->getOperand(sum->getOperand(0) == load.getResult(i)));
  }
  AtomicComponentsOp::create(b, loc, load.getResultTypes(), AtomicKind::add,
                             added, store.getArray(), store.getIndices());
  SmallVector<Operation *> dead;
  for (Value value : store.getComponents())
    dead.push_back(value.getDefiningOp());
  store.erase();
  for (Operation *sum : dead)
    sum->erase();
  load.erase();
}

void warp::addAlongRows(FunctionOpInterface kernel, ThreadsOp threads) {
  SmallVector<std::pair<StoreComponentsOp, LoadComponentsOp>> found;
  threads.walk([&](StoreComponentsOp store) {
    if (!store.getArray().getDefiningOp<GradOp>() ||
        !store->getParentOfType<scf::ForOp>() ||
        !llvm::all_of(store.getComponents(), [](Value value) {
          return value.getType().isF32() || value.getType().isF64();
        }))
      return;
    LoadComponentsOp load = findLoad(store);
    if (load && isUndisturbed(load, store) && isOnlySummed(load))
      found.emplace_back(store, load);
  });
  if (found.empty())
    return;
  ThreadVariance variance(kernel);
  llvm::erase_if(found,
                 [&](auto pair) { return !isAlongRow(pair.first, variance); });
  for (auto [store, load] : found)
    makeAtomic(store, load);
}
