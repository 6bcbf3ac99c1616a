//===- ForwardElements.cpp - Store-to-load forwarding of elements ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "ForwardElements.h"

#include "WarpDialect/WarpOps.h"

using namespace mlir;

static void forwardStores(Block &block) {
  warp::StoreComponentsOp last;
  for (Operation &op : llvm::make_early_inc_range(block)) {
    if (auto store = dyn_cast<warp::StoreComponentsOp>(op)) {
      last = store;
      continue;
    }
    auto load = dyn_cast<warp::LoadComponentsOp>(op);
    if (!load) {
      if (!isMemoryEffectFree(&op))
        last = nullptr;
      continue;
    }
    if (!last || last.getArray() != load.getArray() ||
        !llvm::equal(last.getIndices(), load.getIndices()))
      continue;
    load.replaceAllUsesWith(SmallVector<Value>(last.getComponents()));
    load.erase();
  }
}

void warp::forwardStores(Operation *entry) {
  SmallVector<Block *> blocks;
  entry->walk([&](Block *block) { blocks.push_back(block); });
  for (Block *block : blocks)
    ::forwardStores(*block);
}
