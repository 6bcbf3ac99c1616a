//===- ReverseOrder.cpp - Alternating block order for L2 reuse ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What a launch over more memory than a GPU's cache holds has touched last is
// still in the cache when the next launch begins; what it has touched first is
// gone. If every other launch runs its blocks from the last to the first, it
// begins with what is there (H200, launches that follow each other over arrays
// of so many bytes: y = 3 x, 2 x 64 MB 1.10 times as fast, 2 x 256 MB 1.03;
// x = 3 x, 64 MB 1.21 times). The runtime decides for each launch.
//
// Blocks run in no order that a program may rely on. Kernels whose order one
// may notice all the same keep it: where threads add to floats of others, whose
// sums are rounded in that order, where an update returns what was there
// before, as in counters that number things, where threads print, and where
// some blocks have more work than others, which is better begun with the first.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "Launch/EntryBuilder.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"
#include "warp/Launch.h"
#include "warp/SizeFacts.h"

#include "mlir/Interfaces/LoopLikeInterface.h"

#include "llvm/ADT/SetVector.h"

using namespace mlir;
using warp::EntryBuilder;

/// Whether a thread of one block has it as the same thread of another one.
static bool isSameInBlocks(Value value, const warp::ThreadVariance &variance) {
  llvm::SetVector<Value> needed;
  needed.insert(value);
  for (unsigned i = 0; i < needed.size(); ++i) {
    Value next = needed[i];
    if (variance.isUniform(next, warp::Scope::Launch))
      continue;
    Operation *op = next.getDefiningOp();
    if (!op) {
      bool isCounter = isa<scf::ForOp>(next.getParentBlock()->getParentOp()) &&
                       cast<BlockArgument>(next).getArgNumber() == 0;
      if (!isCounter)
        return false;
      continue;
    }
    if (isa<warp::ThreadNumberOp>(op))
      continue;
    if (!isPure(op) || op->getNumRegions() != 0 || op->getNumOperands() == 0)
      return false;
    needed.insert(op->operand_begin(), op->operand_end());
  }
  return true;
}

/// Whether what threads leave in an element together depends on their order:
/// the last one's value, or a sum that is rounded.
static bool dependsOnOrder(warp::AccessOp access) {
  auto kind = access.getCombination();
  if (!access.isAtomic() || kind == warp::AtomicKind::min ||
      kind == warp::AtomicKind::max)
    return false;
  return !kind || kind == warp::AtomicKind::exch ||
         llvm::any_of(access.getWritten().getTypes(),
                      [](Type type) { return isa<FloatType>(type); });
}

static bool keepsOrder(Operation *op, const warp::ThreadVariance &variance) {
  if (auto loop = dyn_cast<scf::ForOp>(op))
    return !isSameInBlocks(loop.getLowerBound(), variance) ||
           !isSameInBlocks(loop.getUpperBound(), variance) ||
           !isSameInBlocks(loop.getStep(), variance);
  if (isa<LoopLikeOpInterface>(op))
    return true;
  if (auto access = dyn_cast<warp::AccessOp>(op))
    return access.mayWrite() && (!op->use_empty() || dependsOnOrder(access));
  if (auto call = dyn_cast<warp::LibraryCallOp>(op))
    return !call.getCallee().starts_with("warp_tile_") ||
           call.getCallee().starts_with("warp_tile_add_");
  return op->getNumRegions() == 0 && !isMemoryEffectFree(op) &&
         !isa<warp::BarrierOp, warp::ScratchOp, warp::ScratchLoadOp,
              warp::ScratchStoreOp>(op);
}

/// Whether blocks may run in either order, and something is gained by it.
bool EntryBuilder::canAlternate() {
  // What threads yield, blocks add up.
  bool isStream =
      (form == Form::One || form == Form::Items || form == Form::Tiles) &&
      threads.getNumResults() == 0;
  // Small launches have code of their own, and arrays that fit.
  bool isSmall =
      !variant.getLarge() &&
      (warp::getSchedule(kernel).getSizeFacts() & warp::largeFact) != 0;
  if (!isStream || isSmall || variant.getDebug() || variant.isDeterministic())
    return false;
  warp::ThreadVariance variance(kernel);
  bool accesses = false;
  WalkResult result = threads.getBody().walk([&](Operation *op) {
    accesses |= isa<warp::AccessOp>(op);
    return keepsOrder(op, variance) ? WalkResult::interrupt()
                                    : WalkResult::advance();
  });
  return accesses && !result.wasInterrupted();
}

/// The number of the block along an axis, in the order of the launch.
Value EntryBuilder::blockIndex(Axis axis) {
  Value first = warp::readGrid(b, loc, warp::GridValue::blockId, axis);
  if (!alternates)
    return first;
  Type i32 = b.getI32Type();
  Value count = warp::readGrid(b, loc, warp::GridValue::gridDim, axis);
  Value last = sub(sub(count, constant(i32, 1)), first);
  Value order = parameter(i32, offsetof(warp::LaunchHeader, reversed));
  Value isLast = cmp(arith::CmpIPredicate::ne, order, constant(i32, 0));
  return arith::SelectOp::create(b, loc, isLast, last, first);
}
