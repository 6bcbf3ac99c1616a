//===- TileBuffers.cpp - Buffer sharing of tiles --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "TileBuffers.h"

#include "KernelFunction.h"
#include "TileProducts.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::tiles {

int64_t getBlockThreads(Operation *kernel) {
  auto threads = kernel->getAttrOfType<IntegerAttr>(warp::attr::blockThreads);
  return threads ? threads.getInt() : 0;
}

LogicalResult
forTileKernel(ModuleOp module,
              function_ref<LogicalResult(FunctionOpInterface, int64_t)> work) {
  FunctionOpInterface kernel = findKernel(module);
  if (!kernel)
    return failure();
  int64_t threads = getBlockThreads(kernel);
  return threads ? work(kernel, threads) : success();
}

bool computesTiles(Operation *op) {
  return op->getName().getDialectNamespace() == "warp" && isTileOp(op);
}

TileLayoutAttr getLayout(Operation *op) {
  auto layout = op->getAttrOfType<TileLayoutAttr>(warp::attr::layout);
  return layout ? layout : TileLayoutAttr::getPacked(op->getContext());
}

TileLayoutAttr getLayout(Value tile) {
  Operation *def = tile.getDefiningOp();
  return def ? getLayout(def) : TileLayoutAttr::getPacked(tile.getContext());
}

void setLayout(Operation *op, TileLayoutAttr layout) {
  if (layout == TileLayoutAttr::getPacked(op->getContext()))
    op->removeAttr(warp::attr::layout);
  else
    op->setAttr(warp::attr::layout, layout);
}

bool isInline(Operation *op) {
  return getLayout(op).getStorage() == TileStorage::inlined;
}

TileRead getRead(OpOperand &use) {
  auto op = dyn_cast<TileOpInterface>(use.getOwner());
  return op ? op.getRead(use) : TileRead::Any;
}

TileRead getAccessRead(TileAccessOp access, OpOperand &use) {
  bool isOwn =
      use.getOperandNumber() == 0 || access.getTileType().getRank() == 1;
  return isOwn ? TileRead::Own : TileRead::Once;
}

int64_t getDeviceVariant(Operation *op) {
  int64_t variant = 0;
  op->getAttrOfType<TileFunctionAttr>(warp::attr::function)
      .getName()
      .getAsInteger(10, variant);
  return variant;
}

Value makeZero(OpBuilder &b, Location loc, Type type) {
  if (isComposite(type))
    return ConstructOp::create(b, loc, type, ValueRange());
  if (auto record = dyn_cast<StructType>(type)) {
    SmallVector<Value> fields;
    for (Type field : record.getFieldTypes())
      fields.push_back(makeZero(b, loc, field));
    return StructCreateOp::create(b, loc, type, fields);
  }
  if (auto array = dyn_cast<ArrayType>(type)) {
    Value nothing = ConstantOp::create(
        b, loc, b.getIntegerAttr(b.getIntegerType(64, false), 0));
    Value none = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(0));
    SmallVector<Value> extents(array.getRank(), none);
    return ArrayAtOp::create(b, loc, type, nothing, extents);
  }
  return ConstantOp::create(b, loc, cast<TypedAttr>(b.getZeroAttr(type)));
}

bool callsForTiles(Operation *op, int64_t threads) {
  auto kernel = dyn_cast<FunctionOpInterface>(op);
  if (!kernel)
    kernel = op->getParentOfType<FunctionOpInterface>();
  return threads == 1 && !getTarget(kernel).isSimt();
}

static void collectReaders(Value tile, llvm::SetVector<Operation *> &readers) {
  for (Operation *user : tile.getUsers()) {
    if (!isInline(user)) {
      readers.insert(user);
      continue;
    }
    for (Value result : user->getResults())
      collectReaders(result, readers);
  }
}

llvm::SetVector<Operation *> getReaders(Value tile) {
  llvm::SetVector<Operation *> readers;
  collectReaders(tile, readers);
  return readers;
}

SmallVector<SmallVector<int64_t>> componentsOf(TileType type) {
  SmallVector<SmallVector<int64_t>> all{{}};
  for (int64_t extent : type.getShape().drop_back()) {
    SmallVector<SmallVector<int64_t>> longer;
    for (auto &prefix : all)
      for (int64_t i = 0; i < extent; ++i) {
        longer.push_back(prefix);
        longer.back().push_back(i);
      }
    all = longer;
  }
  return all;
}

int64_t getTileBytes(TileType type) {
  return type.getNumElements() * getByteSize(type.getElementType());
}

bool isDistributed(Value tile) {
  TileStorage storage = getLayout(tile).getStorage();
  return storage == TileStorage::distributed ||
         storage == TileStorage::replicated;
}

bool isReplicated(Value tile) {
  return getLayout(tile).getStorage() == TileStorage::replicated;
}

