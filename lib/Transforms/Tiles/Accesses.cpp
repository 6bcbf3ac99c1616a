//===- Accesses.cpp - Models of loads and stores of arrays ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Accumulators.h"
#include "KernelFunction.h"
#include "Models.h"
#include "Transforms/Launch/UnrollLoop.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

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
  void keepLoaded(TileLoadOp op);

private:
  void keepRounds(TileLoadOp op, Value first, int64_t rounds);
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

/// Elements from `first` on that are as far apart as there are threads. All are
/// on their way before the first is stored.
void LoadLowering::keepRounds(TileLoadOp op, Value first, int64_t rounds) {
  ArrayRef<int64_t> shape = tileType(op.getResult()).getShape();
  SmallVector<std::pair<Values, Value>> loaded;
  for (int64_t round = 0; round < rounds; ++round) {
    Values indices = unravel(add(first, number(round * threads)), shape);
    Value value = element(op, indices);
    loaded.push_back({std::move(indices), value});
  }
  for (auto &[indices, value] : loaded)
    store(op.getResult(), indices, value);
}

/// Loads a tile to memory by way of the registers of a GPU's threads. LLVM
/// would not load an element before it has stored the one before it, if loads
/// are under a condition or the trips differ between threads.
void LoadLowering::keepLoaded(TileLoadOp op) {
  constexpr int64_t inFlight = 8;
  int64_t count = tileType(op.getResult()).getNumElements(),
          rounds = count / threads, left = count % threads;
  if (rounds < 2 || threads == 1 || touchesDistributed(op) ||
      !getTarget(kernel).isSimt())
    return keep(op);
  int64_t each = std::min(rounds, inFlight), groups = rounds / each;
  // Each thread comes by once.
  elements(op, {threads}, [&](ValueRange) {
    if (groups == 1) {
      keepRounds(op, thread, each);
    } else {
      loop(groups, [&](Value group) {
        Value first = add(mul(group, number(each * threads)), thread);
        keepRounds(op, first, each);
      });
      setRolled(cast<scf::ForOp>(*std::prev(b.getInsertionPoint())));
    }
    int64_t done = groups * each;
    if (done < rounds)
      keepRounds(op, add(thread, number(done * threads)), rounds - done);
    if (left != 0)
      ifHolds(less(thread, number(left)), [&] {
        keepRounds(op, add(thread, number(rounds * threads)), 1);
      });
  });
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
    own.isCopied(load) ? own.copyMatrix(load) : own.keepLoaded(load);
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
