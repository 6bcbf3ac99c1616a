//===- Accesses.cpp - Models of loads and stores of arrays ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Accumulators.h"
#include "Models.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Loads
//===----------------------------------------------------------------------===//

namespace {

struct LoadLowering : TileLowering {
  using TileLowering::TileLowering;
  Value element(TileLoadOp op, ValueRange indices);
  bool isCopied(TileLoadOp op);
  void copyMatrix(TileLoadOp op);
};

} // namespace

Value LoadLowering::element(TileLoadOp op, ValueRange indices) {
  Type type = op.getTileType().getElementType();
  Value inside;
  Values at = arrayIndices(op, indices, inside);
  return ifHolds(inside, type, [&]() -> Value {
    return LoadOp::create(b, loc, type, op.getArray(), at);
  });
}

/// True if a matrix that is loaded comes by asynchronous copies: all of them
/// are on their way at once, and pass by the registers. Rows that are no
/// multiples of 16 bytes come element by element, still without a wait.
bool LoadLowering::isCopied(TileLoadOp op) {
  TileType type = tileType(op.getResult());
  return getPitch(op.getResult()) && !op.getPicked() &&
         type.getElementType().isF32() &&
         type.getNumElements() >= 4 * threads &&
         llvm::all_of(op.getOffsets(), [](Value offset) {
           return getByteSize(offset.getType()) <= 4;
         });
}

/// The first barrier after a load and before all of its uses.
static BarrierOp barrierAfter(TileLoadOp load) {
  Block *block = load->getBlock();
  for (Operation *op = load->getNextNode(); op; op = op->getNextNode())
    if (auto barrier = dyn_cast<BarrierOp>(op))
      return llvm::all_of(load.getResult().getUsers(),
                          [&](Operation *user) {
                            Operation *there =
                                block->findAncestorOpInBlock(*user);
                            return there && barrier->isBeforeInBlock(there);
                          })
                 ? barrier
                 : BarrierOp();
  return BarrierOp();
}

void LoadLowering::copyMatrix(TileLoadOp op) {
  Values arguments{addressOf(memoryOf(op.getResult()))};
  arguments.append(windowOf(op, op.getArray(), op.getOffsets()));
  arguments.push_back(number(*getPitch(op.getResult())));
  arguments.push_back(number(threads));
  callLibrary("warp_tile_fetch_b32", {}, arguments);
  callLibrary("warp_tile_close_group", {}, {});
  OpBuilder::InsertionGuard guard(b);
  if (BarrierOp barrier = barrierAfter(op))
    b.setInsertionPoint(barrier);
  callLibrary("warp_tile_await_groups", {}, {number(0)});
}

//===----------------------------------------------------------------------===//
// Stores
//===----------------------------------------------------------------------===//

static void lowerStore(TileStoreOp op, TileLowering &lowering) {
  lowering.elements(op, op.getTileType().getShape(), [&](ValueRange indices) {
    Value inside;
    Values at = lowering.arrayIndices(op, indices, inside);
    Value value = lowering.element(op.getTile(), indices);
    lowering.ifHolds(inside, [&] {
      StoreOp::create(lowering.b, lowering.loc, value, op.getArray(), at);
    });
  });
}

//===----------------------------------------------------------------------===//
// Models
//===----------------------------------------------------------------------===//

namespace {

struct LoadModel : TileModel<LoadModel, TileLoadOp> {
  bool isElementwise(Operation *) const { return true; }
  bool isByOwners(Operation *) const { return true; }
  bool canDistribute(Operation *) const { return true; }
  Value element(Operation *op, TileLowering &lowering,
                ValueRange indices) const {
    return LoadLowering(lowering.state).element(cast<TileLoadOp>(op), indices);
  }
  void lower(Operation *op, TileLowering &lowering) const {
    LoadLowering own(lowering.state);
    auto load = cast<TileLoadOp>(op);
    own.isCopied(load) ? own.copyMatrix(load) : own.keep(load);
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto load = cast<TileLoadOp>(op);
    if (Value g = reverse.take())
      TileAtomicOp::create(reverse.b, reverse.loc, g.getType(), TileUpdate::add,
                           g, reverse.reverse.gradOf(load.getArray()),
                           reverse.recover(load.getOffsets()),
                           reverse.recoverOptional(load.getPicked()),
                           load.getAxis(), load.getChecked());
    return success();
  }
};

struct StoreModel : TileModel<StoreModel, TileStoreOp> {
  bool isByOwners(Operation *) const { return true; }
  TileRead getRead(Operation *op, OpOperand &use) const {
    return getAccessRead(cast<TileStoreOp>(op), use);
  }
  bool readsElements(Operation *, OpOperand &use) const {
    return use.getOperandNumber() == 0;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto store = cast<TileStoreOp>(op);
    if (lowering.buffers.isInRegisters(store.getTile()) &&
        !isDistributed(store.getTile()))
      AccumulatorLowering(lowering.state).storeTile(store);
    else
      lowerStore(store, lowering);
  }
  /// Takes the gradient, and leaves zero.
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto store = cast<TileStoreOp>(op);
    if (!reverse.reverse.getActivity().isActiveArray(store.getArray()) ||
        !autodiff::differentialType(store.getTile().getType()))
      return success();
    TileType type = reverse.cotangentType(store.getTile());
    if (reverse.wants(store.getTile()))
      reverse.give(store.getTile(), reverse.loadGradient(store));
    TileStoreOp::create(reverse.b, reverse.loc, reverse.zeroOf(type),
                        reverse.reverse.gradOf(store.getArray()),
                        reverse.recover(store.getOffsets()),
                        reverse.recoverOptional(store.getPicked()),
                        store.getAxis(), store.getChecked());
    return success();
  }
};

} // namespace

void attachAccesses(MLIRContext &context) {
  TileLoadOp::attachInterface<LoadModel>(context);
  TileStoreOp::attachInterface<StoreModel>(context);
}

} // namespace warp::tiles