std::optional<int64_t> getPitch(Value tile) {
  int64_t pitch = getLayout(tile).getPitch();
  return pitch ? std::optional(pitch) : std::nullopt;
}

int64_t getStageBytes(Value tile) {
  TileType type = tileType(tile);
  std::optional<int64_t> pitch = getPitch(tile);
  return pitch
             ? type.getShape()[0] * *pitch * getByteSize(type.getElementType())
             : getTileBytes(type);
}

int64_t getStagedBytes(Value tile) {
  TileLayoutAttr layout = getLayout(tile);
  // Two barriers of 8 bytes for each stage.
  int64_t barriers = layout.getBarriers() ? 16 : 0;
  return layout.getStages() * (getStageBytes(tile) + barriers);
}

/// Steps of a tile whose elements follow each other row by row.
static SmallVector<int64_t> packedSteps(TileType type) {
  SmallVector<int64_t> steps(type.getRank(), 1);
  for (size_t d = steps.size(); d-- > 1;)
    steps[d - 1] = steps[d] * type.getShape()[d];
  return steps;
}

std::optional<Strided> getStrided(Value tile) {
  Operation *def = tile.getDefiningOp();
  if (!def || !isInline(def)) {
    SmallVector<int64_t> steps = packedSteps(tileType(tile));
    if (std::optional<int64_t> pitch = getPitch(tile))
      steps[0] = *pitch;
    return Strided{tile, steps};
  }
  if (auto reshape = dyn_cast<TileReshapeOp>(def)) {
    std::optional<Strided> source = getStrided(reshape.getTile());
    if (!source || source->steps != packedSteps(tileType(reshape.getTile())))
      return std::nullopt;
    return Strided{source->memory, packedSteps(tileType(tile))};
  }
  auto view = dyn_cast<TileTransposeOp>(def);
  std::optional<Strided> source;
  if (view)
    source = getStrided(view.getTile());
  if (!source)
    return std::nullopt;
  SmallVector<int64_t> steps;
  for (int64_t axis : view.getAxes())
    steps.push_back(source->steps[axis]);
  return Strided{source->memory, steps};
}

TileBuffers::TileBuffers(FunctionOpInterface kernel) {
  kernel->walk<WalkOrder::PreOrder>([&](Operation *op) {
    for (Value result : op->getResults())
      if (isTile(result) && !isInline(op))
        tiles.push_back(result);
    for (Region &region : op->getRegions())
      for (Value argument : region.getArguments())
        if (isTile(argument))
          tiles.push_back(argument);
    if (auto operand = op->getAttrOfType<IntegerAttr>(attr::inPlace))
      tie(op->getResult(0), op->getOperand(operand.getInt()));
    tieRegions(op);
  });
  for (Value tile : tiles)
    classes.insert(tile.getAsOpaquePointer());
  kernel->walk([&](Operation *op) {
    readOffsets(op);
    if (getLayout(op).isInRegisters())
      for (Value result : op->getResults())
        inRegisters.insert(rootOf(result));
  });
}

void TileBuffers::readOffsets(Operation *op) {
  auto offsets = op->getAttrOfType<DenseI64ArrayAttr>(attr::offsets);
  if (!offsets)
    return;
  unsigned next = 0;
  for (Value result : op->getResults())
    if (isTile(result))
      offsetOf[rootOf(result)] = offsets[next++];
}

Value TileBuffers::rootOf(Value tile) const {
  auto leader = classes.findLeader(tile.getAsOpaquePointer());
  return leader == classes.member_end() ? tile
                                        : Value::getFromOpaquePointer(*leader);
}

void TileBuffers::tie(Value a, Value b) {
  if (isTile(a))
    classes.unionSets(a.getAsOpaquePointer(), b.getAsOpaquePointer());
}

void TileBuffers::tieRegions(Operation *op) {
  auto tieAll = [&](ValueRange a, ValueRange b) {
    for (auto [x, y] : llvm::zip_equal(a, b))
      tie(x, y);
  };
  if (auto loop = dyn_cast<scf::ForOp>(op)) {
    tieAll(loop.getInitArgs(), loop.getRegionIterArgs());
    tieAll(loop.getResults(), loop.getRegionIterArgs());
    tieAll(loop.getYieldedValues(), loop.getRegionIterArgs());
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    tieAll(loop.getInits(), loop.getBeforeArguments());
    tieAll(loop.getYieldOp().getOperands(), loop.getBeforeArguments());
    tieAll(loop.getConditionOp().getArgs(), loop.getAfterArguments());
    tieAll(loop.getResults(), loop.getAfterArguments());
  } else if (auto branch = dyn_cast<scf::IfOp>(op)) {
    for (Region *region : {&branch.getThenRegion(), &branch.getElseRegion()})
      if (!region->empty() && branch.getNumResults() != 0)
        tieAll(region->front().getTerminator()->getOperands(),
               branch.getResults());
  }
}

} // namespace warp::tiles
