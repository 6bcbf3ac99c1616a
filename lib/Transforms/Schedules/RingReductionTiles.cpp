//===- RingReductionTiles.cpp - A tile of iterations, skewed over lanes ---===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//   end = first + (trips rounded down to tiles; 0 without a whole warp)
//   for tile = first to end step 32:
//     sums = none
//     for step = 0 to 32:
//       sums += what the updates of iteration tile + (lane + step) % 32 add
//       sums = those of the next lane
//     update the elements of iteration tile + lane with the sums
//   for the rest: the loop as it was
//
// Sums are in memory of the thread, which mem2reg makes registers of, so that
// it does not matter in which branch of an iteration its update is.
//
//===----------------------------------------------------------------------===//

#include "Emit/ArrayLowering.h"
#include "Updates/Atomics.h"
#include "Launch/GpuBlock.h"
#include "Rotation.h"
#include "WarpDialect/Passes.h"

using namespace mlir;
using warp::Rotation;

Rotation::Rotation(scf::ForOp loop, LLVM::LLVMFuncOp entry,
                   const RingLoop &ring)
    : loop(loop), entry(entry), b(loop), loc(loop.getLoc()),
      compared(ring.compared) {
  for (AtomicComponentsOp op : ring.updates) {
    Update &update = updates.emplace_back(Update{op, {}, {}, {}});
    for (warp::Leaf leaf : warp::leavesOf(op))
      update.types.push_back(leaf.type);
  }
}

/// At the start of the entry, from where mem2reg takes it away again.
void Rotation::makeSlots() {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(&entry.getBody().front());
  Value one = constant(1);
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  for (Update &update : updates) {
    for (Type type : update.op.getResultTypes())
      update.slots.push_back(
          LLVM::AllocaOp::create(b, loc, pointer, type, one));
    if (update.isConditional())
      update.reached =
          LLVM::AllocaOp::create(b, loc, pointer, b.getI32Type(), one);
  }
}

/// Adds what the update of one iteration adds to this lane's sums.
void Rotation::accumulate(Update &update, warp::AtomicComponentsOp op,
                          Value offset) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(op);
  for (auto [slot, value, type] :
       llvm::zip_equal(update.slots, op.getComponents(), update.types))
    store(warp::combine(b, loc, op.getKind(), load(slot, value.getType()),
                        value, type, /*anyOrder=*/true),
          slot);
  if (update.isConditional()) {
    Value bit = arith::ShLIOp::create(b, loc, constant(1), offset);
    Value old = load(update.reached, b.getI32Type());
    store(bitOr(old, bit), update.reached);
  }
  op->erase();
}

/// One iteration of each lane, then its sums go to the lane before.
void Rotation::buildStep(Value tile, Value number, ValueRange carried) {
  Value offset = bitAnd(add(lane, number), constant(lanes - 1));
  IRMapping clones;
  clones.map(loop.getInductionVar(), add(tile, widen(offset)));
  clones.map(loop.getRegionIterArgs(), carried);
  for (Operation &op : loop.getBody()->without_terminator())
    b.clone(op, clones);
  for (Update &update : updates) {
    Operation *op = clones.lookup(update.op.getOperation());
    accumulate(update, cast<warp::AtomicComponentsOp>(op), offset);
    for (auto [slot, type] :
         llvm::zip_equal(update.slots, update.op.getResultTypes()))
      store(warp::shuffle(b, loc, warp::ShuffleMode::index, load(slot, type),
                          next),
            slot);
  }
  SmallVector<Value> sums;
  for (Value sum : loop.getBody()->getTerminator()->getOperands())
    sums.push_back(clones.lookupOrDefault(sum));
  scf::YieldOp::create(b, loc, sums);
}

/// An index or array of an update, in the iteration that `clones` says.
Value Rotation::cloneIndex(Value value, IRMapping &clones) {
  Operation *op = value.getDefiningOp();
  if (clones.contains(value) || !op || !loop->isProperAncestor(op))
    return clones.lookupOrDefault(value);
  for (Value operand : op->getOperands())
    clones.map(operand, cloneIndex(operand, clones));
  b.clone(*op, clones);
  return clones.lookup(value);
}

