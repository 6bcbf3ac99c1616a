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

/// A loop, its factors and the places of their ring.
struct TileLowering::Ring {
  explicit Ring(scf::ForOp loop)
      : loop(loop), loads(loop.getBody()->getOps<TileLoadOp>()),
        holder(*llvm::find_if(
            loads, [](TileLoadOp load) { return load->hasAttr(attr::ring); })),
        product(*loop.getBody()->getOps<TileMatmulOp>().begin()),
        form(*getProductForm(product)),
        places(loop->getAttrOfType<IntegerAttr>(attr::stages).getInt()),
        team(form.isByWarpgroups() ? 128 : 32) {}

  scf::ForOp loop;
  SmallVector<TileLoadOp> loads;
  /// The barriers lie behind its places.
  TileLoadOp holder;
  TileMatmulOp product;
  ProductForm form;
  /// `team`: threads that have read a place together.
  int64_t places, team;
};

/// That a place is full, or empty.
Value TileLowering::barrierOf(const Ring &ring, Value place, bool empty) {
  TileLoadOp holder = ring.holder;
  Value first = addressOf(memoryOf(holder.getResult()));
  int64_t behind = ring.places * getStageBytes(holder.getResult()) +
                   (empty ? 8 * ring.places : 0);
  Value bytes = add(mul(place, number(8)), number(behind));
  return builtin("add", {first, cast(bytes, first.getType())});
}

void TileLowering::openRing(const Ring &ring) {
  scf::ForOp loop = ring.loop;
  callLibrary("warp_tile_open_ring", {},
              {barrierOf(ring, number(0), false), number(ring.places),
               number(threads / ring.team)});
  callLibrary("warp_tile_publish_copies", {}, {});
  barrier();
  byFirstThread([&] {
    this->loop(ring.places, [&](Value place) {
      Value iteration = iterationAfter(loop, loop.getLowerBound(), place);
      ifHolds(isIteration(loop, iteration), [&] {
        copyBoxes(ring.loads, loop, iteration, place,
                  barrierOf(ring, place, false));
      });
    });
  });
}

/// Multiplies what a place has, and fills that of the step before again.
void TileLowering::stepRing(const Ring &ring) {
  scf::ForOp loop = ring.loop;
  TileMatmulOp product = ring.product;
  Value done = stepsBefore(loop);
  auto placeOfTurn = [&](Value turn) -> Value {
    return arith::RemUIOp::create(b, loc, turn, number(ring.places));
  };
  auto phaseOf = [&](Value turn) -> Value {
    Value round = arith::DivUIOp::create(b, loc, turn, number(ring.places));
    return arith::RemUIOp::create(b, loc, round, number(2));
  };
  callLibrary("warp_tile_await_phase", {},
              {barrierOf(ring, placeOfTurn(done), false), phaseOf(done)});
  multiply(product, sumsOf(product.getResult(), ring.form.slots),
           placeOfTurn(done));
  auto leave = [&](Value turn) {
    callLibrary("warp_tile_leave_place", {},
                {barrierOf(ring, placeOfTurn(turn), true), number(ring.team)});
  };
  if (ring.form.isByWarpgroups())
    callLibrary("warp_tile_await_products", {}, {number(1)});
  else
    leave(done);
  ifHolds(less(number(0), done), [&] {
    Value before = sub(done, number(1)), place = placeOfTurn(before);
    if (ring.form.isByWarpgroups())
      leave(before);
    Value next =
        iterationAfter(loop, loop.getInductionVar(), number(ring.places - 1));
    byFirstThread([&] {
      ifHolds(isIteration(loop, next), [&] {
        callLibrary("warp_tile_await_phase", {},
                    {barrierOf(ring, place, true), phaseOf(before)});
        copyBoxes(ring.loads, loop, next, place, barrierOf(ring, place, false));
      });
    });
  });
}

void TileLowering::lowerRing(scf::ForOp loop) {
  loc = loop.getLoc();
  Ring ring(loop);
  b.setInsertionPoint(loop);
  openRing(ring);
  b.setInsertionPoint(ring.product);
  stepRing(ring);
  b.setInsertionPointAfter(loop);
  if (ring.form.isByWarpgroups())
    callLibrary("warp_tile_await_products", {}, {number(0)});
  barrier();
  callLibrary("warp_tile_close_ring", {},
              {barrierOf(ring, number(0), false), number(ring.places)});
}

} // namespace warp::tiles
