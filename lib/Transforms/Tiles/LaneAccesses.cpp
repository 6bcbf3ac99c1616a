//===- LaneAccesses.cpp - Tile accesses with an index per thread ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If an offset, or the array, differs between threads, element e of a tile
// is loaded from or stored to where thread e mod B says: a loop over elements.
// If the launch does not have that thread, the element is zero, or dropped.
//
//===----------------------------------------------------------------------===//

#include "AbsentThreads.h"
#include "LaneLoops.h"
#include "LowerTiles.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Transforms/RegionUtils.h"
#include "llvm/ADT/SetVector.h"

using namespace mlir;

namespace warp::tiles {

/// Indices of an element of a tile by its number.
Values LaneLoops::unravel(Value number, ArrayRef<int64_t> shape) {
  Values indices(shape.size());
  for (size_t d = shape.size(); d-- > 1;) {
    indices[d] = builtin("mod", {number, constant(shape[d])});
    number = builtin("floordiv", {number, constant(shape[d])});
  }
  indices[0] = number;
  return indices;
}

/// Indices of the array, and whether they are inside; null if that is promised.
Values LaneLoops::arrayIndices(TileAccessOp op, Lane &lane, Value array,
                               ValueRange indices, Value &inside) {
  Values at;
  for (auto [d, given] : llvm::enumerate(op.getOffsets())) {
    Value offset = laneValue(given, lane), own = indices[d];
    if (op.getPicked() && op.getAxis() == d)
      own = TileGetOp::create(b, loc, tileType(op.getPicked()).getElementType(),
                              sharedValue(op.getPicked()), ValueRange(own));
    bool isWide =
        getByteSize(offset.getType()) > 4 || getByteSize(own.getType()) > 4;
    Type type = b.getIntegerType(isWide ? 64 : 32, /*isSigned=*/true);
    auto cast = [&](Value value) -> Value {
      return value.getType() == type ? value
                                     : CastOp::create(b, loc, type, value);
    };
    at.push_back(builtin("add", {cast(offset), cast(own)}));
    if (!op.getChecked())
      continue;
    Value extent =
        cast(DimOp::create(b, loc, index, array, b.getI64IntegerAttr(d)));
    for (Value test : {builtin("ge", {at.back(), constantOf(type, 0)}),
                       builtin("lt", {at.back(), extent})})
      inside = inside ? arith::AndIOp::create(b, loc, inside, test).getResult()
                      : test;
  }
  return at;
}

/// The result of an access, if it has one; zero outside of the array.
Value LaneLoops::ifInside(Value inside, Type type, function_ref<Value()> make) {
  if (!inside)
    return make();
  auto branch = scf::IfOp::create(b, loc, type ? TypeRange(type) : TypeRange(),
                                  inside, /*withElseRegion=*/bool(type));
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  Value made = make();
  if (!type)
    return nullptr;
  scf::YieldOp::create(b, loc, made);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, makeZero(b, loc, type));
  return branch.getResult(0);
}

/// `access(array, at, indices)` is made for each element; what it gives, if it
/// gives something, is in the tile that is returned.
Value LaneLoops::accessElements(
    TileAccessOp op, bool gives,
    function_ref<Value(Value, ValueRange, ValueRange)> access) {
  TileType type = op.getTileType();
  Values tiles;
  if (gives)
    tiles.push_back(TileEmptyOp::create(b, loc, type));
  int64_t count = type.getNumElements();
  Type element = gives ? type.getElementType() : Type();
  Values made = overElements(
      count, constant(count), tiles,
      [&](Lane &lane, Value number, ValueRange tiles) -> Values {
        Values indices = unravel(number, type.getShape());
        // Elements of a thread that is not there are nowhere.
        Value value = ifInside(isThere(lane), element, [&] {
          Value array = laneValue(op.getArray(), lane), inside;
          Values at = arrayIndices(op, lane, array, indices, inside);
          return ifInside(inside, element,
                          [&] { return access(array, at, indices); });
        });
        if (!gives)
          return {};
        return {TileSetOp::create(b, loc, type, TileUpdate::assign, value,
                                  tiles[0], indices, Value())};
      });
  return gives ? made[0] : Value();
}

void LaneLoops::pickThere(TileAccessOp op) {
  Value picked = op.getPicked();
  if (!present || !picked || !isOfThreads(picked))
    return;
  auto flags = TileType::get(b.getContext(), {threads}, b.getI1Type());
  Value no = ConstantOp::create(b, loc, b.getBoolAttr(false));
  Value yes = ConstantOp::create(b, loc, b.getBoolAttr(true));
  Value none = TileSplatOp::create(b, loc, flags, no);
  Value there = overLanes(threads, none, [&](Lane &lane, ValueRange tiles) {
    return Values{write(yes, tiles[0], lane.number)};
  })[0];
  shared.map(picked, pickedOrNowhere(b, loc, sharedValue(picked), there));
  op.setChecked(true);
}

bool LaneLoops::emitAccess(TileAccessOp op) {
  Type type = op.getTileType().getElementType();
  auto atomic = dyn_cast<TileAtomicOp>(op.getOperation());
  if (atomic && isa<StructType>(type))
    return false;
  bool gives = atomic ? !atomic.getOld().use_empty() : !op.mayWrite();
  Value tile = accessElements(
      op, gives, [&](Value array, ValueRange at, ValueRange indices) -> Value {
        if (!op.mayWrite())
          return LoadOp::create(b, loc, type, array, at);
        Value value = TileGetOp::create(b, loc, type,
                                        sharedValue(op.getWritten()), indices);
        if (atomic)
          return AtomicOp::create(b, loc, type, toAtomic(atomic.getKind()),
                                  value, array, at);
        StoreOp::create(b, loc, value, array, at);
        return Value();
      });
  if (gives)
    shared.map(op->getResult(0), tile);
  return true;
}

LogicalResult LaneLoops::emitWithCaptures(Operation *op, Values operands,
                                          ArrayRef<int64_t> shape) {
  llvm::SetVector<Value> captured;
  getUsedValuesDefinedAbove(op->getRegions(), captured);
  SmallVector<std::pair<Value, Value>> own;
  for (Value value : captured) {
    if (shared.contains(value))
      continue;
    if (!isLane(value)) {
      shared.map(value, sharedValue(value));
      continue;
    }
    if (!isa<TileMapOp>(op) || !isStorable(value))
      return op->emitError(
          "a function of elements uses a value that differs "
          "between the threads of a block, which blocks of a "
          "CPU (enable_cpu_blocks) allow in maps of numbers, vectors, matrices "
          "and structs");
    own.emplace_back(value, spread(value, shape));
  }
  Operation *made = b.clone(*op, shared);
  for (auto [value, tile] : own) {
    operands.push_back(tile);
    Value argument =
        made->getRegion(0).front().addArgument(value.getType(), loc);
    value.replaceUsesWithIf(argument, [&](OpOperand &use) {
      return made->isProperAncestor(use.getOwner());
    });
  }
  made->setOperands(operands);
  return success();
}

} // namespace warp::tiles
