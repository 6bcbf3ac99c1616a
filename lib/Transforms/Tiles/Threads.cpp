//===- Threads.cpp - Models of exchanges between a tile and threads -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Models.h"

#include "KernelFunction.h"

using namespace mlir;

namespace warp::tiles {

namespace {

struct ThreadLowering : TileLowering {
  using TileLowering::TileLowering;
  void fromThreads(TileFromThreadsOp op);
  void toThreads(TileToThreadsOp op);
};

} // namespace

void ThreadLowering::fromThreads(TileFromThreadsOp op) {
  TileType type = tileType(op.getResult());
  Value number = thread ? thread : this->number(0);
  bool isWhole = type.getElementType() == op.getValue().getType();
  for (auto &component : componentsOf(type)) {
    Values indices, parts;
    for (int64_t i : component) {
      indices.push_back(this->number(i));
      parts.push_back(constant(b.getIntegerType(32, true), i));
    }
    indices.push_back(number);
    Value value = op.getValue();
    if (!isWhole)
      value = ExtractOp::create(b, loc, type.getElementType(), value, parts);
    store(op.getResult(), indices, value);
  }
}

void ThreadLowering::toThreads(TileToThreadsOp op) {
  TileType type = tileType(op.getTile());
  int64_t extent = type.getShape().back();
  Value index = thread ? thread : number(0), exists;
  if (thread && extent < threads)
    exists = less(thread, number(extent));
  Type result = op.getType();
  // Registers of a thread that has one element of the tile.
  state.round = number(0);
  Value value = ifHolds(exists, result, [&]() -> Value {
    Values parts;
    for (auto &component : componentsOf(type)) {
      Values indices;
      for (int64_t i : component)
        indices.push_back(number(i));
      indices.push_back(index);
      parts.push_back(element(op.getTile(), indices));
    }
    if (type.getElementType() == result)
      return parts[0];
    return ConstructOp::create(b, loc, result, parts);
  });
  op.getResult().replaceAllUsesWith(value);
}

namespace {

struct FromThreadsModel : TileModel<FromThreadsModel, TileFromThreadsOp> {
  void lower(Operation *op, TileLowering &lowering) const {
    ThreadLowering(lowering.state).fromThreads(cast<TileFromThreadsOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    Value value = cast<TileFromThreadsOp>(op).getValue();
    if (Value g = reverse.take())
      reverse.give(value, TileToThreadsOp::create(
                              reverse.b, reverse.loc,
                              autodiff::differentialType(value.getType()), g));
    return success();
  }
};

struct ToThreadsModel : TileModel<ToThreadsModel, TileToThreadsOp> {
  /// A thread has the element of its number.
  static bool isOwn(Operation *op) {
    auto kernel = op->getParentOfType<FunctionOpInterface>();
    TileType type = tileType(cast<TileToThreadsOp>(op).getTile());
    return type.getRank() == 1 &&
           type.getNumElements() == getBlockThreads(kernel) &&
           getTarget(kernel).isSimt();
  }
  bool isByOwners(Operation *op) const { return isOwn(op); }
  TileRead getRead(Operation *op, OpOperand &) const {
    return isOwn(op) ? TileRead::Own : TileRead::Any;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    ThreadLowering(lowering.state).toThreads(cast<TileToThreadsOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    Value tile = cast<TileToThreadsOp>(op).getTile();
    if (Value g = reverse.take())
      reverse.give(tile,
                   TileFromThreadsOp::create(reverse.b, reverse.loc,
                                             reverse.cotangentType(tile), g));
    return success();
  }
};

} // namespace

void attachThreads(MLIRContext &context) {
  TileFromThreadsOp::attachInterface<FromThreadsModel>(context);
  TileToThreadsOp::attachInterface<ToThreadsModel>(context);
}

} // namespace warp::tiles
