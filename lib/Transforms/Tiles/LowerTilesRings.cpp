//===- LowerTilesRings.cpp - Products whose factors the engine copies -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Calls of lib/DeviceLib/gpu/TileRings.cpp. Before the loop, the first thread
// asks for as many steps as the rings of both factors have places. Each step
// waits for its own and multiplies; warpgroups begin to, and wait for the
// products of the step before. When all warps, or warpgroups, have those, the
// first thread fills that step's places again. Warps wait for data and for
// room, and never for each other.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"
#include "TileProducts.h"

#include "WarpDialect/LibraryOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::tiles {

/// Asks for the boxes of one step.
void TileLowering::copyBoxes(ArrayRef<TileLoadOp> loads, scf::ForOp loop,
                             Value iteration, Value place, Value full) {
  int64_t bytes = 0;
  for (TileLoadOp load : loads)
    bytes += getStageBytes(load.getResult());
  callLibrary("warp_tile_expect_bytes", {}, {full, number(bytes)});
  for (TileLoadOp load : loads) {
    Values offsets = offsetsAt(load, loop, iteration);
    Value map =
        LibraryCallOp::create(
            b, loc, TypeRange(full.getType()), b.getStringAttr("warp_tile_map"),
            Values{
                number(load->getAttrOfType<IntegerAttr>(attr::map).getInt())})
            .getResult(0);
    ArrayRef<int64_t> shape = tileType(load.getResult()).getShape();
    callLibrary(
        "warp_tile_copy_box", {},
        {placeOf(load.getResult(), place), map, toIndex(offsets[0]),
         toIndex(offsets[1]), number(shape[0]), number(shape[1]),
         number(getBoxColumns(load)),
         number(getByteSize(tileType(load.getResult()).getElementType())),
         full});
  }
}

void TileLowering::lowerRing(scf::ForOp loop) {
  loc = loop.getLoc();
  int64_t places = loop->getAttrOfType<IntegerAttr>(attr::stages).getInt();
  SmallVector<TileLoadOp> loads(loop.getBody()->getOps<TileLoadOp>());
  TileLoadOp holder = *llvm::find_if(
      loads, [](TileLoadOp load) { return load->hasAttr(attr::ring); });
  auto product = *loop.getBody()->getOps<TileMatmulOp>().begin();
  ProductForm form = *getProductForm(product);
  // Threads that have read a place together.
  int64_t team = form.isByWarpgroups() ? 128 : 32;
  Value begin = loop.getLowerBound(), end = loop.getUpperBound(),
        step = loop.getStep();
  auto barrierAt = [&](Value place, bool empty) {
    Value first = addressOf(memoryOf(holder.getResult()));
    int64_t behind =
        places * getStageBytes(holder.getResult()) + (empty ? 8 * places : 0);
    Value bytes = add(mul(place, number(8)), number(behind));
    return builtin("add", {first, cast(bytes, first.getType())});
  };
  auto after = [&](Value iteration, Value turns) -> Value {
    Value distance = arith::MulIOp::create(b, loc, turns, step);
    return arith::AddIOp::create(b, loc, iteration, distance);
  };
  auto isThere = [&](Value iteration) -> Value {
    return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, iteration,
                                 end);
  };
  auto fill = [&](Value iteration, Value place) {
    ifHolds(isThere(iteration), [&] {
      copyBoxes(loads, loop, iteration, place, barrierAt(place, false));
    });
  };

  b.setInsertionPoint(loop);
  callLibrary(
      "warp_tile_open_ring", {},
      {barrierAt(number(0), false), number(places), number(threads / team)});
  callLibrary("warp_tile_publish_copies", {}, {});
  barrier();
  byFirstThread([&] {
    this->loop(places, [&](Value place) { fill(after(begin, place), place); });
  });

  b.setInsertionPoint(product);
  Value done = arith::SubIOp::create(b, loc, loop.getInductionVar(), begin);
  done = arith::DivUIOp::create(b, loc, done, step);
  auto placeOfTurn = [&](Value turn) -> Value {
    return arith::RemUIOp::create(b, loc, turn, number(places));
  };
  auto phaseOf = [&](Value turn) -> Value {
    Value round = arith::DivUIOp::create(b, loc, turn, number(places));
    return arith::RemUIOp::create(b, loc, round, number(2));
  };
  callLibrary("warp_tile_await_phase", {},
              {barrierAt(placeOfTurn(done), false), phaseOf(done)});
  multiply(product, sumsOf(product.getResult(), form.slots), placeOfTurn(done));
  auto leave = [&](Value turn) {
    callLibrary("warp_tile_leave_place", {},
                {barrierAt(placeOfTurn(turn), true), number(team)});
  };
  if (form.isByWarpgroups())
    callLibrary("warp_tile_await_products", {}, {number(1)});
  else
    leave(done);
  ifHolds(less(number(0), done), [&] {
    Value before = sub(done, number(1)), place = placeOfTurn(before);
    if (form.isByWarpgroups())
      leave(before);
    Value next = after(loop.getInductionVar(), number(places - 1));
    byFirstThread([&] {
      ifHolds(isThere(next), [&] {
        callLibrary("warp_tile_await_phase", {},
                    {barrierAt(place, true), phaseOf(before)});
        copyBoxes(loads, loop, next, place, barrierAt(place, false));
      });
    });
  });

  b.setInsertionPointAfter(loop);
  if (form.isByWarpgroups())
    callLibrary("warp_tile_await_products", {}, {number(0)});
  barrier();
  callLibrary("warp_tile_close_ring", {},
              {barrierAt(number(0), false), number(places)});
}

} // namespace warp::tiles
