//===- Elements.cpp - Models of elementwise operations --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Accumulators.h"
#include "Models.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

static void lowerMap(TileMapOp op, TileLowering &lowering) {
  ArrayRef<int64_t> shape = tileType(op.getResult(0)).getShape();
  lowering.elements(op, shape, [&](ValueRange indices) {
    Values arguments;
    Block &body = op.getBody().front();
    for (auto [input, argument] :
         llvm::zip_equal(op.getInputs(), body.getArguments())) {
      // A tile that is overwritten unread may have no contents.
      bool isRead = !argument.use_empty();
      arguments.push_back(
          !isTile(input) || !isRead ? input : lowering.element(input, indices));
    }
    Values made = lowering.inlineBody(body, arguments);
    for (auto [result, value] : llvm::zip_equal(op.getResults(), made))
      lowering.store(result, indices, value);
  });
}

//===----------------------------------------------------------------------===//
// Adjoints
//===----------------------------------------------------------------------===//

/// Leaves out what a function of elements computes or gets for nothing, so that
/// loops need not keep it.
static void dropUnused(TileMapOp map, unsigned keptOperand) {
  Block &body = map.getBody().front();
  for (Operation &op : llvm::make_early_inc_range(llvm::reverse(body)))
    if (isOpTriviallyDead(&op))
      op.erase();
  for (unsigned i = map.getNumOperands(); i-- > 0;)
    if (i != keptOperand && body.getArgument(i).use_empty()) {
      body.eraseArgument(i);
      map->eraseOperand(i);
    }
}

namespace {

struct ElementAdjoint : autodiff::TileReverse {
  using TileReverse::TileReverse;
  LogicalResult map(TileMapOp map);
};

} // namespace

LogicalResult ElementAdjoint::map(TileMapOp map) {
  SmallVector<Value> inputs = recover(map.getInputs()), cotangents;
  SmallVector<unsigned> given;
  for (unsigned i = 0; i < map.getNumResults(); ++i)
    if (Value g = take(i)) {
      cotangents.push_back(g);
      given.push_back(i);
    }
  if (given.empty())
    return success();
  SmallVector<unsigned> wanted;
  SmallVector<Type> types;
  ArrayRef<int64_t> shape = typeOf(map.getResult(0)).getShape();
  for (auto [i, input] : llvm::enumerate(map.getInputs()))
    if (wants(input)) {
      wanted.push_back(i);
      auto tile = dyn_cast<TileType>(input.getType());
      types.push_back(
          shaped(shape, autodiff::differentialType(tile ? tile.getElementType()
                                                        : input.getType())));
    }
  if (wanted.empty())
    return success();
  llvm::append_range(inputs, cotangents);
  auto adjoint = TileMapOp::create(b, loc, types, inputs);
  {
    OpBuilder::InsertionGuard guard(b);
    Block *body = b.createBlock(&adjoint.getBody());
    for (Value input : inputs) {
      auto tile = dyn_cast<TileType>(input.getType());
      body->addArgument(tile ? tile.getElementType() : input.getType(), loc);
    }
    Block &primal = map.getBody().front();
    unsigned count = primal.getNumArguments();
    reverse.setRecovered(primal.getArguments(),
                         body->getArguments().take_front(count));
    SmallVector<Value> results;
    auto captures = reverse.inScope([&]() -> LogicalResult {
      if (failed(reverse.replay(primal)))
        return failure();
      for (auto [g, i] :
           llvm::zip_equal(body->getArguments().drop_front(count), given))
        give(primal.getTerminator()->getOperand(i), g);
      if (failed(reverse.reverse(primal)))
        return failure();
      for (unsigned i : wanted)
        results.push_back(reverse.takeCotangentOrZero(primal.getArgument(i)));
      return success();
    });
    if (failed(captures))
      return failure();
    TileYieldOp::create(b, loc, results);
  }
  // The cotangents have the shape of the results.
  dropUnused(adjoint, map.getNumOperands());
  for (auto [i, result] : llvm::zip_equal(wanted, adjoint.getResults())) {
    Value input = map.getInputs()[i];
    give(input, isa<TileType>(input.getType())
                    ? result
                    : overThreads(result,
                                  autodiff::differentialType(input.getType())));
  }
  return success();
}

