//===- BlockReduce.cpp - Block reductions ---------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One value is combined in two steps of the same kind. Each warp combines its
// values by shuffles, halving the distance; its first lane leaves the result
// in shared memory, one slot per warp. After a barrier the first warp combines
// the slots.
//
// Lanes get one each of several values that are combined in the same way. A
// thread per value then combines what warps have left.
//
//===----------------------------------------------------------------------===//

#include "BlockReduce.h"

#include "Atomics.h"
#include "Launch/GpuBlock.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/ADT/MapVector.h"

using namespace mlir;

warp::BlockReduce::BlockReduce(OpBuilder &b, Location loc, ModuleOp module,
                               int64_t blockDim)
    : b(b), loc(loc), module(module), warpSize(subgroupSizeAt(b)),
      warps(blockDim / warpSize) {
  thread = threadInBlock(b, loc);
  lane = arith::AndIOp::create(b, loc, thread, constant(warpSize - 1));
}

Value warp::BlockReduce::constant(int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

Value warp::BlockReduce::any(Value condition) {
  return holdsAnywhere(b, loc, condition);
}

Value warp::BlockReduce::overWarp(AtomicKind kind, Value value, Type type) {
  for (int64_t distance = warpSize / 2; distance > 0; distance /= 2)
    value = combine(
        b, loc, kind, value,
        shuffle(b, loc, ShuffleMode::down, value, constant(distance)), type);
  return value;
}

Value warp::BlockReduce::reduceOne(const Reduced &reduced) {
  auto [kind, value, identity, type] = reduced;
  value = overWarp(kind, value, type);
  if (warps == 1)
    return value;
  Type element = value.getType();
  auto pointer = LLVM::LLVMPointerType::get(b.getContext(), sharedSpace);
  Value shared =
      makeShared(b, loc, module, LLVM::LLVMArrayType::get(element, warpSize),
                 "block_reduce");
  auto slot = [&](Value number) -> Value {
    return LLVM::GEPOp::create(b, loc, pointer, element, shared,
                               ValueRange(number));
  };
  Value firstLane = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq,
                                          lane, constant(0));
  auto leave = scf::IfOp::create(b, loc, firstLane, /*withElseRegion=*/false);
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(leave.thenBlock());
    Value warp = subgroupOf(b, loc, thread);
    LLVM::StoreOp::create(b, loc, value, slot(warp));
  }
  synchronizeBlock(b, loc);
  // Threads outside the first warp compute along; nobody looks.
  Value inside = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult, lane,
                                       constant(warps));
  Value partial = LLVM::LoadOp::create(b, loc, element, slot(lane));
  partial = arith::SelectOp::create(b, loc, inside, partial, identity);
  return overWarp(kind, partial, type);
}

/// Combines rows of slots, one per warp, in the first one: a thread per slot.
void warp::BlockReduce::overRows(AtomicKind kind, int64_t slots, Type type,
                                 function_ref<Value(Value)> slot) {
  OpBuilder::InsertionGuard guard(b);
  auto loop = scf::ForOp::create(b, loc, thread, constant(slots),
                                 constant(warps * warpSize));
  b.setInsertionPointToStart(loop.getBody());
  Value first = slot(loop.getInductionVar());
  auto load = [&](Value from) -> Value {
    auto pointer = from.getDefiningOp<LLVM::GEPOp>();
    return LLVM::LoadOp::create(b, loc, pointer.getElemType(), from);
  };
  auto rows =
      scf::ForOp::create(b, loc, constant(slots), constant(warps * slots),
                         constant(slots), load(first));
  LLVM::StoreOp::create(b, loc, rows.getResult(0), first);
  b.setInsertionPointToStart(rows.getBody());
  Value number = arith::AddIOp::create(b, loc, loop.getInductionVar(),
                                       rows.getInductionVar());
  Value sum =
      combine(b, loc, kind, rows.getRegionIterArg(0), load(slot(number)), type);
  scf::YieldOp::create(b, loc, sum);
}

SmallVector<Value> warp::BlockReduce::reduceTogether(AtomicKind kind,
                                                     ArrayRef<Value> values,
                                                     Type type) {
  // The results that lanes have after their exchanges, how many of them have
  // the same, and the slot of the first one.
  SmallVector<std::tuple<Value, int64_t, int64_t>> shared;
  SmallVector<int64_t> numbers;
  int64_t slots = 0;
  for (ArrayRef<Value> rest = values; !rest.empty();) {
    ArrayRef<Value> some = rest.take_front(warpSize);
    rest = rest.drop_front(some.size());
    int64_t count = llvm::PowerOf2Ceil(some.size());
    Value total = shareOverLanes(
        b, loc, lane, llvm::to_vector(some),
        [&](Value x, Value y) { return combine(b, loc, kind, x, y, type); });
    shared.emplace_back(total, warpSize / count, slots);
    for (size_t i = 0; i < some.size(); ++i)
      numbers.push_back(slots + i);
    slots += count;
  }
  Type element = values.front().getType();
  auto pointer = LLVM::LLVMPointerType::get(b.getContext(), sharedSpace);
  Value memory = makeShared(b, loc, module,
                            LLVM::LLVMArrayType::get(element, warps * slots),
                            "block_reduce");
  auto slot = [&](Value number) -> Value {
    return LLVM::GEPOp::create(b, loc, pointer, element, memory,
                               ValueRange(number));
  };
  Value warp = subgroupOf(b, loc, thread);
  Value row = arith::MulIOp::create(b, loc, warp, constant(slots));
  for (auto [value, lanes, begin] : shared) {
    Value offset = arith::DivUIOp::create(b, loc, lane, constant(lanes));
    Value number = arith::AddIOp::create(
        b, loc, row, arith::AddIOp::create(b, loc, offset, constant(begin)));
    LLVM::StoreOp::create(b, loc, value, slot(number));
  }
  synchronizeBlock(b, loc);
  if (warps > 1) {
    overRows(kind, slots, type, slot);
    synchronizeBlock(b, loc);
  }
  SmallVector<Value> totals;
  for (int64_t number : numbers)
    totals.push_back(
        LLVM::LoadOp::create(b, loc, element, slot(constant(number))));
  return totals;
}

SmallVector<Value> warp::BlockReduce::reduce(ArrayRef<Reduced> reduced) {
  // Threads without an index come first. Shuffles should wait for the others,
  // but sums of such warps were lost on an H200 where those had run a loop with
  // a call.
  synchronizeWarp(b, loc);
  llvm::MapVector<std::pair<AtomicKind, Type>, SmallVector<unsigned>> alike;
  for (auto [i, one] : llvm::enumerate(reduced))
    alike[{one.kind, one.type}].push_back(i);
  SmallVector<Value> totals(reduced.size());
  for (auto &[how, numbers] : alike) {
    if (numbers.size() == 1) {
      totals[numbers.front()] = reduceOne(reduced[numbers.front()]);
      continue;
    }
    SmallVector<Value> values;
    for (unsigned i : numbers)
      values.push_back(reduced[i].value);
    auto made = reduceTogether(how.first, values, how.second);
    for (auto [i, total] : llvm::zip_equal(numbers, made))
      totals[i] = total;
  }
  return totals;
}
