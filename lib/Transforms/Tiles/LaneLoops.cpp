//===- LaneLoops.cpp - Loops over the threads of a block ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LaneLoops.h"

#include "KernelFunction.h"
#include "WarpDialect/Registry.h"

using namespace mlir;

namespace warp::tiles {

/// Components of a vector or matrix that become columns.
static constexpr int64_t mostColumns = 16;

LaneLoops::LaneLoops(FunctionOpInterface kernel, int64_t threads)
    : kernel(kernel), threads(threads), varying(kernel), b(kernel.getContext()),
      loc(kernel.getLoc()), index(b.getIntegerType(32, /*isSigned=*/true)),
      wide(b.getIntegerType(64, /*isSigned=*/false)) {}

bool LaneLoops::isStorable(Value value) {
  return !isa<ArrayType, TileType>(value.getType()) &&
         isArrayElement(value.getType());
}

Value LaneLoops::constantOf(Type type, int64_t value) {
  return ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
}

Value LaneLoops::builtin(StringRef name, ValueRange operands) {
  return createBuiltin(b, loc, name, operands)->getResult(0);
}

//===----------------------------------------------------------------------===//
// Indices
//===----------------------------------------------------------------------===//

Value LaneLoops::extentOf(int64_t axis) {
  Value extent = LaunchExtentOp::create(b, loc, index, axis);
  return CastOp::create(b, loc, wide, extent);
}

Value LaneLoops::linearIndex(ValueRange indices) {
  Value linear = CastOp::create(b, loc, wide, indices[0]);
  for (auto [axis, i] : llvm::enumerate(indices.drop_front())) {
    Value before = builtin("mul", {linear, extentOf(axis + 1)});
    linear = builtin("add", {before, CastOp::create(b, loc, wide, i)});
  }
  return linear;
}

Value LaneLoops::countThreads() {
  int64_t rank = warp::getVariant(kernel).getRank();
  Value count = extentOf(0);
  for (int64_t axis = 1; axis < rank; ++axis)
    count = builtin("mul", {count, extentOf(axis)});
  return count;
}

Value LaneLoops::indexOf(const Lane &lane, Value first, int64_t axis) {
  if (!isRagged()) {
    Value number = lane.number;
    if (number.getType() != first.getType())
      number = CastOp::create(b, loc, first.getType(), number);
    return builtin("add", {first, number});
  }
  Value number = CastOp::create(b, loc, wide, lane.number);
  Value linear = builtin("add", {firstThread, number});
  int64_t rank = warp::getVariant(kernel).getRank();
  for (int64_t inner = rank - 1; inner > axis; --inner)
    linear = builtin("floordiv", {linear, extentOf(inner)});
  if (axis > 0)
    linear = builtin("mod", {linear, extentOf(axis)});
  return CastOp::create(b, loc, first.getType(), linear);
}

//===----------------------------------------------------------------------===//
// Who does what
//===----------------------------------------------------------------------===//

/// True if threads that agree on the operands may leave an operation to one.
static bool isOnce(Operation *op) {
  if (isa<StoreOp>(op) || isMemoryEffectFree(op) ||
      op->hasTrait<OpTrait::HasRecursiveMemoryEffects>())
    return true;
  auto effects = dyn_cast<MemoryEffectOpInterface>(op);
  return effects && effects.onlyHasEffect<MemoryEffects::Read>();
}

static bool hasTiles(Operation *op) {
  auto result = op->walk([](Operation *inner) {
    return isCollective(inner) || llvm::any_of(inner->getResults(), isTile)
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return result.wasInterrupted();
}

bool LaneLoops::isLaneOp(Operation *op) const {
  if (varying.isBlockNumber(op))
    return false;
  auto result = op->walk([&](Operation *inner) {
    auto differs = [&](Value value) { return isLane(value); };
    return !isOnce(inner) || llvm::any_of(inner->getOperands(), differs) ||
                   llvm::any_of(inner->getResults(), differs)
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return result.wasInterrupted();
}

/// Control flow that threads share, with what they do by themselves inside.
bool LaneLoops::isShared(Operation *op) const {
  if (op->getNumRegions() == 0)
    return false;
  if (hasTiles(op))
    return true;
  auto loop = dyn_cast<scf::ForOp>(op);
  auto differs = [&](Value value) { return isLane(value); };
  if (!loop || differs(loop.getLowerBound()) || differs(loop.getUpperBound()) ||
      differs(loop.getStep()) || !llvm::all_of(loop.getInitArgs(), isStorable))
    return false;
  return llvm::any_of(loop.getOps<TileGetOp>(), [&](TileGetOp get) {
    return llvm::none_of(get.getIndices(), differs);
  });
}

//===----------------------------------------------------------------------===//
// Values of threads
//===----------------------------------------------------------------------===//

static SmallVector<int64_t> columnsOf(Type type) {
  SmallVector<int64_t> shape;
  if (auto vector = dyn_cast<VecType>(type))
    shape = {int64_t(vector.getLength())};
  else if (auto matrix = dyn_cast<MatType>(type))
    shape = {int64_t(matrix.getRows()), int64_t(matrix.getCols())};
  int64_t count = 1;
  for (int64_t extent : shape)
    count *= extent;
  return count > mostColumns ? SmallVector<int64_t>() : shape;
}

TileType LaneLoops::laneType(Type type) const {
  SmallVector<int64_t> shape = columnsOf(type);
  Type element = shape.empty() ? type : getElementScalar(type);
  shape.push_back(threads);
  return TileType::get(b.getContext(), shape, element);
}

Value LaneLoops::read(Value tile, Type type, Value number) {
  Type element = tileType(tile).getElementType();
  Values parts;
  for (auto &component : componentsOf(tileType(tile))) {
    Values indices = llvm::map_to_vector(
        component, [&](int64_t i) -> Value { return constant(i); });
    indices.push_back(number);
    parts.push_back(TileGetOp::create(b, loc, element, tile, indices));
  }
  return element == type ? parts[0]
                         : ConstructOp::create(b, loc, type, parts).getResult();
}

Value LaneLoops::write(Value value, Value tile, Value number) {
  TileType type = tileType(tile);
  bool isWhole = type.getElementType() == value.getType();
  for (auto &component : componentsOf(type)) {
    Values indices = llvm::map_to_vector(
        component, [&](int64_t i) -> Value { return constant(i); });
    Value part = isWhole ? value
                         : ExtractOp::create(b, loc, type.getElementType(),
                                             value, indices)
                               .getResult();
    indices.push_back(number);
    tile = TileSetOp::create(b, loc, type, TileUpdate::assign, part, tile,
                             indices, Value());
  }
  return tile;
}

//===----------------------------------------------------------------------===//
// Loops
//===----------------------------------------------------------------------===//

Values LaneLoops::overLanes(int64_t count, ValueRange tiles, Body body) {
  Value end = present && count == threads ? present : constant(count);
  return overElements(
      count, end, tiles,
      [&](Lane &lane, Value, ValueRange tiles) { return body(lane, tiles); });
}

Values LaneLoops::overElements(int64_t count, Value end, ValueRange tiles,
                               ElementBody body) {
  auto bound = [&](Value value) -> Value {
    return CastOp::create(b, loc, b.getI32Type(), value);
  };
  auto loop = scf::ForOp::create(b, loc, bound(constant(0)), bound(end),
                                 bound(constant(1)), tiles);
  OpBuilder::InsertionGuard guard(b);
  if (tiles.empty())
    b.setInsertionPoint(loop.getBody()->getTerminator());
  else
    b.setInsertionPointToStart(loop.getBody());
  Lane lane;
  Value number = CastOp::create(b, loc, index, loop.getInductionVar());
  lane.number = number;
  if (count > threads)
    lane.number = builtin("mod", {lane.number, constant(threads)});
  lane.values = shared;
  Values made = body(lane, number, loop.getRegionIterArgs());
  if (!tiles.empty())
    scf::YieldOp::create(b, loc, made);
  return Values(loop.getResults());
}

Value LaneLoops::laneValue(Value value, Lane &lane) {
  if (Value found = lane.values.lookupOrNull(value))
    return found;
  Value made;
  if (Value tile = lanes.lookup(value)) {
    made = read(tile, value.getType(), lane.number);
  } else if (auto found = firstIndices.find(value);
             found != firstIndices.end()) {
    made = indexOf(lane, found->second.first, found->second.second);
  } else {
    // Has no effects and nothing that could keep it: computed again.
    Operation *def = value.getDefiningOp();
    for (Value operand : def->getOperands())
      laneValue(operand, lane);
    b.clone(*def, lane.values);
    return lane.values.lookup(value);
  }
  lane.values.map(value, made);
  return made;
}

Value LaneLoops::sharedValue(Value value) {
  if (Value found = shared.lookupOrNull(value))
    return found;
  if (Value tile = lanes.lookup(value))
    return read(tile, value.getType(), constant(0));
  return firstIndices.lookup(value).first;
}

Value LaneLoops::emptyTile(TileType type) {
  if (!present)
    return TileEmptyOp::create(b, loc, type);
  Value zero = makeZero(b, loc, type.getElementType());
  return TileSplatOp::create(b, loc, type, zero);
}

Value LaneLoops::isThere(const Lane &lane) {
  return present ? builtin("lt", {lane.number, present}) : Value();
}

Value LaneLoops::fill(TileType type, int64_t count, Value value) {
  Value empty = emptyTile(type);
  return overLanes(count, empty, [&](Lane &lane, ValueRange tiles) -> Values {
    Value place = lane.number;
    if (count > threads)
      place =
          CastOp::create(b, loc, index,
                         cast<scf::ForOp>(b.getInsertionBlock()->getParentOp())
                             .getInductionVar());
    // As many elements as threads are those of threads that are there.
    Value there = count == threads ? Value() : isThere(lane);
    Value mine = ifInside(there, value.getType(),
                          [&] { return laneValue(value, lane); });
    return {write(mine, tiles[0], place)};
  })[0];
}

Value LaneLoops::laneTile(Value value) {
  if (Value tile = lanes.lookup(value))
    return tile;
  return fill(laneType(value.getType()), threads, value);
}

Value LaneLoops::spread(Value value, ArrayRef<int64_t> shape) {
  TileType type = TileType::get(b.getContext(), shape, value.getType());
  int64_t count = type.getNumElements();
  auto flat = TileType::get(b.getContext(), {count}, value.getType());
  Value tile = fill(flat, count, value);
  return flat == type ? tile
                      : TileReshapeOp::create(b, loc, type, tile).getResult();
}

} // namespace warp::tiles
