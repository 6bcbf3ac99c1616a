//===- RingReduction.cpp - Skewed loops: 32 atomics in place of 1,024 -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In a loop over all pairs, and in its adjoint, every thread adds to element j
// in iteration j. The 32 lanes of a warp run the iterations in lockstep, so
// their atomic updates contend for one address. Where the order of iterations
// is free, lanes are skewed over a tile of 32 iterations, and the sum of an
// iteration is shuffled to the lane that runs it next:
//
//   step      0     1     2        31
//   lane 0    j     j+1   j+2 ...  j+31      after 32 steps lane r holds the
//   lane 1    j+1   j+2   j+3 ...  j         warp's sum for iteration j + r
//   ...                                      and makes one update with it
//
// 32 updates of 32 different elements remain of 1,024. Shuffles need all lanes
// of the warp, with the same tiles: bounds and indices must be the same for all
// threads (lanes compare counters of outer loops that these depend on), and a
// warp with a lane missing runs no tile. The rest runs in the loop as it was:
//
//   end = first + (trips rounded down to tiles; 0 without a full warp)
//   for tile = first to end step 32:
//     sums = none
//     for step = 0 to 32:
//       sums += values that the updates of iteration
//               tile + (lane + step) mod 32 add
//       sums = shuffle sums from lane + 1
//     update the elements of iteration tile + lane with the sums
//   for the rest: the loop as it was
//
// Sums are in memory of the thread, which mem2reg makes registers of, so that
// it does not matter in which branch of an iteration its update is.
// warp-plan-updates has chosen the loops (RingLoop.cpp).
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"
#include "LoopSchedule.h"
#include "RingLoop.h"

#include "Emit/ArrayLowering.h"
#include "Updates/Atomics.h"

using namespace mlir;
using namespace warp;

namespace {

class RingReduction : public LoopSchedule {
public:
  explicit RingReduction(ScheduleSite &site)
      : LoopSchedule(site), ring(loop, site.variant.getFastMath()) {}

  bool applies() override;
  void rewrite() override;
  Description describe(bool) override {
    return {"loop", "ring reduction",
            "lanes are skewed over iterations, sums are shuffled to the next",
            loop};
  }

private:
  /// Has a bit for each lane.
  Type maskType() { return b.getIntegerType(warpSize); }
  Value toMask(Value x) {
    if (x.getType() == maskType())
      return x;
    return arith::ExtUIOp::create(b, loc, maskType(), x);
  }

  /// An update whose sums are shuffled from lane to lane.
  struct Update {
    AtomicComponentsOp op;
    /// Types of the components, with their sign.
    SmallVector<Type> types;
    /// Memory of the thread with the sum of each component.
    SmallVector<Value> slots;
    /// If an iteration may leave the update out: memory with a bit for each
    /// iteration of the tile that did not.
    Value reached;

    bool isConditional() { return !isa<scf::ForOp>(op->getParentOp()); }
  };

  void makeSlots();
  using Values = SmallVector<Value>;
  Values buildTile(Value tile, ValueRange carried);
  Values buildStep(Value tile, Value number, ValueRange carried);
  void accumulate(Update &update, AtomicComponentsOp op, Value offset);
  void publish(Update &update, Value iteration);
  void readUpdates();

  Value bitOr(Value x, Value y) { return arith::OrIOp::create(b, loc, x, y); }
  Value load(Value slot, Type type) {
    return LLVM::LoadOp::create(b, loc, type, slot);
  }
  void store(Value value, Value slot) {
    LLVM::StoreOp::create(b, loc, value, slot);
  }

  RingLoop ring;
  SmallVector<Update> updates;
  /// This lane's number, and that of the next.
  Value lane, next;
};

} // namespace

