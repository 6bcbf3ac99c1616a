//===- WarpBlocks.cpp - Kernels with tiles that one warp is enough for ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A factorisation or substitution of at most 32 rows is the work of one warp: a
// lane has a row, and nothing waits. In a larger block the other warps load and
// store their share and wait at barriers, while their registers keep blocks off
// the multiprocessor. Threads that do not tell themselves apart do not see how
// many they are, so such a kernel may have fewer.
//
//===----------------------------------------------------------------------===//

#include "Context.h"

#include "warp/TileBuilder.h"

#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;

/// Rows of a matrix that a warp factors in registers, and elements of a tile of
/// which its lanes take so many each.
static constexpr int64_t mostRows = 32, mostElements = 1024;

static bool isSmall(Type type) {
  auto tile = dyn_cast<warp::TileType>(type);
  return !tile || tile.getNumElements() <= mostElements;
}

/// True if what an operation does is the same for any number of threads that do
/// it, as long as they have the same operands.
static bool isOfAnyBlock(Operation *op) {
  if (isa<warp::TileFromThreadsOp, warp::TileToThreadsOp>(op))
    return false;
  if (auto set = dyn_cast<warp::TileSetOp>(op))
    return set.getKind() == warp::TileUpdate::assign && !set.getWhere();
  if (isa<warp::LoadOp, warp::StoreOp, warp::TileLoadOp, warp::TileStoreOp,
          warp::TileAtomicOp, func::CallOp, func::FuncOp>(op))
    return true;
  return op->hasTrait<OpTrait::IsTerminator>() ||
         op->hasTrait<OpTrait::HasRecursiveMemoryEffects>() ||
         isMemoryEffectFree(op);
}

int warp::rankOfWarpBlocks(const Module &module) {
  ContextLock lock;
  unsigned rank = 1;
  bool factors = false;
  auto found = module.getImpl()->op->walk([&](Operation *op) {
    if (isa<ModuleOp>(op))
      return WalkResult::advance();
    if (!isOfAnyBlock(op) || !llvm::all_of(op->getResultTypes(), isSmall) ||
        !llvm::all_of(op->getOperandTypes(), isSmall))
      return WalkResult::interrupt();
    if (auto tid = dyn_cast<TidOp>(op))
      rank = std::max(rank, tid->getNumResults());
    if (isa<TileCholeskyOp, TileSolveOp>(op)) {
      auto matrix = cast<TileType>(op->getOperand(0).getType());
      if (matrix.getShape().back() > mostRows)
        return WalkResult::interrupt();
      factors = true;
    }
    return WalkResult::advance();
  });
  return factors && !found.wasInterrupted() ? static_cast<int>(rank) : 0;
}
