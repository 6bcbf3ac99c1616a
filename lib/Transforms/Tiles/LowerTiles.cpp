//===- LowerTiles.cpp - Tiles as loops over elements ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A tile in memory is a packed array of rank one at its place in the block's
// memory. An operation becomes loops over the elements of its result, which the
// threads of the block share: thread t takes elements t, t + B, ... On a CPU a
// block is one thread, and loops run over the dimensions, so that LLVM finds
// them easy to vectorise. What is not kept is computed within the loop of its
// user.
//
// Accesses of arrays are tested against the array's extents. One test of the
// whole tile chooses between a loop without tests and one with them.
//
//   what                           in file
//   scalars, loops over elements   LowerTilesLoops.cpp
//   windows of arrays              LowerTilesWindows.cpp
//   elements, arrays, maps         LowerTilesElements.cpp
//   updates of arrays              LowerTilesUpdates.cpp
//   threads, parts                 LowerTilesParts.cpp
//   reductions, scans              LowerTilesReductions.cpp
//   sorting                        LowerTilesSort.cpp
//   products, factors              LowerTilesAlgebra.cpp
//   products that threads hold     LowerTilesProducts.cpp
//   pipelined products with TMA    LowerTilesRings.cpp
//   factors, transforms by forms   LowerTilesForms.cpp
//   Fourier transforms             LowerTilesTransforms.cpp
//   whole tiles on CPUs            LowerTilesLibrary.cpp
//   tests of debug kernels         LowerTilesChecks.cpp
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"
#include "EarlyLoads.h"
#include "TileProducts.h"

#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/ADT/TypeSwitch.h"

namespace warp {
#define GEN_PASS_DEF_LOWERTILES
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;

namespace warp::tiles {

TileLowering::TileLowering(FunctionOpInterface kernel, int64_t threads)
    : kernel(kernel), threads(threads), buffers(kernel), b(kernel.getContext()),
      entry(kernel.getContext()), loc(kernel.getLoc()), i32(b.getI32Type()),
      debug(getVariant(kernel).getDebug()) {
  entry.setInsertionPointToStart(&kernel.getFunctionBody().front());
  if (threads > 1)
    thread = ThreadNumberOp::create(entry, loc, i32);
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

void TileLowering::lower(Operation *op) {
  b.setInsertionPoint(op);
  loc = op->getLoc();
  if (op->hasAttr(attr::stages))
    return;
  llvm::TypeSwitch<Operation *>(op)
      .Case([&](TileMapOp map) {
        if (map->hasAttr(attr::held))
          setHeld(map);
        else if (isTile(map.getInputs()[0]) &&
                 buffers.isHeld(map.getInputs()[0]) &&
                 !tiles::isStriped(map.getInputs()[0]))
          giveHeld(map);
        else
          lowerMap(map);
      })
      .Case([&](TileSplatOp splat) {
        if (splat->hasAttr(attr::held))
          setHeld(splat);
        else
          keep(splat);
      })
      .Case([&](TileStoreOp store) {
        if (buffers.isHeld(store.getTile()) &&
            !tiles::isStriped(store.getTile()))
          storeHeld(store);
        else
          lowerStore(store);
      })
      .Case([&](TileAtomicOp atomic) {
        if (buffers.isHeld(atomic.getTile()) &&
            !tiles::isStriped(atomic.getTile()))
          addHeld(atomic);
        else
          lowerAtomic(atomic);
      })
      .Case([&](TileFromThreadsOp from) { lowerFromThreads(from); })
      .Case([&](TileToThreadsOp to) { lowerToThreads(to); })
      .Case([&](TileGetOp get) { lowerGet(get); })
      .Case([&](TileSetOp set) { lowerSet(set); })
      .Case([&](TileInsertOp insert) { lowerInsert(insert); })
      .Case([&](TileGatherOp gather) { lowerGather(gather); })
      .Case([&](TileScatterOp scatter) { lowerScatter(scatter); })
      .Case([&](TileReduceOp reduce) {
        lowerReduce(reduce, reduce.getKind(), reduce.getTile(),
                    reduce.getAxis(), /*positions=*/false);
      })
      .Case([&](TileArgReduceOp reduce) {
        lowerReduce(reduce, reduce.getKind(), reduce.getTile(),
                    reduce.getAxis(), /*positions=*/true);
      })
      .Case([&](TileFoldOp fold) { lowerFold(fold); })
      .Case([&](TileScanOp scan) { lowerScan(scan); })
      .Case([&](TileSortOp sort) { lowerSort(sort); })
      .Case([&](TileMatmulOp matmul) {
        if (matmul->hasAttr(attr::form))
          lowerHeldProduct(matmul);
        else
          lowerMatmul(matmul);
      })
      .Case([&](TileCholeskyOp op) {
        op->hasAttr(attr::form) ? factor(op) : lowerCholesky(op);
        if (debug)
          checkFactor(op);
      })
      .Case([&](TileCholeskyAdjointOp op) {
        op->hasAttr(attr::form) ? differentiateFactor(op)
                                : lowerCholeskyAdjoint(op);
      })
      .Case([&](TileSolveOp op) {
        op->hasAttr(attr::form) ? substitute(op) : lowerSolve(op);
      })
      .Case([&](TileDiagAddOp add) { lowerDiagAdd(add); })
      .Case([&](TileFftOp op) {
        op->hasAttr(attr::form) ? transformRows(op) : lowerFft(op);
      })
      .Case([](TileEmptyOp) {})
      .Case([&](TileLoadOp load) {
        isCopied(load) ? copyMatrix(load) : keep(load);
      })
      .Default([&](Operation *) { keep(op); });
}

//===----------------------------------------------------------------------===//
// Control flow
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
void TileLowering::detach() {
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

LogicalResult TileLowering::run() {
  SmallVector<Operation *> ops;
  SmallVector<scf::ForOp> ahead;
  kernel->walk([&](Operation *op) {
    if (computesTiles(op) && !isInline(op))
      ops.push_back(op);
    else if (op->hasAttr(attr::stages))
      ahead.push_back(cast<scf::ForOp>(op));
  });
  // Exact sums are made in memory of their own, and not by plain updates at
  // times.
  bool isExact = getVariant(kernel).getDeterministic() == Determinism::exact;
  if (!isExact && (threads == 1 || isGpu(kernel)))
    for (Operation *op : ops)
      if (auto atomic = dyn_cast<TileAtomicOp>(op))
        if (std::optional<OwnSteps> steps = findOwnSteps(kernel, atomic))
          ownSteps[op] = *steps;
  for (auto [op, steps] : ownSteps)
    earliest[op] = findEarliest(mlir::cast<TileAtomicOp>(op));
  for (scf::ForOp loop : ahead) {
    bool isRing =
        llvm::any_of(loop.getBody()->getOps<TileLoadOp>(),
                     [](TileLoadOp load) { return load->hasAttr(attr::map); });
    if (isRing)
      lowerRing(loop);
    else
      lowerAhead(loop);
  }
  for (Operation *op : ops)
    lower(op);
  detach();
  return success();
}

} // namespace warp::tiles

namespace {

struct LowerTiles : warp::impl::LowerTilesBase<LowerTiles> {
  void runOnOperation() override {
    auto work = [](FunctionOpInterface kernel, int64_t threads) {
      return warp::tiles::TileLowering(kernel, threads).run();
    };
    if (failed(warp::tiles::forTileKernel(getOperation(), work)))
      signalPassFailure();
  }
};

} // namespace