bool RingReduction::applies() {
  WalkResult planned = loop->walk([](AtomicComponentsOp op) {
    return getUpdate(op).getScope() == UpdateScope::ring
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return planned.wasInterrupted() && ring.qualifies(site.getVariance());
}

void RingReduction::readUpdates() {
  for (AtomicComponentsOp op : ring.updates) {
    Update &update = updates.emplace_back(Update{op, {}, {}, {}});
    for (Leaf leaf : leavesOf(op))
      update.types.push_back(leaf.type);
  }
}

/// At the start of the entry, from where mem2reg takes it away again.
void RingReduction::makeSlots() {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(&site.function.getFunctionBody().front());
  Value one = constant(1);
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  for (Update &update : updates) {
    for (Type type : update.op.getResultTypes())
      update.slots.push_back(
          LLVM::AllocaOp::create(b, loc, pointer, type, one));
    if (update.isConditional())
      update.reached = LLVM::AllocaOp::create(b, loc, pointer, maskType(), one);
  }
}

/// Adds what the update of one iteration adds to this lane's sums.
void RingReduction::accumulate(Update &update, AtomicComponentsOp op,
                               Value offset) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(op);
  for (auto [slot, value, type] :
       llvm::zip_equal(update.slots, op.getComponents(), update.types))
    store(combine(b, loc, op.getKind(), load(slot, value.getType()), value,
                  type, /*anyOrder=*/true),
          slot);
  if (update.isConditional()) {
    Value bit =
        arith::ShLIOp::create(b, loc, constant(maskType(), 1), toMask(offset));
    Value old = load(update.reached, maskType());
    store(bitOr(old, bit), update.reached);
  }
  op->erase();
}

/// One iteration of each lane, then its sums go to the lane before.
RingReduction::Values RingReduction::buildStep(Value tile, Value number,
                                               ValueRange carried) {
  Value offset = bitAnd(add(lane, number), constant(warpSize - 1));
  IRMapping clones;
  clones.map(loop.getInductionVar(), add(tile, widen(offset)));
  clones.map(loop.getRegionIterArgs(), carried);
  for (Operation &op : loop.getBody()->without_terminator())
    b.clone(op, clones);
  for (Update &update : updates) {
    Operation *op = clones.lookup(update.op.getOperation());
    accumulate(update, cast<AtomicComponentsOp>(op), offset);
    for (auto [slot, type] :
         llvm::zip_equal(update.slots, update.op.getResultTypes()))
      store(shuffle(b, loc, ShuffleMode::index, load(slot, type), next), slot);
  }
  SmallVector<Value> sums;
  for (Value sum : loop.getBody()->getTerminator()->getOperands())
    sums.push_back(clones.lookupOrDefault(sum));
  return sums;
}

/// Each lane updates the element of its iteration, if any lane did.
void RingReduction::publish(Update &update, Value iteration) {
  OpBuilder::InsertionGuard guard(b);
  if (update.isConditional()) {
    Value reached = overLanes(b, loc, load(update.reached, maskType()),
                              [&](Value x, Value y) { return bitOr(x, y); });
    Value bit = arith::ShRUIOp::create(b, loc, reached, toMask(lane));
    Value any = arith::TruncIOp::create(b, loc, b.getI1Type(), bit);
    auto branch = scf::IfOp::create(b, loc, any, /*withElseRegion=*/false);
    b.setInsertionPointToStart(branch.thenBlock());
  }
  IRMapping clones;
  clones.map(loop.getInductionVar(), iteration);
  AtomicComponentsOp op = update.op;
  SmallVector<Value> indices, sums;
  for (Value index : op.getIndices())
    indices.push_back(cloneComputation(b, index, *loop, clones));
  for (auto [slot, type] : llvm::zip_equal(update.slots, op.getResultTypes()))
    sums.push_back(load(slot, type));
  AtomicComponentsOp::create(
      b, op.getLoc(), op.getResultTypes(), combiningKind(op.getKind()), sums,
      cloneComputation(b, op.getArray(), *loop, clones), indices);
}

RingReduction::Values RingReduction::buildTile(Value tile, ValueRange carried) {
  for (Update &update : updates) {
    for (auto [slot, type] : llvm::zip_equal(update.slots, update.types))
      store(identity(b, loc, update.op.getKind(), type), slot);
    if (update.isConditional())
      store(constant(maskType(), 0), update.reached);
  }
  auto steps = scf::ForOp::create(b, loc, constant(0), constant(warpSize),
                                  constant(1), carried);
  buildBody(steps, [&](Value number, ValueRange sums) {
    return buildStep(tile, number, sums);
  });
  Value iteration = add(tile, widen(lane));
  for (Update &update : updates)
    publish(update, iteration);
  return Values(steps.getResults());
}

void RingReduction::rewrite() {
  readUpdates();
  makeSlots();
  lane = readGrid(b, loc, GridValue::laneId);
  next = add(lane, constant(1));
  Value end = endOfTiles(ring.compared.getArrayRef(), warpSize);
  if (isNonNegative(loop.getInductionVar(), loop->getBlock()))
    end.getDefiningOp()->setAttr(attr::nonNegative, b.getUnitAttr());
  auto tiles = scf::ForOp::create(
      b, loc, loop.getLowerBound(), end, constant(counterType(), warpSize),
      loop.getInitArgs(), nullptr, loop.getUnsignedCmp());
  buildBody(tiles,
            [&](Value tile, ValueRange sums) { return buildTile(tile, sums); });
  loop.getLowerBoundMutable().assign(end);
  loop.getInitArgsMutable().assign(tiles.getResults());
}

WARP_MAKE_SCHEDULE(RingReduction)
