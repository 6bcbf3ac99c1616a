//===- PartialStage.cpp - Element accesses of warps that lack threads -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// See StageElements.cpp. The threads that are there share the words of the
// stretch from their first element to their last: thread number r of n stores
// words r, r + n, r + 2 n, ... The thread of a word is a quotient by a
// constant, and a bit of the mask says if it is there. In place of a word of a
// missing thread it stores the first word of its own element once more, which
// has no effect and keeps accesses in flight together.
//
//===----------------------------------------------------------------------===//

#include "GpuBlock.h"
#include "StageElements.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

/// Threads that are worth the exchange.
constexpr int64_t fewestLanes = 4;
/// Threads for each that is missing between them. Measured on an H200: with one
/// in 20 missing the exchange of nine words takes half of the time of accesses
/// by each thread, with every other one twice as long.
constexpr int64_t fewestOfMissing = 3;
/// Words of a thread that are in flight together.
constexpr int64_t mostAtOnce = 4;

//===----------------------------------------------------------------------===//
// Groups of threads
//===----------------------------------------------------------------------===//

warp::LaneGroup warp::findGroup(OpBuilder &b, Location loc,
                                const StagedAccesses &staged) {
  LaneGroup group;
  group.lanes = activeLanes(b, loc);
  Type type = group.lanes.getType(), i32 = b.getI32Type();
  auto constant = [&](Type type, int64_t value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  };
  auto narrow = [&](Value value) -> Value {
    return type == i32 ? value : arith::TruncIOp::create(b, loc, i32, value);
  };
  Value lane = staged.lane;
  if (type != i32)
    lane = arith::ExtUIOp::create(b, loc, type, lane);
  Value below = arith::ShLIOp::create(b, loc, constant(type, 1), lane);
  below = arith::SubIOp::create(b, loc, below, constant(type, 1));
  below = arith::AndIOp::create(b, loc, below, group.lanes);
  group.rank = narrow(math::CtPopOp::create(b, loc, below));
  group.size = narrow(math::CtPopOp::create(b, loc, group.lanes));
  Value ones = constant(type, -1);
  Value others = arith::XOrIOp::create(b, loc, group.lanes, ones);
  Value trailing = arith::AndIOp::create(
      b, loc, others, arith::AddIOp::create(b, loc, group.lanes, ones));
  group.first = narrow(math::CtPopOp::create(b, loc, trailing));
  group.end = arith::SubIOp::create(
      b, loc, constant(i32, type.getIntOrFloatBitWidth()),
      narrow(math::CountLeadingZerosOp::create(b, loc, group.lanes)));
  return group;
}

Value warp::isDense(OpBuilder &b, Location loc, const StagedAccesses &staged,
                    const LaneGroup &group, ValueRange pointers,
                    ArrayRef<int64_t> sizes) {
  auto atLeast = [&](Value x, Value y) -> Value {
    return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::uge, x, y);
  };
  auto constant = [&](int64_t value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
  };
  Value span = arith::SubIOp::create(b, loc, group.end, group.first);
  Value missing = arith::SubIOp::create(b, loc, span, group.size);
  missing = arith::MulIOp::create(b, loc, missing, constant(fewestOfMissing));
  Value dense =
      arith::AndIOp::create(b, loc, atLeast(group.size, missing),
                            atLeast(group.size, constant(fewestLanes)));
  if (!staged.inRow)
    return dense;
  for (auto [pointer, size] : llvm::zip_equal(pointers, sizes)) {
    Value start = beginOfRow(b, loc, staged, pointer, size);
    dense = arith::AndIOp::create(b, loc, dense,
                                  agreesInLanes(b, loc, start, group.lanes));
  }
  return dense;
}

//===----------------------------------------------------------------------===//
// PartialStage
//===----------------------------------------------------------------------===//

warp::PartialStage::PartialStage(OpBuilder &b, Location loc,
                                 const StagedAccesses &staged,
                                 const LaneGroup &group, Type element,
                                 Value pointer)
    : b(b), loc(loc), staged(staged), group(group),
      word(getSignless(getElementScalar(element))), bytes(getByteSize(word)),
      count(getComponentCount(element)) {
  // Threads before the first of the group may have no element.
  Value before = arith::SubIOp::create(b, loc, group.first, staged.lane);
  before = arith::MulIOp::create(b, loc, before, constant(count));
  begin = LLVM::GEPOp::create(b, loc, pointer.getType(), word, pointer,
                              ArrayRef<LLVM::GEPArg>(before),
                              LLVM::GEPNoWrapFlags::inbounds);
}

