//===- TileForms.cpp - Choose functions of the device library -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// On GPUs of compute capability 8.0 and later, operations on tiles of the
// shapes that the device library has functions for (TileFunction) call them.
// Other shapes and element types, debug kernels and blocks that are not full
// warps become loops.
//
//===----------------------------------------------------------------------===//

#include "TileForms.h"

#include "KernelFunction.h"

namespace warp::tiles {

using namespace mlir;

/// An odd number of fours where rows are read by fours, else odd.
static int64_t getPitchFor(int64_t columns) {
  return columns % 4 == 0 ? 4 * (columns / 4 | 1) : columns | 1;
}

using Functions = llvm::DenseMap<Operation *, TileFunction>;

/// Matrices that only functions read as such, or that are stored, get a pitch,
/// so that their rows and columns lie in different banks.
static void setPitches(FunctionOpInterface kernel, const Functions &functions) {
  TileBuffers buffers(kernel);
  llvm::MapVector<Value, SmallVector<Value>> byRoot;
  for (Value tile : buffers.getTiles())
    byRoot[buffers.rootOf(tile)].push_back(tile);
  auto readsAsMatrix = [&](OpOperand &use) {
    Operation *owner = use.getOwner();
    if (auto store = dyn_cast<TileStoreOp>(owner))
      return use.get() == store.getTile();
    return functions.lookup(owner).matrix == use.getOperandNumber();
  };
  for (auto &[root, members] : byRoot) {
    bool fits = llvm::all_of(members, [&](Value tile) {
      Operation *def = tile.getDefiningOp();
      auto access = dyn_cast_or_null<TileAccessOp>(def);
      bool isLoad = access && !access.mayWrite();
      return def && (isLoad || functions.lookup(def).givesMatrix) &&
             tileType(tile).getRank() == 2 &&
             llvm::all_of(tile.getUses(), readsAsMatrix);
    });
    if (fits)
      for (Value tile : members)
        setLayout(tile.getDefiningOp(), getLayout(tile).withPitch(getPitchFor(
                                            tileType(tile).getShape()[1])));
  }
}

/// Warps hide each other's latency: as many as have room for a panel's row in
/// registers.
static void limitRegisters(FunctionOpInterface kernel, int64_t threads,
                           const Functions &functions) {
  int64_t rows = 0, registers = 1;
  for (auto &[op, function] : functions) {
    rows = std::max(rows, function.rows);
    registers = std::max(registers, function.registers);
  }
  int64_t blocks = std::min<int64_t>((64 << 10) / (registers * threads), 32);
  if (rows > 8 && rows <= 32 && blocks > 1)
    kernel->setAttr(warp::attr::leastBlocks,
                    Builder(kernel.getContext()).getI64IntegerAttr(blocks));
}

void chooseFunctions(FunctionOpInterface kernel, int64_t threads) {
  const TargetInfo &target = getTarget(kernel);
  if (!target.has(Feature::BlockTiles) || !target.hasFullSubgroups(threads) ||
      getVariant(kernel).getDebug())
    return;
  Functions functions;
  kernel->walk([&](TileOpInterface op) {
    TileFunction function = op.getDeviceFunction(threads);
    if (function.variant == 0)
      return;
    functions[op] = function;
    op->setAttr(warp::attr::function,
                TileFunctionAttr::get(op->getContext(),
                                      std::to_string(function.variant), "", 0));
  });
  if (functions.empty())
    return;
  setPitches(kernel, functions);
  limitRegisters(kernel, threads, functions);
}

} // namespace warp::tiles
