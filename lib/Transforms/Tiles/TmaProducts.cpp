//===- TmaProducts.cpp - Pipelined products with TMA loads ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loop whose factors TMA loads becomes one call, of the library's
// nvidia/TileRings.h. Nothing else is in such a loop, and boxes are equally far
// apart from step to step (PlanLoads.cpp).
//
//===----------------------------------------------------------------------===//

#include "Accumulators.h"

#include "WarpDialect/LibraryOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;

namespace warp::tiles {

/// First stage, tensor map, first row and column, the step of both, and columns
/// of a box.
Values AccumulatorLowering::tmaFactorOf(TileLoadOp load, scf::ForOp loop) {
  Values first = offsetsAt(load, loop, loop.getLowerBound());
  Values second = offsetsAt(
      load, loop, iterationAfter(loop, loop.getLowerBound(), number(1)));
  Value place = addressOfStage(load.getResult(), Value());
  Value map = number(getLayout(load).getTensorMap());
  Values factor{place,
                LibraryCallOp::create(b, loc, TypeRange(place.getType()),
                                      b.getStringAttr("warp_tile_map"), map)
                    .getResult(0)};
  for (Value offset : first)
    factor.push_back(toIndex(offset));
  for (auto [from, to] : llvm::zip_equal(first, second))
    factor.push_back(sub(toIndex(to), toIndex(from)));
  factor.push_back(number(getTmaBoxColumns(load)));
  return factor;
}

void AccumulatorLowering::pipelineTma(scf::ForOp loop) {
  b.setInsertionPoint(loop);
  auto product = *loop.getBody()->getOps<TileMatmulOp>().begin();
  ProductForm form = *getProductForm(product);
  int64_t places = loop->getAttrOfType<IntegerAttr>(attr::stages).getInt();
  Factor x = *getFactor(product.getA(), product.getTransposeA());
  Factor y = *getFactor(product.getB(), !product.getTransposeB());
  TileType type = tileType(product.getResult());
  // The barriers lie behind the places of one factor.
  auto loads = loop.getBody()->getOps<TileLoadOp>();
  TileLoadOp holder = *llvm::find_if(
      loads, [](TileLoadOp load) { return getLayout(load).getBarriers(); });
  Value barriers = addressOfStage(holder.getResult(), number(places));
  Value steps = arith::CeilDivSIOp::create(
      b, loc,
      arith::SubIOp::create(b, loc, loop.getUpperBound(), loop.getLowerBound()),
      loop.getStep());
  Values arguments{accumulatorsOf(product.getResult(), form.slots), barriers,
                   number(places), steps};
  for (const Factor &factor : {x, y})
    arguments.append(
        tmaFactorOf(factor.memory.getDefiningOp<TileLoadOp>(), loop));
  arguments.append(
      {number(type.getShape()[0]), number(type.getShape()[1]),
       number(depthOf(product)), number(pitchOf(x)), number(pitchOf(y)),
       number(type.getNumElements() / form.slots), number(threads)});
  callLibrary("warp_tile_stream_" + form.product, {}, arguments);
}

} // namespace warp::tiles