Value warp::PartialStage::constant(int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

/// Addresses of the words of the thread's own slot.
SmallVector<Value> warp::PartialStage::ownSlot() {
  Value place =
      arith::MulIOp::create(b, loc, staged.lane, constant(staged.slotBytes));
  Value slot = LLVM::GEPOp::create(b, loc, staged.slab.getType(), b.getI8Type(),
                                   staged.slab, ArrayRef<LLVM::GEPArg>(place),
                                   LLVM::GEPNoWrapFlags::inbounds);
  SmallVector<Value> words;
  for (int64_t i = 0; i < count; ++i)
    words.push_back(LLVM::GEPOp::create(b, loc, slot.getType(), word, slot,
                                        ArrayRef<LLVM::GEPArg>(int32_t(i)),
                                        LLVM::GEPNoWrapFlags::inbounds));
  return words;
}

/// Moves `number` words of the stretch from `index` on, as many from each other
/// as there are threads. `value` is stored in place of those of the slots.
void warp::PartialStage::moveWords(Value index, int64_t number, Value value) {
  Type type = group.lanes.getType();
  auto add = [&](Value x, Value y) -> Value {
    return arith::AddIOp::create(b, loc, x, y);
  };
  auto mul = [&](Value x, int64_t factor) -> Value {
    return arith::MulIOp::create(b, loc, x, constant(factor));
  };
  Value own =
      mul(arith::SubIOp::create(b, loc, staged.lane, group.first), count);
  SmallVector<std::pair<Value, Value>> moves;
  for (int64_t i = 0; i < number; ++i) {
    if (i > 0)
      index = add(index, group.size);
    Value lane = add(arith::DivUIOp::create(b, loc, index, constant(count)),
                     group.first);
    Value shift = lane;
    if (type != shift.getType())
      shift = arith::ExtUIOp::create(b, loc, type, shift);
    Value isHere = arith::TruncIOp::create(
        b, loc, b.getI1Type(),
        arith::ShRUIOp::create(b, loc, group.lanes, shift));
    Value word = arith::SelectOp::create(b, loc, isHere, index, own);
    lane = arith::SelectOp::create(b, loc, isHere, lane, staged.lane);
    Value memory = LLVM::GEPOp::create(b, loc, begin.getType(), this->word,
                                       begin, ArrayRef<LLVM::GEPArg>(word),
                                       LLVM::GEPNoWrapFlags::inbounds);
    // Slots are further apart than elements.
    Value place =
        add(mul(word, bytes), mul(lane, staged.slotBytes - count * bytes));
    place = add(place, mul(group.first, count * bytes));
    Value slot = LLVM::GEPOp::create(
        b, loc, staged.slab.getType(), b.getI8Type(), staged.slab,
        ArrayRef<LLVM::GEPArg>(place), LLVM::GEPNoWrapFlags::inbounds);
    Value moved = value;
    if (!moved)
      moved = LLVM::LoadOp::create(b, loc, this->word, slot, bytes);
    moves.push_back({moved, memory});
  }
  for (auto [moved, to] : moves)
    LLVM::StoreOp::create(b, loc, moved, to, bytes);
}

/// A thread has `count` words at least, and more where others are missing.
void warp::PartialStage::move(Value value) {
  auto mul = [&](Value x, int64_t factor) -> Value {
    return arith::MulIOp::create(b, loc, x, constant(factor));
  };
  Value span = arith::SubIOp::create(b, loc, group.end, group.first);
  int64_t number = std::min(count, mostAtOnce);
  while (count % number != 0)
    --number;
  auto each = [&](Value first, Value last, int64_t number) {
    auto loop =
        scf::ForOp::create(b, loc, first, last, mul(group.size, number));
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(loop.getBody());
    moveWords(loop.getInductionVar(), number, value);
  };
  Value rest =
      arith::AddIOp::create(b, loc, group.rank, mul(group.size, count));
  each(group.rank, rest, number);
  each(rest, mul(span, count), 1);
}

void warp::PartialStage::store(ValueRange words) {
  for (auto [value, to] : llvm::zip_equal(words, ownSlot()))
    LLVM::StoreOp::create(b, loc, value, to, bytes);
  synchronizeWarp(b, loc, group.lanes);
  move();
  synchronizeWarp(b, loc, group.lanes);
}

void warp::PartialStage::fill(Value value) {
  synchronizeWarp(b, loc, group.lanes);
  move(value);
  synchronizeWarp(b, loc, group.lanes);
}
