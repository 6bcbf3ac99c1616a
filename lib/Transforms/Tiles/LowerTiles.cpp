//===- LowerTiles.cpp - Lower tiles to loops over elements ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A tile in memory is a packed array of rank one at its offset in shared
// memory. An operation becomes loops over the elements of its result, which the
// threads of the block share: thread t takes elements t, t + B, ... On a CPU a
// block is one thread, and loops run over the dimensions, so that LLVM finds
// them easy to vectorise. Inlined tiles are computed in the loop of their user.
//
// Accesses of arrays are tested against the array's extents. One test of the
// whole tile chooses between a loop without tests and one with them.
//
// This pass knows no operation: TileOpInterface writes the code of each. Models
// are in the files of their families, over the same helpers:
//
//   helpers                        LowerTilesLoops.cpp, LowerTilesMemory.cpp,
//                                  LowerTilesWindows.cpp
//   elementwise                    Elements.cpp, Views.cpp
//   loads, stores, updates         Accesses.cpp, Updates.cpp
//   threads, parts                 Threads.cpp, Parts.cpp
//   reductions, folds, scans       Reductions.cpp, Scans.cpp
//   sorting                        Sorts.cpp
//   products                       Products.cpp, in registers Accumulators.cpp,
//                                  with TMA loads TmaProducts.cpp
//   factors, solves                Factors.cpp, Solves.cpp
//   Fourier transforms             Transforms.cpp
//
//===----------------------------------------------------------------------===//

#include "Accumulators.h"
#include "Models.h"

#include "KernelFunction.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/IR/DialectRegistry.h"

namespace warp {
#define GEN_PASS_DEF_LOWERTILES
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;

namespace warp::tiles {

LoweringState::LoweringState(FunctionOpInterface kernel, int64_t threads)
    : kernel(kernel), threads(threads), buffers(kernel), b(kernel.getContext()),
      entry(kernel.getContext()), loc(kernel.getLoc()), i32(b.getI32Type()),
      debug(getVariant(kernel).getDebug()) {
  entry.setInsertionPointToStart(&kernel.getFunctionBody().front());
  if (threads > 1)
    thread = ThreadNumberOp::create(entry, loc, i32);
}

TileLowering::TileLowering(LoweringState &state)
    : state(state), kernel(state.kernel), threads(state.threads),
      buffers(state.buffers), b(state.b), entry(state.entry), loc(state.loc),
      i32(state.i32), thread(state.thread) {}

void registerModels(DialectRegistry &registry) {
  registry.addExtension(+[](MLIRContext *context, WarpDialect *) {
    for (auto attach :
         {attachElements, attachViews, attachAccesses, attachUpdates,
          attachThreads, attachParts, attachReductions, attachScans,
          attachSorts, attachProducts, attachFactors, attachSolves,
          attachTransforms})
      attach(*context);
  });
}

//===----------------------------------------------------------------------===//
// Removal of tiles
//===----------------------------------------------------------------------===//

/// Tiles, also those that are gone.
static llvm::BitVector tilesAmong(ValueRange values) {
  llvm::BitVector found(values.size());
  for (auto [i, value] : llvm::enumerate(values))
    if (!value || isTile(value))
      found.set(i);
  return found;
}

static void dropTiles(Block &block) {
  for (BlockArgument argument : block.getArguments())
    if (isTile(argument))
      argument.dropAllUses();
  block.eraseArguments([](BlockArgument argument) { return isTile(argument); });
  Operation *end = block.getTerminator();
  end->eraseOperands(tilesAmong(end->getOperands()));
}

/// Control flow without the tiles that it carries.
static void dropTiles(Operation *op) {
  for (Region &region : op->getRegions())
    if (!region.empty())
      dropTiles(region.front());
  op->eraseOperands(tilesAmong(op->getOperands()));
  llvm::BitVector results = tilesAmong(op->getResults());
  if (results.none())
    return;
  SmallVector<Type> types;
  for (Value result : op->getResults())
    if (isTile(result))
      result.dropAllUses();
    else
      types.push_back(result.getType());
  OperationState state(op->getLoc(), op->getName(), op->getOperands(), types,
                       op->getAttrs());
  for (Region &region : op->getRegions())
    state.addRegion()->takeBody(region);
  Operation *rebuilt = OpBuilder(op).create(state);
  unsigned next = 0;
  for (Value result : op->getResults())
    if (!isTile(result))
      result.replaceAllUsesWith(rebuilt->getResult(next++));
  op->erase();
}

/// Removes what was lowered.
static void detach(FunctionOpInterface kernel) {
  SmallVector<Operation *> done, carriers;
  kernel->walk([&](Operation *op) {
    if (computesTiles(op))
      done.push_back(op);
    else if (isa<scf::ForOp, scf::WhileOp, scf::IfOp>(op))
      carriers.push_back(op);
  });
  for (Operation *op : carriers)
    dropTiles(op);
  for (Operation *op : llvm::reverse(done)) {
    op->dropAllUses();
    op->erase();
  }
}

//===----------------------------------------------------------------------===//
// The pass
//===----------------------------------------------------------------------===//

static LogicalResult lowerTiles(FunctionOpInterface kernel, int64_t threads) {
  SmallVector<Operation *> ops;
  SmallVector<scf::ForOp> pipelined;
  kernel->walk([&](Operation *op) {
    if (computesTiles(op) && !isInline(op))
      ops.push_back(op);
    else if (op->hasAttr(attr::stages))
      pipelined.push_back(cast<scf::ForOp>(op));
  });
  LoweringState state(kernel, threads);
  findPlainUpdates(state, ops);
  for (scf::ForOp loop : pipelined)
    AccumulatorLowering(state).pipeline(loop);
  TileLowering lowering(state);
  for (Operation *op : ops) {
    // Pipelined loads are code of their loop.
    if (getLayout(op).getStages() > 1)
      continue;
    state.b.setInsertionPoint(op);
    state.loc = op->getLoc();
    cast<TileOpInterface>(op).lower(lowering);
  }
  detach(kernel);
  return success();
}

} // namespace warp::tiles

namespace {

struct LowerTiles : warp::impl::LowerTilesBase<LowerTiles> {
  void runOnOperation() override {
    if (failed(warp::tiles::forTileKernel(getOperation(),
                                          warp::tiles::lowerTiles)))
      signalPassFailure();
  }
};

} // namespace
