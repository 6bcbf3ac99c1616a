//===- ReverseOrder.cpp - Alternating block order for L2 reuse ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// After a launch over more memory than the L2 cache holds, the elements that it
// touched last are cached, those that it touched first are not. If every other
// launch runs its blocks from the last to the first, it begins with cached
// elements (H200, launches that follow each other over arrays of so many bytes:
// y = 3 x, 2 x 64 MB 1.10 times as fast, 2 x 256 MB 1.03; x = 3 x, 64 MB 1.21
// times). The runtime decides for each launch:
//
//   block = blockIdx   =>   block = reversed ? gridDim - 1 - blockIdx :
//   blockIdx
//
// Programs may not rely on the order of blocks. Kernels in which it can be
// noticed all the same keep it: where threads add to floats of others, whose
// sums are rounded in that order, where an update returns the old value, as in
// counters that number elements, where threads print, and where some blocks
// have more work than others, which is better begun with the first.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"
#include "warp/Schedule.h"

#include "mlir/Interfaces/LoopLikeInterface.h"

#include "llvm/ADT/SetVector.h"

using namespace mlir;
using namespace warp;

namespace {

class ReverseOrder : public LaunchRewrite {
public:
  using LaunchRewrite::LaunchRewrite;

  bool applies() override;
  bool profit() override;
  void rewrite() override;
  Description describe(bool isMade) override {
    if (!isMade)
      return {};
    return {"reverse_order", "every other launch",
            "block order alternates for L2 reuse"};
  }
};

} // namespace

/// True if the same thread of different blocks has the same value.
static bool isSameInBlocks(Value value, const ThreadVariance &variance) {
  llvm::SetVector<Value> needed;
  needed.insert(value);
  for (unsigned i = 0; i < needed.size(); ++i) {
    Value next = needed[i];
    if (variance.isUniform(next, Scope::Launch))
      continue;
    Operation *op = next.getDefiningOp();
    if (!op) {
      bool isCounter = isa<scf::ForOp>(next.getParentBlock()->getParentOp()) &&
                       cast<BlockArgument>(next).getArgNumber() == 0;
      if (!isCounter)
        return false;
      continue;
    }
    if (isa<ThreadNumberOp>(op))
      continue;
    if (!isPure(op) || op->getNumRegions() != 0 || op->getNumOperands() == 0)
      return false;
    needed.insert(op->operand_begin(), op->operand_end());
  }
  return true;
}

/// True if the result of an update depends on the order of threads: a value
/// that the last one leaves, or a sum that is rounded.
static bool dependsOnOrder(AccessOp access) {
  auto kind = access.getCombination();
  if (!access.isAtomic() || kind == AtomicKind::min || kind == AtomicKind::max)
    return false;
  return !kind || kind == AtomicKind::exch ||
         llvm::any_of(access.getWritten().getTypes(),
                      [](Type type) { return isa<FloatType>(type); });
}

static bool keepsOrder(Operation *op, const ThreadVariance &variance) {
  if (auto loop = dyn_cast<scf::ForOp>(op))
    return !isSameInBlocks(loop.getLowerBound(), variance) ||
           !isSameInBlocks(loop.getUpperBound(), variance) ||
           !isSameInBlocks(loop.getStep(), variance);
  if (isa<LoopLikeOpInterface>(op))
    return true;
  if (auto access = dyn_cast<AccessOp>(op))
    return access.mayWrite() && (!op->use_empty() || dependsOnOrder(access));
  if (auto call = dyn_cast<LibraryCallOp>(op))
    return !call.getCallee().starts_with("warp_tile_") ||
           call.getCallee().starts_with("warp_tile_add_");
  return op->getNumRegions() == 0 && !isMemoryEffectFree(op) &&
         !isa<BarrierOp, ScratchOp, ScratchLoadOp, ScratchStoreOp>(op);
}

bool ReverseOrder::applies() {
  if (!site.mapping->hasIndependentBlocks() ||
      site.threads.getNumResults() != 0 || site.variant.getDebug() ||
      site.variant.isDeterministic())
    return false;
  const ThreadVariance &variance = site.getVariance();
  bool accesses = false;
  WalkResult result = site.threads.getBody().walk([&](Operation *op) {
    accesses |= isa<AccessOp>(op);
    return keepsOrder(op, variance) ? WalkResult::interrupt()
                                    : WalkResult::advance();
  });
  return accesses && !result.wasInterrupted();
}

/// Small launches have code of their own if it depends on that, and arrays that
/// fit the cache.
bool ReverseOrder::profit() {
  int64_t facts = getSchedule(site.function).getSizeFacts();
  return site.variant.getLarge() || (facts & largeFact) == 0;
}

void ReverseOrder::rewrite() {
  setSchedule(site.function, getSchedule(site.function).withReverseOrder(true));
  SmallVector<arith::IndexCastOp> blocks;
  site.threads.getBody().walk([&](arith::IndexCastOp op) {
    std::optional<GridRead> read = getGridRead(op.getResult());
    if (read && read->value == GridValue::blockId)
      blocks.push_back(op);
  });
  for (arith::IndexCastOp first : blocks) {
    OpBuilder b(first->getContext());
    b.setInsertionPointAfter(first);
    Location loc = first.getLoc();
    Axis axis = getGridRead(first.getResult())->axis;
    Value one = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(1));
    Value count = readGrid(b, loc, GridValue::gridDim, axis);
    count = arith::SubIOp::create(b, loc, count, one, noWrap);
    auto last = arith::SubIOp::create(b, loc, count, first, noWrap);
    Value reversed = LaunchReversedOp::create(b, loc, b.getI1Type());
    auto block = arith::SelectOp::create(b, loc, reversed, last, first);
    first.getResult().replaceUsesWithIf(block, [&](OpOperand &use) {
      return use.getOwner() != last && use.getOwner() != block;
    });
  }
}

WARP_MAKE_SCHEDULE(ReverseOrder)
