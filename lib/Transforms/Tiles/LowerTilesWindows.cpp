//===- LowerTilesWindows.cpp - Loops that may cross the edges of arrays ---===//
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

/// Whether all elements that an operation accesses by itself are inside of
/// their array; null if that is not tested.
void TileLowering::testWindow(Operation *op, Value &inside) {
  auto test = [&](auto access, TileType tile) {
    if (!access.getChecked())
      return;
    for (int64_t d = 0; d < tile.getRank(); ++d) {
      // What is picked is tested one by one.
      if (access.getPicked() && int64_t(access.getAxis()) == d)
        continue;
      Value offset = access.getOffsets()[d];
      Type wide = getByteSize(offset.getType()) > 4 ? b.getI64Type() : i32;
      Value first = cast(offset, wide);
      Value extent =
          cast(DimOp::create(b, loc, b.getIntegerType(32, true),
                             access.getArray(), b.getI64IntegerAttr(d)),
               wide);
      Value length = arith::ConstantOp::create(
          b, loc, b.getIntegerAttr(wide, tile.getShape()[d]));
      Value none = arith::ConstantOp::create(b, loc, b.getIntegerAttr(wide, 0));
      Value low =
          arith::CmpIOp::create(b, loc, arith::CmpIPredicate::sge, first, none);
      Value last = arith::SubIOp::create(b, loc, extent, length);
      Value high =
          arith::CmpIOp::create(b, loc, arith::CmpIPredicate::sle, first, last);
      inside = both(inside, both(low, high));
    }
  };
  if (auto load = dyn_cast<TileLoadOp>(op))
    test(load, tileType(load.getResult()));
  else if (auto store = dyn_cast<TileStoreOp>(op))
    test(store, tileType(store.getTile()));
  else if (auto atomic = dyn_cast<TileAtomicOp>(op))
    test(atomic, tileType(atomic.getTile()));
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

/// Whether an operation, or what is computed in its loop, reads or makes tiles
/// that threads have in registers.
bool TileLowering::touchesStripes(Operation *op) {
  auto isStripe = [](Value tile) {
    return isTile(tile) && tiles::isStriped(tile) && !isReplicated(tile);
  };
  return llvm::any_of(op->getResults(), isStripe) ||
         llvm::any_of(op->getOperands(), [&](Value operand) {
           Operation *def = operand.getDefiningOp();
           return isStripe(operand) || (def && isTile(operand) &&
                                        isInline(def) && touchesStripes(def));
         });
}

Values TileLowering::elements(Operation *op, ArrayRef<int64_t> shape,
                              ValueRange sums, Body body) {
  Value inside;
  if (!isDecided)
    collectTested(op, inside);
  llvm::SaveAndRestore striped(isStriped, touchesStripes(op));
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
    testing = tested;
    Values next = share(shape, sums, body);
    if (!sums.empty())
      scf::YieldOp::create(b, loc, next);
    // What runs at the edges of arrays only is not worth the time that it would
    // take to compile it well.
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