//===----------------------------------------------------------------------===//
// Models
//===----------------------------------------------------------------------===//

namespace {

struct SplatModel : TileModel<SplatModel, TileSplatOp> {
  bool isElementwise(Operation *) const { return true; }
  bool isCheap(Operation *) const { return true; }
  bool isByOwners(Operation *) const { return true; }
  Value element(Operation *op, TileLowering &, ValueRange) const {
    return cast<TileSplatOp>(op).getValue();
  }
  void lower(Operation *op, TileLowering &lowering) const {
    if (getLayout(op).getStorage() == TileStorage::accumulators)
      AccumulatorLowering(lowering.state).set(op);
    else
      lowering.keep(op);
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    Value g = reverse.take(), value = cast<TileSplatOp>(op).getValue();
    if (g && reverse.wants(value))
      reverse.give(value, reverse.overThreads(
                              g, autodiff::differentialType(value.getType())));
    return success();
  }
};

struct IotaModel : TileModel<IotaModel, TileIotaOp> {
  bool isElementwise(Operation *) const { return true; }
  bool isCheap(Operation *) const { return true; }
  bool isByOwners(Operation *) const { return true; }
  Value element(Operation *op, TileLowering &lowering,
                ValueRange indices) const {
    auto iota = cast<TileIotaOp>(op);
    Value i = lowering.cast(indices[0], iota.getStart().getType());
    Value distance = lowering.builtin("mul", {i, iota.getStep()});
    return lowering.builtin("add", {iota.getStart(), distance});
  }
  void lower(Operation *op, TileLowering &lowering) const { lowering.keep(op); }
  /// Numbers.
  LogicalResult adjoint(Operation *, autodiff::TileReverse &) const {
    return success();
  }
};

struct EmptyModel : TileModel<EmptyModel, TileEmptyOp> {
  void lower(Operation *, TileLowering &) const {}
  /// Nothing.
  LogicalResult adjoint(Operation *, autodiff::TileReverse &) const {
    return success();
  }
};

struct MapModel : TileModel<MapModel, TileMapOp> {
  bool isElementwise(Operation *) const { return true; }
  bool isByOwners(Operation *) const { return true; }
  bool canDistribute(Operation *) const { return true; }
  TileRead getRead(Operation *, OpOperand &) const { return TileRead::Own; }
  bool readsElements(Operation *, OpOperand &) const { return true; }
  SmallVector<unsigned> getReplaceableOperands(Operation *op) const {
    SmallVector<unsigned> operands;
    if (op->getNumResults() == 1)
      for (auto [i, operand] : llvm::enumerate(op->getOperands()))
        if (operand.getType() == op->getResult(0).getType())
          operands.push_back(i);
    return operands;
  }
  Value element(Operation *op, TileLowering &lowering,
                ValueRange indices) const {
    auto map = cast<TileMapOp>(op);
    Values arguments;
    for (Value input : map.getInputs())
      arguments.push_back(isTile(input) ? lowering.element(input, indices)
                                        : input);
    return lowering.inlineBody(map.getBody().front(), arguments)[0];
  }
  void lower(Operation *op, TileLowering &lowering) const {
    Value input = op->getOperand(0);
    bool isSum = getLayout(op).getStorage() == TileStorage::accumulators;
    if (isSum && !input.getDefiningOp<TileSplatOp>())
      AccumulatorLowering(lowering.state).take(cast<TileMapOp>(op));
    else if (isSum)
      AccumulatorLowering(lowering.state).set(op);
    else if (isTile(input) && lowering.buffers.isInRegisters(input) &&
             !isDistributed(input))
      AccumulatorLowering(lowering.state).give(cast<TileMapOp>(op));
    else
      lowerMap(cast<TileMapOp>(op), lowering);
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    return ElementAdjoint(reverse.reverse, op).map(cast<TileMapOp>(op));
  }
};

} // namespace

void attachElements(MLIRContext &context) {
  TileSplatOp::attachInterface<SplatModel>(context);
  TileIotaOp::attachInterface<IotaModel>(context);
  TileEmptyOp::attachInterface<EmptyModel>(context);
  TileMapOp::attachInterface<MapModel>(context);
}

} // namespace warp::tiles
