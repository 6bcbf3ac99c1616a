//===- LowerTilesElements.cpp - Elements of tiles, and of arrays ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

Value TileLowering::arrayAt(int64_t offset, int64_t count, Type element) {
  Value &array = arrays[{offset, count, element.getAsOpaquePointer()}];
  if (array)
    return array;
  Location place = kernel.getLoc();
  Type type = ArrayType::get(b.getContext(), 1, element);
  Value address =
      BlockMemoryOp::create(entry, place, b.getIntegerType(64, false), offset);
  Value extent =
      arith::ConstantOp::create(entry, place, b.getI32IntegerAttr(count));
  array = ArrayAtOp::create(entry, place, type, address, extent);
  return array;
}

Value TileLowering::memoryOf(Value tile) {
  TileType type = tileType(tile);
  return arrayAt(buffers.getOffset(tile),
                 getStagedBytes(tile) / getByteSize(type.getElementType()),
                 type.getElementType());
}

Value TileLowering::linear(ArrayRef<int64_t> shape, ValueRange indices) {
  Value index = indices[0];
  for (size_t d = 1; d < shape.size(); ++d)
    index =
        add(shape[d] == 1 ? index : mul(index, number(shape[d])), indices[d]);
  return index;
}

Values TileLowering::unravel(Value index, ArrayRef<int64_t> shape) {
  Values indices(shape.size());
  for (size_t d = shape.size(); d-- > 1;) {
    Value extent = number(shape[d]);
    indices[d] = arith::RemUIOp::create(b, loc, index, extent);
    index = arith::DivUIOp::create(b, loc, index, extent);
  }
  indices[0] = index;
  return indices;
}

/// Where an element lies.
Value TileLowering::placeIn(Value tile, ValueRange indices) {
  if (std::optional<int64_t> pitch = getPitch(tile))
    return add(mul(indices[0], number(*pitch)), indices[1]);
  return linear(tileType(tile).getShape(), indices);
}

/// What a thread has of a tile in registers.
Value TileLowering::stripeOf(Value tile) {
  Value &stripe = heldSums[buffers.rootOf(tile)];
  TileType type = tileType(tile);
  if (!stripe)
    stripe = ScratchOp::create(
        entry, loc,
        ScratchType::get(b.getContext(),
                         isReplicated(tile) ? 1
                                            : type.getNumElements() / threads,
                         type.getElementType()));
  return stripe;
}

Value TileLowering::placeInStripe(Value tile) {
  return isReplicated(tile) ? number(0) : turn;
}

Value TileLowering::load(Value tile, ValueRange indices) {
  if (tiles::isStriped(tile))
    return ScratchLoadOp::create(b, loc, tileType(tile).getElementType(),
                                 stripeOf(tile), placeInStripe(tile));
  return LoadOp::create(b, loc, tileType(tile).getElementType(), memoryOf(tile),
                        placeIn(tile, indices));
}

void TileLowering::store(Value tile, ValueRange indices, Value value) {
  if (tiles::isStriped(tile)) {
    ScratchStoreOp::create(b, loc, value, stripeOf(tile), placeInStripe(tile));
    return;
  }
  StoreOp::create(b, loc, value, memoryOf(tile), placeIn(tile, indices));
}

//===----------------------------------------------------------------------===//
// Elements that are computed where they are used
//===----------------------------------------------------------------------===//

Value TileLowering::element(Value tile, ValueRange indices) {
  Operation *def = tile.getDefiningOp();
  return def && isInline(def) ? elementOf(def, indices) : load(tile, indices);
}

static Values broadcastIndices(TileType from, ValueRange indices,
                               function_ref<Value()> zero) {
  Values source;
  size_t skipped = indices.size() - from.getRank();
  for (auto [extent, index] :
       llvm::zip_equal(from.getShape(), indices.drop_front(skipped)))
    source.push_back(extent == 1 ? zero() : index);
  return source;
}

