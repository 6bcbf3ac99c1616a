//===- TileChunks.cpp - Neighbours of one thread --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Which thread has an element may depend on the number of elements alone, as
// registers, and barriers that are left out, rely on it. So it is decided for a
// kernel: if all of its larger tiles are loaded, mapped, reduced and stored
// without memory of the block, and nothing in them tells threads apart.
//
//===----------------------------------------------------------------------===//

#include "TileChunks.h"

#include "BlockVariance.h"
#include "KernelFunction.h"

using namespace mlir;

namespace warp::tiles {

constexpr int64_t neighbours = 4;

static bool isLarge(TileType type, int64_t threads) {
  return type.getNumElements() % (neighbours * threads) == 0;
}

static bool streams(Operation *op) {
  if (auto load = dyn_cast<TileLoadOp>(op))
    return !load.getPicked() && !load->hasAttr(attr::stages) &&
           !load->hasAttr(attr::pitch);
  if (auto store = dyn_cast<TileStoreOp>(op))
    return !store.getPicked();
  return isa<TileMapOp, TileSplatOp, TileBroadcastOp>(op) ||
         readsOwnElements(op);
}

void chooseChunks(FunctionOpInterface kernel, int64_t threads) {
  if (!isGpu(kernel) || threads == 1)
    return;
  BlockVariance varying(kernel);
  auto walked = kernel->walk([&](Operation *op) {
    auto isLargeTile = [&](Value value) {
      return isTile(value) && isLarge(tileType(value), threads);
    };
    auto fits = [&](Value tile) {
      TileType type = tileType(tile);
      return type.getShape().back() % neighbours == 0 &&
             getByteSize(type.getElementType()) <= 8;
    };
    auto isFine = [&](Value value) {
      return isLargeTile(value) ? fits(value) : !varying.contains(value);
    };
    bool large = llvm::any_of(op->getOperands(), isLargeTile) ||
                 llvm::any_of(op->getResults(), isLargeTile);
    if (!large)
      return WalkResult::advance();
    bool isKept = llvm::any_of(op->getResults(), [&](Value result) {
      return isLargeTile(result) && !isInline(op) && !isStriped(result) &&
             !result.use_empty();
    });
    return !isKept && computesTiles(op) && streams(op) &&
                   llvm::all_of(op->getOperands(), isFine) &&
                   llvm::all_of(op->getResults(), isFine)
               ? WalkResult::advance()
               : WalkResult::interrupt();
  });
  if (!walked.wasInterrupted())
    kernel->setAttr(attr::chunk,
                    Builder(kernel.getContext()).getI64IntegerAttr(neighbours));
}

int64_t getChunk(Operation *kernel, ArrayRef<int64_t> shape, int64_t threads) {
  auto chunk = kernel->getAttrOfType<IntegerAttr>(attr::chunk);
  int64_t count = 1;
  for (int64_t extent : shape)
    count *= extent;
  return chunk && count % (chunk.getInt() * threads) == 0 ? chunk.getInt() : 1;
}

} // namespace warp::tiles
