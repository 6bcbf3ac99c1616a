//===- PlaceBarriers.cpp - Barrier insertion ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Walks the operations with what has been accessed since the last barrier: tile
// memory by its bytes, arrays that may overlap as one. An operation waits if
// another thread may have made one of two accesses to the same place, and one
// of both writes.
// An access that a thread makes by itself waits for those that the block made
// together, and not for those of other threads.
// Threads make an access of their own elements if the operation treats element
// e in thread e mod B; two of those with equal tiles never conflict.
//
// Accesses before a branch enter its sides, and what either side has accessed
// since its last barrier leaves it: a branch waits for nothing by itself. A
// turn of a loop ends with a barrier if anything has been accessed since the
// last one, as the next turn may meet it, and a loop begins with one.
//
//===----------------------------------------------------------------------===//

#include "BlockVariance.h"
#include "TileBuffers.h"

#include "Analysis/ArrayOrigins.h"
#include "KernelFunction.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

namespace warp {
#define GEN_PASS_DEF_PLACEBARRIERS
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

namespace {

bool isSameWindow(TileAccessOp a, TileAccessOp b) {
  return a && b && a.getArray() == b.getArray() &&
         a.getOffsets() == b.getOffsets() &&
         a.getTileType().getShape() == b.getTileType().getShape();
}

struct Touch {
  /// Bytes of shared memory; -1 for arrays.
  int64_t begin, end;
  bool isWrite;
  /// Elements of each thread's own: how many there are; 0 for any element.
  int64_t owned;
  /// The array; null for any.
  Value array;
  /// By all threads together, which orders what each does before and after it.
  bool isShared = false;
  /// The load, store or update of a window of an array whose threads each treat
  /// elements of their own; null for any other.
  TileAccessOp window = {};

  bool meets(const Touch &other, const ArrayOrigins &origins) const {
    if (!isWrite && !other.isWrite)
      return false;
    if (begin < 0 || other.begin < 0)
      return begin == other.begin &&
             (!array || !other.array || origins.mayAlias(array, other.array)) &&
             !isSameWindow(window, other.window);
    if (end <= other.begin || other.end <= begin)
      return false;
    bool same = begin == other.begin && end == other.end;
    return !(same && owned && owned == other.owned);
  }
};

using Touches = SmallVector<Touch>;

class BarrierPlacer {
public:
  BarrierPlacer(FunctionOpInterface kernel, int64_t threads)
      : buffers(kernel), origins(kernel, getVariant(kernel).getDisjoint()),
        varying(kernel), threads(threads), isSimt(getTarget(kernel).isSimt()),
        b(kernel.getContext()) {}

  void place(Block &block) {
    for (Operation &op : llvm::make_early_inc_range(block))
      place(&op);
  }

private:
  static constexpr int64_t arrays = -1;

  void touchTile(Touches &touches, Value tile, bool isWrite, int64_t owned) {
    if (buffers.isInRegisters(tile))
      return;
    int64_t begin = buffers.getOffset(tile);
    int64_t bytes = getStagedBytes(tile);
    touches.push_back({begin, begin + bytes, isWrite, owned, Value()});
  }

  static void touchArray(Touches &touches, Value array, bool isWrite,
                         TileAccessOp window = {}) {
    touches.push_back({arrays, arrays, isWrite, 0, array, false, window});
  }

  /// Adds the reads of a tile, through inlined tiles.
  void readTile(Touches &touches, Value tile, int64_t owned) {
    Operation *def = tile.getDefiningOp();
    if (!def || !isInline(def))
      return touchTile(touches, tile, false, owned);
    if (auto load = dyn_cast<TileAccessOp>(def))
      touchArray(touches, load.getArray(), /*isWrite=*/false);
    for (OpOperand &use : def->getOpOperands())
      if (isTile(use.get()))
        readTile(touches, use.get(), getRead(use) == TileRead::Own ? owned : 0);
  }