Value TileLowering::elementOf(Operation *op, ValueRange indices) {
  return llvm::TypeSwitch<Operation *, Value>(op)
      .Case([&](TileSplatOp splat) { return splat.getValue(); })
      .Case([&](TileIotaOp iota) {
        Value i = cast(indices[0], iota.getStart().getType());
        Value distance = builtin("mul", {i, iota.getStep()});
        return builtin("add", {iota.getStart(), distance});
      })
      .Case([&](TileMapOp map) {
        Values arguments;
        for (Value input : map.getInputs())
          arguments.push_back(isTile(input) ? element(input, indices) : input);
        return inlineBody(map.getBody().front(), arguments)[0];
      })
      .Case([&](TileTransposeOp view) {
        Values source(indices.size());
        for (auto [axis, index] : llvm::zip_equal(view.getAxes(), indices))
          source[axis] = index;
        return element(view.getTile(), source);
      })
      .Case([&](TileReshapeOp view) {
        Value i = linear(tileType(view.getResult()).getShape(), indices);
        return element(view.getTile(),
                       unravel(i, tileType(view.getTile()).getShape()));
      })
      .Case([&](TileBroadcastOp view) {
        return element(view.getTile(),
                       broadcastIndices(tileType(view.getTile()), indices,
                                        [&] { return number(0); }));
      })
      .Case([&](TileSliceOp view) {
        Values source;
        for (auto [offset, step, index] :
             llvm::zip_equal(view.getOffsets(), view.getSteps(), indices))
          source.push_back(add(toIndex(offset), mul(index, number(step))));
        return element(view.getTile(), source);
      })
      .Case([&](TileLoadOp load) { return loadElement(load, indices); });
}

template <typename Op>
Values TileLowering::arrayIndices(Op op, TileType tile, ValueRange indices,
                                  Value &inside) {
  Values found;
  for (int64_t d = 0; d < tile.getRank(); ++d) {
    Value offset = op.getOffsets()[d];
    bool picks = op.getPicked() && int64_t(op.getAxis()) == d;
    Value index = indices[d];
    if (picks)
      index = element(op.getPicked(), ValueRange(indices[d]));
    bool isWide =
        getByteSize(offset.getType()) > 4 || getByteSize(index.getType()) > 4;
    Type type = isWide ? b.getI64Type() : i32;
    Value place = add(cast(offset, type), cast(index, type));
    found.push_back(place);
    if (!op.getChecked() || (!testing && !picks))
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

// For updates, in LowerTilesUpdates.cpp.
template Values TileLowering::arrayIndices(TileAtomicOp, TileType, ValueRange,
                                           Value &);

Value TileLowering::loadElement(TileLoadOp op, ValueRange indices) {
  TileType type = tileType(op.getResult());
  Value inside;
  Values at = arrayIndices(op, type, indices, inside);
  return ifHolds(inside, type.getElementType(), [&]() -> Value {
    return LoadOp::create(b, loc, type.getElementType(), op.getArray(), at);
  });
}

//===----------------------------------------------------------------------===//
// Whole tiles
//===----------------------------------------------------------------------===//

/// What could be computed where it is used, but is used more than once.
void TileLowering::keep(Operation *op) {
  Value result = op->getResult(0);
  elements(op, tileType(result).getShape(), [&](ValueRange indices) {
    store(result, indices, elementOf(op, indices));
  });
}

void TileLowering::lowerMap(TileMapOp op) {
  ArrayRef<int64_t> shape = tileType(op.getResult(0)).getShape();
  elements(op, shape, [&](ValueRange indices) {
    Values arguments;
    Block &body = op.getBody().front();
    for (auto [input, argument] :
         llvm::zip_equal(op.getInputs(), body.getArguments())) {
      // What is overwritten unread may have no contents yet.
      bool isRead = !argument.use_empty();
      arguments.push_back(!isTile(input) || !isRead ? input
                                                    : element(input, indices));
    }
    Values made = inlineBody(body, arguments);
    for (auto [result, value] : llvm::zip_equal(op.getResults(), made))
      store(result, indices, value);
  });
}

void TileLowering::lowerStore(TileStoreOp op) {
  TileType type = tileType(op.getTile());
  elements(op, type.getShape(), [&](ValueRange indices) {
    Value inside;
    Values at = arrayIndices(op, type, indices, inside);
    Value value = element(op.getTile(), indices);
    ifHolds(inside, [&] { StoreOp::create(b, loc, value, op.getArray(), at); });
  });
}

} // namespace warp::tiles
