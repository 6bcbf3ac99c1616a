//===- LowerTilesWindows.cpp - Bounds-checked loops at array edges --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loop over the elements of a tile is written twice where it accesses arrays:
// one test for all elements chooses the one that tests none, or the one that
// tests each.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "Transforms/Launch/UnrollLoop.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/Support/SaveAndRestore.h"

using namespace mlir;

namespace warp::tiles {

Values TileLowering::arrayIndices(TileAccessOp op, ValueRange indices,
                                  Value &inside) {
  Values found;
  Value picked = op.getPicked();
  for (auto [d, offset] : llvm::enumerate(op.getOffsets())) {
    bool picks = picked && op.getAxis() == d;
    Value index = indices[d];
    if (picks)
      index = element(picked, ValueRange(indices[d]));
    bool isWide =
        getByteSize(offset.getType()) > 4 || getByteSize(index.getType()) > 4;
    Type type = isWide ? b.getI64Type() : i32;
    Value place = add(cast(offset, type), cast(index, type));
    found.push_back(place);
    if (!op.getChecked() || (!state.testing && !picks))
      continue;
    Value extent = cast(DimOp::create(b, loc, b.getIntegerType(32, true),
                                      op.getArray(), b.getI64IntegerAttr(d)),
                        type);
    // As unsigned numbers, negative ones are too large.
    inside =
        both(inside, arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult,
                                           place, extent));
  }
  return found;
}

Values TileLowering::windowOf(TileAccessOp op, Value array,
                              ValueRange offsets) {
  Values window{addressOf(array)};
  for (Value offset : offsets)
    window.push_back(toIndex(offset));
  Type integer = b.getIntegerType(32, true);
  for (int64_t d = 0; d < 2; ++d)
    window.push_back(
        DimOp::create(b, loc, integer, array, b.getI64IntegerAttr(d)));
  for (int64_t d = 0; d < 2; ++d)
    window.push_back(
        StrideOp::create(b, loc, integer, array, b.getI64IntegerAttr(d)));
  for (int64_t extent : op.getTileType().getShape())
    window.push_back(number(extent));
  window.push_back(number(op.getChecked()));
  return window;
}

/// True if all elements that an operation accesses by itself are inside of
/// their array; null if that is not tested.
void TileLowering::testWindow(Operation *op, Value &inside) {
  auto access = dyn_cast<TileAccessOp>(op);
  if (!access || !access.getChecked())
    return;
  for (auto [d, extent] : llvm::enumerate(access.getTileType().getShape())) {
    // Picked indices are tested one by one.
    if (access.getPicked() && access.getAxis() == d)
      continue;
    Value offset = access.getOffsets()[d];
    Type wide = getByteSize(offset.getType()) > 4 ? b.getI64Type() : i32;
    Value first = cast(offset, wide);
    Value end = cast(DimOp::create(b, loc, b.getIntegerType(32, true),
                                   access.getArray(), b.getI64IntegerAttr(d)),
                     wide);
    Value length =
        arith::ConstantOp::create(b, loc, b.getIntegerAttr(wide, extent));
    Value none = arith::ConstantOp::create(b, loc, b.getIntegerAttr(wide, 0));
    Value low =
        arith::CmpIOp::create(b, loc, arith::CmpIPredicate::sge, first, none);
    Value last = arith::SubIOp::create(b, loc, end, length);
    Value high =
        arith::CmpIOp::create(b, loc, arith::CmpIPredicate::sle, first, last);
    inside = both(inside, both(low, high));
  }
}

/// The same of what is computed in its loop, too.
void TileLowering::collectTested(Operation *op, Value &inside) {
  testWindow(op, inside);
  for (Value operand : op->getOperands()) {
    Operation *def = operand.getDefiningOp();
    if (def && isTile(operand) && isInline(def))
      collectTested(def, inside);
  }
}

/// True if an operation, or what is computed in its loop, reads or makes tiles
/// that threads have in registers.
bool TileLowering::touchesDistributed(Operation *op) {
  auto isDistributedTile = [](Value tile) {
    return isTile(tile) && tiles::isDistributed(tile) && !isReplicated(tile);
  };
  return llvm::any_of(op->getResults(), isDistributedTile) ||
         llvm::any_of(op->getOperands(), [&](Value operand) {
           Operation *def = operand.getDefiningOp();
           return isDistributedTile(operand) ||
                  (def && isTile(operand) && isInline(def) &&
                   touchesDistributed(def));
         });
}

Values TileLowering::elements(Operation *op, ArrayRef<int64_t> shape,
                              ValueRange sums, Body body) {
  Value inside;
  if (!state.isDecided)
    collectTested(op, inside);
  llvm::SaveAndRestore distributed(state.isDistributed, touchesDistributed(op));
  if (!inside)
    return share(shape, sums, body);
  auto branch = scf::IfOp::create(b, loc, TypeRange(sums), inside,
                                  /*withElse=*/true);
  OpBuilder::InsertionGuard guard(b);
  for (bool tested : {false, true}) {
    Block *block = tested ? branch.elseBlock() : branch.thenBlock();
    if (sums.empty())
      b.setInsertionPoint(block->getTerminator());
    else
      b.setInsertionPointToStart(block);
    state.testing = tested;
    Values next = share(shape, sums, body);
    if (!sums.empty())
      scf::YieldOp::create(b, loc, next);
    // Code for the edges of arrays is not worth the time to optimise it.
    if (tested)
      block->walk([](scf::ForOp loop) { setPlain(loop); });
  }
  return Values(branch.getResults());
}

void TileLowering::elements(Operation *op, ArrayRef<int64_t> shape,
                            function_ref<void(ValueRange)> body) {
  elements(op, shape, {}, [&](ValueRange indices, ValueRange) {
    body(indices);
    return Values();
  });
}

} // namespace warp::tiles
