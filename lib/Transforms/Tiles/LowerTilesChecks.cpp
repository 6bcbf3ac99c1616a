//===- LowerTilesChecks.cpp - What debug kernels test ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Factors: other kernels go on with NaN. Indices are checked where the front
// end has them (IndexChecks.h); elsewhere what is assigned outside is dropped,
// and anything is read there.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

using namespace mlir;

namespace warp::tiles {

/// What follows a pivot that is not positive is NaN, the last one in any case.
void TileLowering::checkFactor(TileCholeskyOp op) {
  Value last = number(tileType(op.getResult()).getShape()[0] - 1);
  Value pivot = load(op.getResult(), {last, last});
  AssertOp::create(b, loc, builtin("eq", {pivot, pivot}),
                   "tile_cholesky() of a matrix that is not positive definite");
}

} // namespace warp::tiles
