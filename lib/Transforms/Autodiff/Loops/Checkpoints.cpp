//===- Checkpoints.cpp - Checkpointing of carried values ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Rank 6 keeps the needed values of one segment, as many iterations as a ring
// has slots, and at a few places before it the states from which the loop can
// go on, its checkpoints. Its loop is
//
//   end = trips; stack = [(0, initial state)]
//   while end > 0:
//     (start, state) = top of the stack
//     target = end if end - start <= slots else start + stride
//     for i in start .. target:  ring[i mod slots] = state; advance state
//     if target == end:  reverse the iterations down to max(start, end - ring),
//                        which become `end`; pop when the segment is empty
//     else:              push (target, state)
//
// with one copy of the advancing body and one of the reversing one. With f
// checkpoints free, a range that f + 1 segments cover gets one per segment. A
// longer one is split in f / 2 + 2 parts, so that each part finds half of the
// checkpoints free again, or in two if those would not do for a part even when
// it is halved over and over. With a state of 16 bytes or less an iteration is
// advanced twice for 1500 trips, five times for a million. Should all be in
// use, a segment is reached from the last checkpoint again and again: slower,
// never wrong.
//
//===----------------------------------------------------------------------===//

#include "LoopReversal.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp::autodiff;

namespace {
/// Arithmetic on the numbers of iterations, which are unsigned.
struct Counts {
  OpBuilder &b;
  Location loc;
  Type type;

  Value number(int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  }
  Value add(Value x, Value y) { return arith::AddIOp::create(b, loc, x, y); }
  Value sub(Value x, Value y) { return arith::SubIOp::create(b, loc, x, y); }
  Value min(Value x, Value y) { return arith::MinUIOp::create(b, loc, x, y); }
  Value max(Value x, Value y) { return arith::MaxUIOp::create(b, loc, x, y); }
  Value atMost(Value x, Value y) {
    return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ule, x, y);
  }
  Value equal(Value x, Value y) {
    return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, x, y);
  }
  Value choose(Value condition, Value x, Value y) {
    return arith::SelectOp::create(b, loc, condition, x, y);
  }
  Value stride(Value length, Value free, int64_t ringSlots);
};
} // namespace

/// How far the next checkpoint is from the last, with `free` of them left for
/// `length` iterations.
Value Counts::stride(Value length, Value free, int64_t ringSlots) {
  auto shift = [&](Value x, Value by) -> Value {
    return arith::ShRUIOp::create(b, loc, x, by);
  };
  auto times = [&](Value x, int64_t by) -> Value {
    return arith::MulIOp::create(b, loc, x, number(by));
  };
  Value one = number(1), two = number(2), ring = number(ringSlots);
  Value before = sub(length, one);
  Value half = shift(free, one);
  Value many = add(half, two);
  // The capacity left within the last part, without going below zero.
  Value rest = sub(sub(max(free, one), half), one);
  Value fits = atMost(add(shift(before, rest), one), times(many, ringSlots));
  Value parts = choose(fits, many, two);
  Value even = add(arith::DivUIOp::create(b, loc, before, parts), one);
  return choose(atMost(length, times(add(free, one), ringSlots)), ring,
                max(even, ring));
}