  Touches touchesOf(Operation *op) {
    Touches touches;
    if (isInline(op))
      return touches;
    // Sums of products lie otherwise among threads.
    auto isSum = [&](Value tile) {
      return isTile(tile) && buffers.isInRegisters(tile) &&
             !isDistributed(tile);
    };
    bool movesSums = llvm::any_of(op->getOperands(), isSum) ||
                     llvm::any_of(op->getResults(), isSum);
    // Matrices are copied by whole runs.
    auto window = dyn_cast<TileAccessOp>(op);
    bool isCopied = window && getLayout(op).getPitch() != 0;
    auto tileOp = dyn_cast<TileOpInterface>(op);
    bool byOwners = !movesSums && !isCopied && tileOp && tileOp.isByOwners();
    auto ownedOf = [&](Value tile) {
      return byOwners ? tileType(tile).getNumElements() : 0;
    };
    if (computesTiles(op)) {
      for (OpOperand &use : op->getOpOperands())
        if (isTile(use.get()))
          readTile(touches, use.get(),
                   getRead(use) == TileRead::Own ? ownedOf(use.get()) : 0);
      for (Value result : op->getResults())
        if (isTile(result) && !result.use_empty())
          touchTile(touches, result, true, ownedOf(result));
      if (auto scratch = op->getAttrOfType<IntegerAttr>(tiles::attr::scratch))
        touches.push_back({scratch.getInt(),
                           scratch.getInt() + tileOp.getScratchBytes(threads),
                           true, 0, Value()});
    }
    bool isWindow = byOwners && window && !window.getPicked() &&
                    getLayout(op).getStages() == 1 &&
                    !varying.anyOf(op->getOperands());
    if (window)
      touchArray(touches, window.getArray(), window.mayWrite(),
                 isWindow ? window : TileAccessOp());
    else if (auto access = dyn_cast<AccessOp>(op))
      touchArray(touches, access.getArray(), access.mayWrite());
    else if (!isMemoryEffectFree(op) && op->getNumRegions() == 0)
      touchArray(touches, Value(), /*isWrite=*/true);
    for (Touch &touch : touches)
      touch.isShared = isCollective(op);
    return touches;
  }

  /// True if one of these accesses has to come after an earlier one. Accesses
  /// of a single thread are ordered with those of the block, and not with those
  /// of other threads.
  bool meetsPending(ArrayRef<Touch> touches, bool isPrivate) const {
    return llvm::any_of(touches, [&](const Touch &touch) {
      return llvm::any_of(pending, [&](const Touch &earlier) {
        return (!isPrivate || earlier.isShared) &&
               touch.meets(earlier, origins);
      });
    });
  }

  void waitBefore(Operation *op) {
    b.setInsertionPoint(op);
    BarrierOp::create(b, op->getLoc());
    pending.clear();
  }

  void place(Operation *op) {
    if (isa<BarrierOp>(op))
      return pending.clear();
    if (isInline(op) || op->hasTrait<OpTrait::IsTerminator>())
      return;
    if (op->getNumRegions() != 0 && !isa<TileOpInterface>(op))
      return placeRegions(op);
    Touches touches = touchesOf(op);
    if (meetsPending(touches, isa<AccessOp>(op)))
      waitBefore(op);
    llvm::append_range(pending, touches);
  }

  void placeRegions(Operation *op) {
    bool isShared = false;
    op->walk([&](Operation *nested) { isShared |= isCollective(nested); });
    if (!isShared) {
      // Element reads and writes of each thread for itself.
      Touches touches;
      bool reads = false;
      op->walk([&](Operation *nested) {
        reads |= isa<TileGetOp>(nested);
        if (nested->getNumRegions() == 0 &&
            !nested->hasTrait<OpTrait::IsTerminator>())
          llvm::append_range(touches, touchesOf(nested));
      });
      if (reads || meetsPending(touches, /*isPrivate=*/true))
        waitBefore(op);
      llvm::append_range(pending, touches);
      return;
    }
    // Waits within a loop that loads ahead come with the loads.
    bool isStaged = op->hasAttr(tiles::attr::stages);
    bool isLoop = isa<LoopLikeOpInterface>(op);
    bool isPrecise = isSimt && !isStaged;
    if (!isPrecise || (isLoop && !pending.empty()))
      waitBefore(op);
    Touches before = std::move(pending), after;
    for (Region &region : op->getRegions()) {
      pending = before;
      if (region.empty() || isStaged) {
        llvm::append_range(after, pending);
        continue;
      }
      place(region.front());
      // The next iteration starts where this one ends.
      if (isLoop && !pending.empty())
        waitBefore(region.front().getTerminator());
      llvm::append_range(after, pending);
    }
    pending = std::move(after);
    if (isPrecise)
      return;
    b.setInsertionPointAfter(op);
    BarrierOp::create(b, op->getLoc());
    pending.clear();
  }

  TileBuffers buffers;
  ArrayOrigins origins;
  BlockVariance varying;
  int64_t threads;
  bool isSimt;
  OpBuilder b;
  Touches pending;
};

struct PlaceBarriers : warp::impl::PlaceBarriersBase<PlaceBarriers> {
  void runOnOperation() override {
    auto work = [](FunctionOpInterface kernel, int64_t threads) {
      if (threads > 1)
        BarrierPlacer(kernel, threads).place(kernel.getFunctionBody().front());
      return success();
    };
    if (failed(forTileKernel(getOperation(), work)))
      signalPassFailure();
  }
};

} // namespace
