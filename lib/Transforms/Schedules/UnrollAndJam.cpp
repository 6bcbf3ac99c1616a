//===- UnrollAndJam.cpp - Register tiling of a shared inner loop ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In a loop that all threads go through alike, each loads what the others load:
//
//   for j in range(n): sum += f(x[i], x[j])
//
// A thread that takes two indices i goes through it once and loads x[j] once
// for both, and what one of them waits for leaves time for the other:
//
//   for j in range(n): a += f(x[i], x[j]); b += f(x[i + block], x[j])
//
// It takes half as many threads, so launches that would not fill the card
// (`under`) stay as they are. Every index keeps the order of its own
// operations. A thread with one index left does it twice and stores once.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "Choices.h"
#include "Launch/EntryBuilder.h"

#include "mlir/IR/IRMapping.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;
using warp::EntryBuilder;

/// Operations of a loop that are worth two copies, and words that the copies
/// may carry.
constexpr int64_t mostOperations = 64, mostCarried = 24;

/// Whether an operation, with all in it, loads or computes and does not loop.
static bool isSimple(Operation &op) {
  return !op.walk([](Operation *inner) {
              bool simple =
                  isa<warp::LoadComponentsOp>(inner) ||
                  inner->hasTrait<OpTrait::HasRecursiveMemoryEffects>() ||
                  isMemoryEffectFree(inner);
              return simple && !isa<LoopLikeOpInterface>(inner)
                         ? WalkResult::advance()
                         : WalkResult::interrupt();
            })
              .wasInterrupted();
}

/// Whether a loop has its bounds, and something that it loads, in common for
/// all threads.
static bool isShared(scf::ForOp loop, const warp::ThreadVariance &variance) {
  auto isFixed = [&](Value value) {
    return variance.isUniform(value, warp::Scope::Launch);
  };
  if (!isFixed(loop.getLowerBound()) || !isFixed(loop.getUpperBound()) ||
      !isFixed(loop.getStep()))
    return false;
  int64_t operations = 0, words = 0;
  bool simple = true, loads = false;
  for (Operation &op : loop.getBody()->without_terminator()) {
    simple &= isSimple(op);
    op.walk([&](Operation *) { ++operations; });
    if (auto load = dyn_cast<warp::LoadComponentsOp>(op))
      loads |= llvm::all_of(load.getIndices(), [&](Value index) {
        return variance.isUniform(index, warp::Scope::Lanes);
      });
  }
  for (Type type : loop.getResultTypes()) {
    // Arrays, for one.
    if (!type.isIntOrFloat())
      return false;
    words += llvm::divideCeil(type.getIntOrFloatBitWidth(), 32);
  }
  return simple && loads && operations <= mostOperations &&
         2 * words <= mostCarried;
}

/// The loop of a kernel that two indices can share: it is the only one, and
/// around it is nothing but loads, arithmetic and stores.
scf::ForOp EntryBuilder::findSharedLoop() {
  if (rank != 1 || flat || !index32 || threads.getNumResults() != 0 ||
      variant.getDebug())
    return {};
  scf::ForOp found;
  for (Operation &op : threads.getThread()->without_terminator()) {
    auto loop = dyn_cast<scf::ForOp>(op);
    if (loop && !found)
      found = loop;
    else if (!isa<warp::StoreComponentsOp>(op) && !isSimple(op))
      return {};
  }
  if (found && !isShared(found, warp::ThreadVariance(kernel)))
    return {};
  return found;
}

/// Copies an operation for each index; once for all if they agree on what it
/// works on.
static void cloneForAll(OpBuilder &b, Operation &op,
                        MutableArrayRef<IRMapping> clones) {
  bool agree = op.getNumRegions() == 0 &&
               llvm::all_of(op.getOperands(), [&](Value operand) {
                 return llvm::all_equal(llvm::map_range(
                     clones, [&](IRMapping &map) {
                       return map.lookupOrDefault(operand);
                     }));
               });
  if (!agree) {
    for (IRMapping &map : clones)
      b.clone(op, map);
    return;
  }
  Operation *copy = b.clone(op, clones.front());
  for (IRMapping &map : clones.drop_front())
    map.map(op.getResults(), copy->getResults());
}

/// One loop that carries what the loops of all indices would.
static void cloneLoop(OpBuilder &b, scf::ForOp loop,
                      MutableArrayRef<IRMapping> clones) {
  IRMapping &first = clones.front();
  SmallVector<Value> inits;
  for (IRMapping &map : clones)
    for (Value init : loop.getInitArgs())
      inits.push_back(map.lookupOrDefault(init));
  auto joined = scf::ForOp::create(
      b, loop.getLoc(), first.lookupOrDefault(loop.getLowerBound()),
      first.lookupOrDefault(loop.getUpperBound()),
      first.lookupOrDefault(loop.getStep()), inits, nullptr,
      loop.getUnsignedCmp());
  size_t count = loop.getNumResults();
  for (auto [i, map] : llvm::enumerate(clones)) {
    map.map(loop.getInductionVar(), joined.getInductionVar());
    map.map(loop.getRegionIterArgs(),
            joined.getRegionIterArgs().slice(i * count, count));
    map.map(loop.getResults(), joined.getResults().slice(i * count, count));
  }
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(joined.getBody());
  for (Operation &op : loop.getBody()->without_terminator())
    cloneForAll(b, op, clones);
  SmallVector<Value> yielded;
  for (IRMapping &map : clones)
    for (Value value : loop.getYieldedValues())
      yielded.push_back(map.lookupOrDefault(value));
  if (count != 0)
    scf::YieldOp::create(b, loop.getLoc(), yielded);
}

EntryBuilder::Values EntryBuilder::buildJammed() {
  constexpr int64_t items = 2;
  Value width = warp::readGrid(b, loc, warp::GridValue::blockDim);
  Value block = warp::readGrid(b, loc, warp::GridValue::blockId);
  Value thread = warp::readGrid(b, loc, warp::GridValue::threadId);
  Value first = add(
      mul(mul(block, width), constant(b.getI32Type(), items)), thread);
  Value second = add(first, width);
  auto exists = [&](Value index) {
    return cmp(arith::CmpIPredicate::slt, index, dims[0]);
  };
  auto any = scf::IfOp::create(b, loc, exists(first), /*withElse=*/false);
  warp::setSchedule(entry, warp::getSchedule(entry).withCoarsening(items));
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(any.thenBlock());
  Value both = exists(second);
  IRMapping clones[items];
  clones[0].map(threads.getIndices()[0], first);
  Value other = arith::SelectOp::create(b, loc, both, second, first);
  clones[1].map(threads.getIndices()[0], other);
  for (Operation &op : threads.getThread()->without_terminator()) {
    if (auto loop = dyn_cast<scf::ForOp>(op)) {
      cloneLoop(b, loop, clones);
    } else if (isa<warp::StoreComponentsOp>(op)) {
      b.clone(op, clones[0]);
      auto again = scf::IfOp::create(b, loc, both, /*withElse=*/false);
      OpBuilder::InsertionGuard guard(b);
      b.setInsertionPointToStart(again.thenBlock());
      b.clone(op, clones[1]);
    } else {
      for (IRMapping &map : clones)
        b.clone(op, map);
    }
  }
  return {};
}
