//===- TileForms.cpp - Factors and transforms by warps --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Which shapes the device library has functions for. Other ones, and other
// element types, become loops (LowerTilesAlgebra.cpp,
// LowerTilesTransforms.cpp).
//
//===----------------------------------------------------------------------===//

#include "TileForms.h"

#include "KernelFunction.h"
#include "TileScratch.h"

namespace warp::tiles {

using namespace mlir;

/// Rows of a matrix that lanes of one warp have, four each.
constexpr int64_t mostRows = 128;

/// Columns of a panel.
static int64_t factorForm(Value matrix) {
  int64_t n = tileType(matrix).getShape()[0];
  bool fits = tileType(matrix).getElementType().isF32() && n <= mostRows &&
              getStrided(matrix);
  return !fits ? 0 : n <= 8 ? 8 : 16;
}

/// Rows of a lane.
static int64_t solveForm(TileSolveOp op) {
  int64_t n = tileType(op.getRhs()).getShape()[0];
  bool fits = tileType(op.getMatrix()).getElementType().isF32() &&
              n <= mostRows && getStrided(op.getMatrix());
  return !fits ? 0 : n <= 32 ? 1 : n <= 64 ? 2 : 4;
}

/// Elements of a thread: the fewest with which the block has a row.
static int64_t transformForm(TileFftOp op, int64_t threads) {
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape().back();
  if (!getElementScalar(type.getElementType()).isF32() || n < 4 ||
      getFftMethod(op, threads) != FftMethod::Stages)
    return 0;
  for (int64_t own : {4, 8, 16})
    if (own <= n && n / own <= threads)
      return own;
  return 0;
}

int64_t getForm(Operation *op) {
  return op->getAttrOfType<IntegerAttr>(attr::form).getInt();
}

int64_t getFormBytes(Operation *op, int64_t threads) {
  if (isa<TileCholeskyOp, TileCholeskyAdjointOp>(op))
    return 4 * getForm(op) * (getForm(op) + 1);
  auto fft = dyn_cast<TileFftOp>(op);
  if (!fft)
    return 0;
  TileType type = tileType(fft.getTile());
  int64_t n = type.getShape().back(), lanes = n / getForm(op);
  int64_t rows = std::min(type.getNumElements() / n, threads / lanes);
  return lanes == 1 ? 0 : rows * (n + n / 8) * 8;
}

/// An odd number of fours where rows are read by fours, else odd.
static int64_t pitchOf(int64_t columns) {
  return columns % 4 == 0 ? 4 * (columns / 4 | 1) : columns | 1;
}

/// Whether an operation with a form reads the tile as its matrix, and does not
/// read it otherwise.
static bool readsAsMatrix(OpOperand &use) {
  Operation *op = use.getOwner();
  return isa<TileCholeskyOp, TileCholeskyAdjointOp, TileSolveOp>(op) &&
         op->hasAttr(attr::form) && use.getOperandNumber() == 0;
}

static void setPitches(FunctionOpInterface kernel) {
  TileBuffers buffers(kernel);
  llvm::MapVector<Value, SmallVector<Value>> byRoot;
  for (Value tile : buffers.getTiles())
    byRoot[buffers.rootOf(tile)].push_back(tile);
  for (auto &[root, members] : byRoot) {
    bool fits = llvm::all_of(members, [](Value tile) {
      Operation *def = tile.getDefiningOp();
      return def &&
             (isa<TileLoadOp>(def) ||
              (isa<TileCholeskyOp>(def) && def->hasAttr(attr::form))) &&
             tileType(tile).getRank() == 2 &&
             llvm::all_of(tile.getUses(), readsAsMatrix);
    });
    if (fits)
      for (Value tile : members)
        tile.getDefiningOp()->setAttr(
            attr::pitch,
            Builder(kernel.getContext())
                .getI64IntegerAttr(pitchOf(tileType(tile).getShape()[1])));
  }
}

/// Warps hide each other's waits: as many as have room for a panel's row in
/// registers.
static void limitRegisters(FunctionOpInterface kernel, int64_t threads) {
  int64_t widest = 0, registers = 72;
  kernel->walk([&](Operation *op) {
    bool isAdjoint = isa<TileCholeskyAdjointOp>(op);
    if (!(isAdjoint || isa<TileCholeskyOp>(op)) || !op->hasAttr(attr::form))
      return;
    int64_t n = tileType(op->getOperand(0)).getShape()[0];
    widest = std::max(widest, n);
    // A row, or columns of both matrices.
    if (n > 16)
      registers = std::max<int64_t>(registers, isAdjoint ? 128 : 96);
  });
  int64_t blocks = std::min<int64_t>((64 << 10) / (registers * threads), 32);
  if (widest > 8 && widest <= 32 && blocks > 1)
    kernel->setAttr(warp::attr::leastBlocks,
                    Builder(kernel.getContext()).getI64IntegerAttr(blocks));
}

void chooseForms(FunctionOpInterface kernel, int64_t threads) {
  if (!isGpu(kernel) || threads % 32 != 0 || getVariant(kernel).getDebug() ||
      getVariant(kernel).getTarget().getVersion() < 80)
    return;
  bool any = false;
  kernel->walk([&](Operation *op) {
    int64_t form = 0;
    if (auto factor = dyn_cast<TileCholeskyOp>(op))
      form = factorForm(factor.getTile());
    else if (auto adjoint = dyn_cast<TileCholeskyAdjointOp>(op))
      form = factorForm(adjoint.getFactor());
    else if (auto solve = dyn_cast<TileSolveOp>(op))
      form = solveForm(solve);
    else if (auto fft = dyn_cast<TileFftOp>(op))
      form = transformForm(fft, threads);
    if (form == 0)
      return;
    any = true;
    op->setAttr(attr::form,
                Builder(kernel.getContext()).getI64IntegerAttr(form));
  });
  if (!any)
    return;
  setPitches(kernel);
  limitRegisters(kernel, threads);
}

} // namespace warp::tiles