/// Each lane updates the element of its iteration, if any lane did.
void Rotation::publish(Update &update, Value iteration) {
  OpBuilder::InsertionGuard guard(b);
  if (update.isConditional()) {
    Value reached = warp::overLanes(
        b, loc, load(update.reached, b.getI32Type()),
        [&](Value x, Value y) { return bitOr(x, y); });
    Value bit = arith::ShRUIOp::create(b, loc, reached, lane);
    Value any = arith::TruncIOp::create(b, loc, b.getI1Type(), bit);
    auto branch = scf::IfOp::create(b, loc, any, /*withElseRegion=*/false);
    b.setInsertionPointToStart(branch.thenBlock());
  }
  IRMapping clones;
  clones.map(loop.getInductionVar(), iteration);
  warp::AtomicComponentsOp op = update.op;
  SmallVector<Value> indices, sums;
  for (Value index : op.getIndices())
    indices.push_back(cloneIndex(index, clones));
  for (auto [slot, type] : llvm::zip_equal(update.slots, op.getResultTypes()))
    sums.push_back(load(slot, type));
  warp::AtomicComponentsOp::create(b, op.getLoc(), op.getResultTypes(),
                                   warp::combiningKind(op.getKind()), sums,
                                   cloneIndex(op.getArray(), clones), indices);
}

void Rotation::buildTile(Value tile, ValueRange carried) {
  for (Update &update : updates) {
    for (auto [slot, type] : llvm::zip_equal(update.slots, update.types))
      store(warp::identity(b, loc, update.op.getKind(), type), slot);
    if (update.isConditional())
      store(constant(0), update.reached);
  }
  auto steps = scf::ForOp::create(
      b, loc, constant(0), constant(lanes), constant(1), carried,
      [&](OpBuilder &body, Location, Value number, ValueRange sums) {
        OpBuilder::InsertionGuard guard(b);
        b.restoreInsertionPoint(body.saveInsertionPoint());
        buildStep(tile, number, sums);
      });
  Value iteration = add(tile, widen(lane));
  for (Update &update : updates)
    publish(update, iteration);
  scf::YieldOp::create(b, loc, steps.getResults());
}

/// The first iteration that is in no full tile, or that a warp with a lane
/// missing begins with.
Value Rotation::endOfTiles() {
  Value first = loop.getLowerBound(), last = loop.getUpperBound();
  Value any = compare(loop.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                            : arith::CmpIPredicate::slt,
                      first, last);
  Value trips = arith::SubIOp::create(b, loc, last, first);
  trips = bitAnd(trips, constant(counterType(), -lanes));
  Value together = warp::isWarpTogether(b, loc, compared.getArrayRef());
  trips = arith::SelectOp::create(b, loc, bitAnd(any, together), trips,
                                  constant(counterType(), 0));
  Value end = add(first, trips);
  if (warp::isNonNegative(loop.getInductionVar(), loop->getBlock()))
    end.getDefiningOp()->setAttr(warp::attr::nonNegative, b.getUnitAttr());
  return end;
}

void Rotation::run() {
  makeSlots();
  lane = warp::readGrid(b, loc, warp::GridValue::laneId);
  next = add(lane, constant(1));
  Value end = endOfTiles();
  auto tiles = scf::ForOp::create(
      b, loc, loop.getLowerBound(), end, constant(counterType(), lanes),
      loop.getInitArgs(),
      [&](OpBuilder &body, Location, Value tile, ValueRange sums) {
        OpBuilder::InsertionGuard guard(b);
        b.restoreInsertionPoint(body.saveInsertionPoint());
        buildTile(tile, sums);
      },
      loop.getUnsignedCmp());
  loop.getLowerBoundMutable().assign(end);
  loop.getInitArgsMutable().assign(tiles.getResults());
}
