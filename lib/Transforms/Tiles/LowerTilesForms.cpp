//===- LowerTilesForms.cpp - Factors and transforms by warps --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Calls of lib/DeviceLib/gpu.
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