/// Fills the body of the outer loop: `carried` are the end of what is left, the
/// top of the stack and the cotangents. Moves the reverse loop into it.
LogicalResult LoopReversal::fillSegments(scf::ForOp reversed,
                                         ValueRange carried,
                                         const Checkpoints &memory) {
  Value end = carried[0], top = carried[1];
  Counts c{b, loc, end.getType()};
  Value start = load(memory.starts, top)[0];
  start.getDefiningOp()->setAttr(attr::nonNegative, b.getUnitAttr());
  SmallVector<Value> state = load(memory.states, top);

  Value length = c.sub(end, start);
  Value free = c.sub(c.number(memory.checkpointSlots - 1), top);
  Value isLast =
      arith::OrIOp::create(b, loc, c.atMost(length, c.number(memory.ringSlots)),
                           c.equal(free, c.number(0)));
  Value stride = c.stride(length, free, memory.ringSlots);
  Value target = c.choose(isLast, end, c.add(start, stride));
  auto slotOf = [&](Value count) -> Value {
    return arith::AndIOp::create(b, loc, count, c.number(memory.ringSlots - 1));
  };
  auto reached =
      advance(start, target, memory.stateNumbers, state, [&](Value count) {
        Value slot = slotOf(count);
        for (auto [state, ring] : llvm::zip(memory.needed, memory.ring))
          keep(ring, slot, reverse.recover(getStates()[state]));
      });
  if (failed(reached))
    return failure();
  Value above = c.add(top, c.number(1));
  keep(memory.starts, above, target);
  keep(memory.states, above, *reached);

  Value trips =
      c.choose(isLast, c.min(length, c.number(memory.ringSlots)), c.number(0));
  reversed->moveBefore(b.getInsertionBlock(), b.getInsertionPoint());
  reversed.setUpperBound(trips);
  reversed.getInitArgsMutable().assign(carried.drop_front(2));
  Value count = bindNumber(reversed, end);
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointAfterValue(count);
    loadNeeded(memory.needed, memory.ring, slotOf(count));
  }
  skipOthers(reversed, count);
  Value rest = c.sub(end, trips);
  Value isEmpty = c.equal(rest, start);
  Value below = c.choose(isEmpty, c.sub(top, c.number(1)), top);
  SmallVector<Value> next{rest, c.choose(isLast, below, above)};
  llvm::append_range(next, reversed.getResults());
  scf::YieldOp::create(b, loc, next);
  return success();
}

/// Checkpoints without their memory.
LoopReversal::Checkpoints
LoopReversal::planCheckpoints(ArrayRef<unsigned> needed) {
  Checkpoints plan;
  llvm::append_range(plan.needed, needed);
  plan.stateNumbers = closure(needed);
  int64_t bytes = bytesOf(plan.stateNumbers);
  plan.ringSlots = bytes <= 16 ? 32 : bytes <= 64 ? 16 : 8;
  plan.checkpointSlots = bytes <= 16 ? 48 : bytes <= 64 ? 32 : 24;
  return plan;
}

/// Bytes that they take of a thread, with numbers of iterations of a type.
int64_t LoopReversal::checkpointBytes(ArrayRef<unsigned> needed, Type number) {
  Checkpoints plan = planCheckpoints(needed);
  return bytesOf(needed) * plan.ringSlots +
         (bytesOf(plan.stateNumbers) + getByteSize(number)) * plan.stateSlots();
}

FailureOr<SmallVector<Value>>
LoopReversal::recoverFromCheckpoints(scf::ForOp reversed, Value trips,
                                     ArrayRef<unsigned> needed) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(reversed);
  Type type = trips.getType();
  Checkpoints memory = planCheckpoints(needed);
  int64_t slots = memory.stateSlots();
  memory.ring = makeScratch(needed, memory.ringSlots);
  memory.states = makeScratch(memory.stateNumbers, slots);
  memory.starts =
      ScratchOp::create(b, loc, ScratchType::get(b.getContext(), slots, type));
  reverse.metrics.tapeBytes += getByteSize(type) * slots;
  Value zero = constant(type, 0);
  keep(memory.starts, zero, zero);
  keep(memory.states, zero, recoverInits(memory.stateNumbers));

  SmallVector<Value> inits{trips, zero};
  llvm::append_range(inits, reversed.getInitArgs());
  TypeRange types{ValueRange(inits)};
  auto outer = scf::WhileOp::create(b, loc, types, inits);
  SmallVector<Location> locations(inits.size(), loc);
  Block *before = b.createBlock(&outer.getBefore(), {}, types, locations);
  Value isLeft = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne,
                                       before->getArgument(0), zero);
  scf::ConditionOp::create(b, loc, isLeft, before->getArguments());
  Block *after = b.createBlock(&outer.getAfter(), {}, types, locations);
  if (failed(fillSegments(reversed, after->getArguments(), memory)))
    return failure();
  note(needed, RecoveryRank::Checkpoints,
       bytesOf(needed) * memory.ringSlots +
           bytesOf(memory.stateNumbers) * slots);
  return SmallVector<Value>(outer.getResults().drop_front(2));
}
