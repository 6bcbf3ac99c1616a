//===- LowerTilesForms.cpp - Factors and transforms by warps --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Calls of the device library.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"
#include "TileForms.h"

using namespace mlir;

namespace warp::tiles {

void TileLowering::callForm(StringRef verb, Operation *op, Values arguments) {
  arguments.push_back(number(threads));
  callLibrary("warp_tile_" + verb + "_" + Twine(getForm(op)), {}, arguments);
}

/// Whether a matrix that is loaded comes by asynchronous copies: all of them
/// are on their way at once, and pass by the registers. Each thread has one or
/// more.
bool TileLowering::isCopied(TileLoadOp op) {
  TileType type = tileType(op.getResult());
  int64_t runs = type.getShape().back() / 4;
  return op->hasAttr(attr::pitch) && !op.getPicked() &&
         type.getElementType().isF32() && type.getShape().back() % 4 == 0 &&
         runs <= threads && threads % runs == 0 &&
         type.getNumElements() >= 4 * threads &&
         llvm::all_of(op.getOffsets(), [](Value offset) {
           return getByteSize(offset.getType()) <= 4;
         });
}

/// The first place where threads meet after a load and before all of its uses.
static BarrierOp meetingAfter(TileLoadOp load) {
  Block *block = load->getBlock();
  for (Operation *op = load->getNextNode(); op; op = op->getNextNode())
    if (auto barrier = dyn_cast<BarrierOp>(op))
      return llvm::all_of(load.getResult().getUsers(),
                          [&](Operation *user) {
                            Operation *there =
                                block->findAncestorOpInBlock(*user);
                            return there && barrier->isBeforeInBlock(there);
                          })
                 ? barrier
                 : BarrierOp();
  return BarrierOp();
}

void TileLowering::copyMatrix(TileLoadOp op) {
  TileType type = tileType(op.getResult());
  Values arguments{addressOf(memoryOf(op.getResult()))};
  arguments.append(windowOf(op, op.getArray(), type, op.getOffsets()));
  arguments.push_back(
      number(op->getAttrOfType<IntegerAttr>(attr::pitch).getInt()));
  arguments.push_back(number(threads));
  callLibrary("warp_tile_fetch_b32", {}, arguments);
  callLibrary("warp_tile_close_group", {}, {});
  OpBuilder::InsertionGuard guard(b);
  if (BarrierOp barrier = meetingAfter(op))
    b.setInsertionPoint(barrier);
  callLibrary("warp_tile_await_groups", {}, {number(0)});
}

void TileLowering::factor(TileCholeskyOp op) {
  Strided to = *getStrided(op.getResult()), from = *getStrided(op.getTile());
  if (op.getUpper()) {
    std::swap(to.steps[0], to.steps[1]);
    std::swap(from.steps[0], from.steps[1]);
  }
  int64_t n = tileType(op.getTile()).getShape()[0];
  Value scratch =
      arrayAt(scratchOf(op), getFormBytes(op, threads) / 4, b.getF32Type());
  callForm("factor", op,
           {addressOf(memoryOf(op.getResult())), number(to.steps[0]),
            number(to.steps[1]), addressOf(memoryOf(from.memory)),
            number(from.steps[0]), number(from.steps[1]), addressOf(scratch),
            number(n)});
}

void TileLowering::differentiateFactor(TileCholeskyAdjointOp op) {
  begin(op, op.getCotangent());
  Strided to = *getStrided(op.getResult()), from = *getStrided(op.getFactor());
  if (op.getUpper()) {
    std::swap(to.steps[0], to.steps[1]);
    std::swap(from.steps[0], from.steps[1]);
  }
  Value scratch =
      arrayAt(scratchOf(op), getFormBytes(op, threads) / 4, b.getF32Type());
  callForm("differentiate_factor", op,
           {addressOf(memoryOf(op.getResult())), number(to.steps[0]),
            number(to.steps[1]), addressOf(memoryOf(from.memory)),
            number(from.steps[0]), number(from.steps[1]), addressOf(scratch),
            number(tileType(op.getFactor()).getShape()[0])});
}

void TileLowering::substitute(TileSolveOp op) {
  begin(op, op.getRhs());
  Strided matrix = *getStrided(op.getMatrix());
  if (op.getTransposed())
    std::swap(matrix.steps[0], matrix.steps[1]);
  TileType rhs = tileType(op.getRhs());
  int64_t n = rhs.getShape()[0];
  bool backwards = bool(op.getUpper()) != bool(op.getTransposed());
  callForm("substitute", op,
           {addressOf(memoryOf(op.getResult())),
            addressOf(memoryOf(matrix.memory)), number(matrix.steps[0]),
            number(matrix.steps[1]), number(n),
            number(rhs.getNumElements() / n), number(backwards)});
}

void TileLowering::transformRows(TileFftOp op) {
  begin(op, op.getTile());
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape().back();
  Value tile = memoryOf(op.getResult()), scratch = tile;
  if (int64_t bytes = getFormBytes(op, threads))
    scratch = arrayAt(scratchOf(op), bytes / 8, type.getElementType());
  callForm("transform", op,
           {addressOf(tile), addressOf(scratch),
            number(type.getNumElements() / n), number(n),
            number(op.getInverse())});
}

} // namespace warp::tiles
