//===- IndexChecks.cpp - Bounds checks of debug launches ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "IndexChecks.h"

#include "WarpDialect/Registry.h"
#include "WarpDialect/TileOps.h"

#include "mlir/IR/Matchers.h"
#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

/// The values that are indexed and have their check.
static constexpr StringLiteral checkedAttr = "warp.checked";

static bool areKnown(ValueRange indices) {
  return llvm::all_of(indices,
                      [](Value i) { return matchPattern(i, m_Constant()); });
}

/// How reports call a value that is indexed.
static StringRef nameOf(Type type) {
  return isa<warp::MatType>(type)         ? "a matrix"
         : isa<warp::QuatType>(type)      ? "a quaternion"
         : isa<warp::TransformType>(type) ? "a transform"
                                          : "a vector";
}

void warp::checkIndices(OpBuilder &b, Location loc, Type composite,
                        ValueRange indices) {
  if (areKnown(indices))
    return;
  SmallVector<int64_t, 2> extents = getIndexExtents(composite);
  extents.resize(indices.size());
  CheckIndexOp::create(b, loc, indices, extents, nameOf(composite),
                       /*offsets=*/false);
}

static ArrayRef<int64_t> shapeOf(Value tile) {
  return cast<warp::TileType>(tile.getType()).getShape();
}

static Value makeInteger(OpBuilder &b, Location loc, Type type, int64_t value) {
  return warp::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
}

/// Indices of threads that do something, and zero of others.
static SmallVector<Value> ofThose(OpBuilder &b, Location loc, Value where,
                                  ValueRange indices) {
  if (!where)
    return indices;
  return llvm::map_to_vector(indices, [&](Value index) -> Value {
    Value zero = makeInteger(b, loc, index.getType(), 0);
    return warp::createBuiltin(b, loc, "where", {where, index, zero})
        ->getResult(0);
  });
}

static void checkElement(OpBuilder &b, Location loc, Value tile,
                         ValueRange indices, Value where) {
  if (!areKnown(indices))
    warp::CheckIndexOp::create(b, loc, ofThose(b, loc, where, indices),
                               shapeOf(tile), "a tile", /*offsets=*/false);
}

/// Components along the path of a set.
static void checkPath(OpBuilder &b, warp::TileSetOp set) {
  if (!set.getPath())
    return;
  Type type = cast<warp::TileType>(set.getTile().getType()).getElementType();
  SmallVector<Value> all =
      ofThose(b, set.getLoc(), set.getWhere(), set.getComponents());
  ValueRange components = all;
  for (Attribute step : set.getPathAttr()) {
    if (auto field = dyn_cast<StringAttr>(step)) {
      type = warp::getFieldType(type, field);
      continue;
    }
    size_t count = cast<IntegerAttr>(step).getInt();
    warp::checkIndices(b, set.getLoc(), type, components.take_front(count));
    components = components.drop_front(count);
    type = warp::getIndexedType(type, count);
  }
}

/// A part of a tile: from `first` on, `counts` indices that are `steps` apart.
static void checkPart(OpBuilder &b, Location loc, Value tile, ValueRange first,
                      ArrayRef<int64_t> counts, ArrayRef<int64_t> steps) {
  if (areKnown(first))
    return;
  SmallVector<Value> last;
  for (auto [begin, count, step] : llvm::zip_equal(first, counts, steps)) {
    Value length = makeInteger(b, loc, begin.getType(), (count - 1) * step);
    last.push_back(
        warp::createBuiltin(b, loc, "add", {begin, length})->getResult(0));
  }
  for (ValueRange indices : {first, ValueRange(last)})
    warp::CheckIndexOp::create(b, loc, indices, shapeOf(tile), "a tile",
                               /*offsets=*/true);
}

/// A report has four indices.
static void checkTable(OpBuilder &b, warp::TableGetOp get) {
  ValueRange indices = get.getIndices();
  ArrayRef<int64_t> extents = get.getTable().getType().getShape();
  for (; !indices.empty(); indices = indices.drop_front(extents.size())) {
    extents = extents.take_back(indices.size());
    extents = extents.take_front(4);
    if (ValueRange some = indices.take_front(extents.size()); !areKnown(some))
      warp::CheckIndexOp::create(b, get.getLoc(), some, extents, "a table",
                                 /*offsets=*/false);
  }
}

/// True if the operation is one with indices.
static bool insertCheck(Operation *op) {
  using namespace warp;
  OpBuilder b(op);
  Location loc = op->getLoc();
  return llvm::TypeSwitch<Operation *, bool>(op)
      .Case([&](ExtractOp extract) {
        checkIndices(b, loc, extract.getSource().getType(),
                     extract.getIndices());
        return true;
      })
      .Case([&](InsertOp insert) {
        checkIndices(b, loc, insert.getType(), insert.getIndices());
        return true;
      })
      .Case([&](ComponentViewOp view) {
        auto array = cast<ArrayType>(view.getArray().getType());
        if (!view.getField())
          checkIndices(b, loc, array.getElementType(), view.getIndices());
        return true;
      })
      .Case([&](PositionOp position) {
        // In a function of elements they are those of a tile of indices.
        bool isOfTile = isa<TileMapOp>(op->getParentOp());
        CheckIndexOp::create(b, loc, position.getIndex(),
                             int64_t(position.getExtent()),
                             isOfTile ? "a tile" : "an array of the thread",
                             /*offsets=*/false);
        return true;
      })
      .Case([&](TableGetOp get) {
        checkTable(b, get);
        return true;
      })
      .Case([&](TileGetOp get) {
        checkElement(b, loc, get.getTile(), get.getIndices(), Value());
        return true;
      })
      .Case([&](TileSetOp set) {
        checkElement(b, loc, set.getTile(), set.getIndices(), set.getWhere());
        checkPath(b, set);
        return true;
      })
      .Case([&](TileSliceOp slice) {
        checkPart(b, loc, slice.getTile(), slice.getOffsets(),
                  shapeOf(slice.getResult()), slice.getSteps());
        return true;
      })
      .Case([&](TileInsertOp insert) {
        checkPart(b, loc, insert.getTile(), insert.getOffsets(),
                  shapeOf(insert.getPart()), insert.getSteps());
        return true;
      })
      .Default(false);
}

void warp::insertIndexChecks(Operation *module) {
  SmallVector<Operation *> ops;
  module->walk([&](Operation *op) {
    if (!op->hasAttr(checkedAttr))
      ops.push_back(op);
  });
  for (Operation *op : ops)
    if (insertCheck(op))
      op->setAttr(checkedAttr, UnitAttr::get(op->getContext()));
}
