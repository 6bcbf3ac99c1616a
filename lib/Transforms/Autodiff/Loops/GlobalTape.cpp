//===- GlobalTape.cpp - Tape in global memory -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Rank 7 is rank 5 without the bound on trips. How many there are is known
// before the adjoint runs, from a launch that only counts (CountTrips.cpp):
//
//   count    for each thread and loop: offset = total; total += trips
//   runtime  allocates tapes of `total` elements
//   adjoint  for i in 0 .. trips:        tape[offset + i] = state; advance
//            for i in trips - 1 .. 0:    state = tape[offset + i]; reverse
//
// If a condition on floats is met a trip later than it was in the count,
// because the two kernels round differently, the count holds.
//
// A loop in a loop uses its part of the tape again in each iteration of the
// outer one, and counts the most trips of any. If the outer loop itself needs
// values from memory, the inner one does not take part: the count would need a
// tape, too.
//
// A tape is an array with rows of 2^16 elements, because extents have 32 bits.
//
//===----------------------------------------------------------------------===//

#include "LoopReversal.h"
#include "MemoryLog.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp::autodiff;

/// Strides have 32 bits, too.
static constexpr int64_t maxElementBytes = 1 << 14;

bool LoopReversal::fitsGlobalTape(ArrayRef<unsigned> states) {
  return reverse.options.globalTape &&
         !reverse.options.untaped.contains(loop) &&
         llvm::all_of(states, [&](unsigned state) {
           Type type = getStates()[state].getType();
           bool hasSign = !type.isSignlessInteger() || type.isInteger(1);
           return warp::isArrayElement(type) && hasSign &&
                  warp::getByteSize(type) <= maxElementBytes;
         });
}

void LoopReversal::keepTapesOut() {
  for (Operation *inner : reverse.taped)
    if (loop->isProperAncestor(inner))
      reverse.untaped.push_back(inner);
}

namespace {
/// The part of a thread in the tapes of one loop.
struct ThreadTape {
  OpBuilder &b;
  Location loc;
  SmallVector<Value> tapes;
  Value offset;

  SmallVector<Value> indicesOf(Value number);
};
} // namespace

/// Row and column of an iteration.
SmallVector<Value> ThreadTape::indicesOf(Value number) {
  Type type = b.getI64Type();
  if (number.getType() != type)
    number = arith::ExtUIOp::create(b, loc, type, number);
  return getTapeIndices(b, loc, arith::AddIOp::create(b, loc, offset, number));
}

/// Notes the trips for the function that counts; returns them, or as many as
/// there is room for.
static Value noteTrips(OpBuilder &b, Location loc, Value array,
                       ValueRange thread, Value trips) {
  Type type = b.getIntegerType(64, true);
  Value room = warp::LoadOp::create(b, loc, type, array, thread);
  SmallVector<Value> both{room, warp::CastOp::create(b, loc, type, trips)};
  Value most = warp::MaxOp::create(b, loc, TypeRange(type), both)->getResult(0);
  warp::StoreOp::create(b, loc, most, array, thread)
      ->setAttr(warp::attr::taped, b.getUnitAttr());
  Value least =
      warp::MinOp::create(b, loc, TypeRange(type), both)->getResult(0);
  return warp::CastOp::create(b, loc, trips.getType(), least);
}

LogicalResult LoopReversal::recoverFromGlobalTape(scf::ForOp reversed,
                                                  Value trips,
                                                  ArrayRef<unsigned> needed) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(reversed);
  MLIRContext *context = b.getContext();
  int64_t site = reverse.options.logSites() + reverse.taped.size();
  reverse.taped.push_back(loop);
  Type number = b.getIntegerType(64, true);
  Type perThread = ArrayType::get(context, 4, number);
  SmallVector<Type> types(4, b.getIntegerType(32, true));
  auto thread = TidOp::create(b, loc, types);
  trips =
      noteTrips(b, loc, reverse.addHidden(HiddenKind::Trips, site, perThread),
                thread.getResults(), trips);
  reversed.setUpperBound(trips);

  ThreadTape tape{b, loc, {}, nullptr};
  Value offset = LoadOp::create(
      b, loc, number, reverse.addHidden(HiddenKind::Offsets, site, perThread),
      thread.getResults());
  tape.offset = CastOp::create(b, loc, b.getI64Type(), offset);
  for (unsigned state : needed)
    tape.tapes.push_back(reverse.addHidden(
        HiddenKind::Tape, site,
        ArrayType::get(context, 2, getStates()[state].getType())));
  reverse.metrics.tapeBytesPerTrip += bytesOf(needed);

  SmallVector<unsigned> states = closure(needed);
  SmallVector<Value> first = recoverInits(states);
  auto end = advance(
      constant(trips.getType(), 0), trips, states, first, [&](Value count) {
        SmallVector<Value> at = tape.indicesOf(count);
        for (auto [state, array] : llvm::zip(needed, tape.tapes))
          StoreOp::create(b, loc, reverse.recover(getStates()[state]), array,
                          at)
              ->setAttr(attr::taped, b.getUnitAttr());
      });
  if (failed(end))
    return failure();
  startBackwards(reversed, states, *end);
  Value count = bindNumber(reversed, trips);
  b.setInsertionPointAfterValue(count);
  SmallVector<Value> at = tape.indicesOf(count);
  for (auto [state, array] : llvm::zip(needed, tape.tapes)) {
    Type type = getStates()[state].getType();
    placeholders[state].replaceAllUsesWith(
        LoadOp::create(b, loc, type, array, at));
  }
  note(needed, RecoveryRank::GlobalTape, bytesOf(needed));
  return success();
}
