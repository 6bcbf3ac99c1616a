//===- ReverseTilesParts.cpp - Adjoints of parts and reductions of tiles --===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "ReverseTiles.h"

#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

namespace warp::autodiff {

//===----------------------------------------------------------------------===//
// Parts
//===----------------------------------------------------------------------===//

/// The part of an element that a path leads to, which has no structs left.
Value TileReverse::partOf(Value element, ArrayAttr path,
                          ValueRange components) {
  for (Attribute step : path) {
    if (auto field = dyn_cast<StringAttr>(step)) {
      element = apply(field.getValue() == "p" ? "transform_get_translation"
                                              : "transform_get_rotation",
                      {element});
      continue;
    }
    size_t count = cast<IntegerAttr>(step).getInt();
    element =
        ExtractOp::create(b, loc, getIndexedType(element.getType(), count),
                          element, components.take_front(count));
    components = components.drop_front(count);
  }
  return element;
}

LogicalResult TileReverse::reverseSet(TileSetOp set) {
  Value g = take();
  if (!g)
    return success();
  Type element = typeOf(g).getElementType();
  SmallVector<Value> at = recover(set.getIndices());
  Value where = recoverOptional(set.getWhere());
  bool assigns = set.getKind() == TileUpdate::assign;
  bool subtracts = set.getKind() == TileUpdate::sub;
  if (!assigns && !subtracts && set.getKind() != TileUpdate::add)
    return op->emitError("an update other than a sum has no derivative");
  SmallVector<Value> components = recover(set.getComponents());
  ArrayAttr path = set.getPathAttr();
  Type type = path ? getPartType(element, path) : element;
  if (wants(set.getValue())) {
    Value part = TileGetOp::create(b, loc, element, g, at);
    if (path)
      part = partOf(part, path, components);
    if (where)
      part = apply("where", {where, part, zeroOf(type)});
    give(set.getValue(), subtracts ? apply("neg", part) : part);
  }
  if (assigns)
    g = TileSetOp::create(b, loc, g.getType(), TileUpdate::assign, zeroOf(type),
                          g, at, components, where, path);
  give(set.getTile(), g);
  return success();
}

Value TileReverse::reverseBroadcast(TileBroadcastOp view, Value g) {
  TileType from = typeOf(view.getTile()), to = typeOf(g);
  if (from.getNumElements() == 1)
    return reshape(reduce(g, std::nullopt), from.getShape());
  SmallVector<int64_t> shape(to.getRank() - from.getRank(), 1);
  llvm::append_range(shape, from.getShape());
  for (int64_t d = to.getRank(); d-- > 0;)
    if (shape[d] == 1 && to.getShape()[d] != 1) {
      SmallVector<int64_t> kept(typeOf(g).getShape());
      kept[d] = 1;
      g = reshape(reduce(g, d), kept);
    }
  return reshape(g, from.getShape());
}

void TileReverse::reverseInsert(TileInsertOp insert, Value g) {
  SmallVector<Value> at = recover(insert.getOffsets());
  TileType part = cotangentType(insert.getPart());
  give(insert.getPart(),
       TileSliceOp::create(b, loc, part, g, at, insert.getSteps()));
  give(insert.getTile(), TileInsertOp::create(b, loc, g.getType(), zeroOf(part),
                                              g, at, insert.getSteps()));
}

LogicalResult TileReverse::reversePart() {
  Value g = take();
  if (!g)
    return success();
  return llvm::TypeSwitch<Operation *, LogicalResult>(op)
      .Case([&](TileTransposeOp view) {
        if (auto product = g.getDefiningOp<TileMatmulOp>();
            product && !product.getC()) {
          give(view.getTile(),
               multiply(product.getB(), product.getA(),
                        !product.getTransposeB(), !product.getTransposeA(),
                        product.getAlpha()));
          return success();
        }
        SmallVector<int64_t> back(view.getAxes().size());
        for (auto [i, axis] : llvm::enumerate(view.getAxes()))
          back[axis] = i;
        give(view.getTile(),
             TileTransposeOp::create(b, loc, cotangentType(view.getTile()), g,
                                     back));
        return success();
      })
      .Case([&](TileReshapeOp view) {
        give(view.getTile(), reshape(g, typeOf(view.getTile()).getShape()));
        return success();
      })
      .Case([&](TileBroadcastOp view) {
        give(view.getTile(), reverseBroadcast(view, g));
        return success();
      })
      .Case([&](TileSliceOp view) {
        Value none = zeroOf(cotangentType(view.getTile()));
        give(view.getTile(),
             TileInsertOp::create(b, loc, none.getType(), g, none,
                                  recover(view.getOffsets()), view.getSteps()));
        return success();
      })
      .Case([&](TileInsertOp insert) {
        reverseInsert(insert, g);
        return success();
      })
      .Case([&](TileGetOp get) {
        Value none = zeroOf(cotangentType(get.getTile()));
        give(get.getTile(),
             TileSetOp::create(b, loc, none.getType(), TileUpdate::add, g, none,
                               recover(get.getIndices()), Value()));
        return success();
      })
      .Case([&](TileGatherOp gather) {
        Value none = zeroOf(cotangentType(gather.getTile()));
        give(gather.getTile(),
             TileScatterOp::create(b, loc, none.getType(), g, none,
                                   reverse.recover(gather.getPositions())));
        return success();
      })
      .Case([&](TileScatterOp scatter) {
        give(scatter.getPart(),
             TileGatherOp::create(b, loc, cotangentType(scatter.getPart()), g,
                                  reverse.recover(scatter.getPositions())));
        give(scatter.getTile(), g);
        return success();
      })
      .Case([&](TileSplatOp splat) {
        if (wants(splat.getValue()))
          give(splat.getValue(),
               overThreads(g, differentialType(splat.getValue().getType())));
        return success();
      })
      .Case([&](TileFromThreadsOp from) {
        give(from.getValue(),
             TileToThreadsOp::create(
                 b, loc, differentialType(from.getValue().getType()), g));
        return success();
      })
      .Case([&](TileToThreadsOp to) {
        give(to.getTile(),
             TileFromThreadsOp::create(b, loc, cotangentType(to.getTile()), g));
        return success();
      })
      .Case([&](TileDiagAddOp add) {
        int64_t n = typeOf(add.getDiagonal()).getShape()[0];
        Value positions = iota(n, n + 1);
        give(add.getTile(), g);
        give(add.getDiagonal(),
             TileGatherOp::create(b, loc, cotangentType(add.getDiagonal()), g,
                                  positions));
        return success();
      })
      .Case([&](TileFftOp fft) {
        give(fft.getTile(), TileFftOp::create(b, loc, g.getType(), g,
                                              unit(!fft.getInverse())));
        return success();
      });
}

//===----------------------------------------------------------------------===//
// Reductions
//===----------------------------------------------------------------------===//

LogicalResult TileReverse::reverseReduce(TileReduceOp reduce) {
  Value g = take();
  if (!g)
    return success();
  Value tile = reduce.getTile();
  ArrayRef<int64_t> shape = typeOf(tile).getShape();
  std::optional<int64_t> axis = reduce.getAxis();
  Value spread = expand(g, shape, axis);
  if (reduce.getKind() == TileReduction::add) {
    give(tile, spread);
    return success();
  }
  Type i32 = b.getIntegerType(32, true);
  Value winner = TileArgReduceOp::create(
      b, loc, getReducedType(typeOf(tile), axis, i32), reduce.getKind(),
      reverse.recover(tile), axis ? b.getI64IntegerAttr(*axis) : IntegerAttr());
  Value place = axis ? numbers(shape, *axis)
                     : reshape(iota(typeOf(tile).getNumElements()), shape);
  Value wins = expand(winner, shape, axis);
  give(tile, map({spread, place, wins}, [&](ValueRange x) {
         return apply("where", {apply("eq", {x[1], x[2]}), x[0],
                                zeroOf(x[0].getType())});
       }));
  return success();
}

LogicalResult TileReverse::reverseScan(TileScanOp scan) {
  if (scan.getKind() != TileReduction::add)
    return refuse();
  if (Value g = take())
    give(scan.getTile(),
         TileScanOp::create(b, loc, g.getType(), TileReduction::add, g,
                            scan.getExclusive(), !scan.getReverse()));
  return success();
}

} // namespace warp::autodiff
