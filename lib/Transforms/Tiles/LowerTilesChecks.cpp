//===- LowerTilesChecks.cpp - What debug kernels test ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Indices of elements and of parts, and factors: other kernels drop what is
// assigned outside, read anything there, and go on with NaN.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

namespace warp::tiles {

static std::string describe(ArrayRef<int64_t> shape) {
  std::string text;
  llvm::raw_string_ostream stream(text);
  llvm::interleaveComma(shape, stream);
  return "(" + text + (shape.size() == 1 ? ",)" : ")");
}

/// From `first` on, `count` indices that are `step` apart.
void TileLowering::checkIndices(Value tile, ValueRange first,
                                ArrayRef<int64_t> counts,
                                ArrayRef<int64_t> steps, Value where) {
  ArrayRef<int64_t> shape = tileType(tile).getShape();
  for (auto [d, extent] : llvm::enumerate(shape)) {
    Value begin = toIndex(first[d]);
    int64_t length = counts.empty() ? 0 : (counts[d] - 1) * steps[d];
    Value inside;
    for (Value i : {begin, add(begin, number(length))})
      inside =
          both(inside, arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult,
                                             i, number(extent)));
    if (where)
      inside = arith::OrIOp::create(
          b, loc, inside,
          arith::XOrIOp::create(
              b, loc, where,
              arith::ConstantOp::create(b, loc, b.getBoolAttr(true))));
    AssertOp::create(b, loc, inside,
                     "index of dimension " + std::to_string(d) +
                         " is outside of a tile of shape " + describe(shape));
  }
}

void TileLowering::checkOperands(Operation *op) {
  if (!debug)
    return;
  // What is computed where it is used has a place of its own.
  Location user = loc;
  loc = op->getLoc();
  TypeSwitch<Operation *>(op)
      .Case([&](TileGetOp get) {
        checkIndices(get.getTile(), get.getIndices(), {}, {}, Value());
      })
      .Case([&](TileSetOp set) {
        checkIndices(set.getTile(), set.getIndices(), {}, {}, set.getWhere());
      })
      .Case([&](TileSliceOp slice) {
        checkIndices(slice.getTile(), slice.getOffsets(),
                     tileType(slice.getResult()).getShape(), slice.getSteps(),
                     Value());
      })
      .Case([&](TileInsertOp insert) {
        checkIndices(insert.getTile(), insert.getOffsets(),
                     tileType(insert.getPart()).getShape(), insert.getSteps(),
                     Value());
      });
  loc = user;
}

/// What follows a pivot that is not positive is NaN, the last one in any case.
void TileLowering::checkFactor(TileCholeskyOp op) {
  Value last = number(tileType(op.getResult()).getShape()[0] - 1);
  Value pivot = load(op.getResult(), {last, last});
  AssertOp::create(b, loc, builtin("eq", {pivot, pivot}),
                   "tile_cholesky() of a matrix that is not positive definite");
}

} // namespace warp::tiles
