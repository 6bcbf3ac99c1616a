//===- EmitEntryBatches.cpp - A range of blocks, some at a time -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//   for block in begin .. end      for first in begin .. end, step 16
//     before(block)                  for k in 0 .. count: before(first + k)
//     factor, solve           =>     factor and solve count systems
//     after(block)                   for k in 0 .. count: after(first + k)
//
// Batches.cpp says which kernels are like that.
//
//===----------------------------------------------------------------------===//

#include "Batches.h"
#include "Choices.h"
#include "EntryBuilder.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;
using warp::EntryBuilder;

namespace {

/// Copies of a part's operations, for one block of a batch.
class PartCopy {
public:
  PartCopy(OpBuilder &b, Block *block, IRMapping map,
           const warp::Batches &batches, Value memory)
      : b(b), block(block), map(std::move(map)), batches(batches),
        memory(memory) {}

  /// Copies an operation; pure ones are copied where they are needed.
  void copy(Operation *op) {
    if (warp::isRepeated(op))
      return;
    op->walk([&](Operation *inner) {
      for (Value operand : inner->getOperands())
        need(operand);
    });
    for (auto [old, made] :
         llvm::zip_equal(op->getResults(), b.clone(*op, map)->getResults()))
      if (batches.kept.contains(old))
        warp::StoreComponentsOp::create(b, op->getLoc(), made, placeOf(old),
                                        firstIndex(op->getLoc()));
  }

private:
  void need(Value value) {
    Operation *op = value.getDefiningOp();
    if (!op || op->getBlock() != block || map.contains(value))
      return;
    if (auto place = dyn_cast<warp::BlockMemoryOp>(op)) {
      map.map(value, addressOf(op->getLoc(), place.getOffset()));
      return;
    }
    if (batches.kept.contains(value)) {
      auto load = warp::LoadComponentsOp::create(
          b, op->getLoc(), TypeRange(value.getType()), placeOf(value),
          firstIndex(op->getLoc()));
      map.map(value, load->getResult(0));
      return;
    }
    for (Value operand : op->getOperands())
      need(operand);
    b.clone(*op, map);
  }

  /// A place in the memory of this block.
  Value addressOf(Location loc, int64_t offset) {
    Value first = warp::BlockMemoryOp::create(b, loc, b.getI64Type(), offset);
    return arith::AddIOp::create(b, loc, first, memory);
  }
  /// The place of a number: an array of one element.
  Value placeOf(Value value) {
    Location loc = value.getLoc();
    Type type = value.getType();
    if (type.isInteger())
      type = b.getIntegerType(type.getIntOrFloatBitWidth(), /*isSigned=*/true);
    Value one = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(1));
    return warp::ArrayAtOp::create(
        b, loc, warp::ArrayType::get(b.getContext(), 1, type),
        addressOf(loc, batches.kept.lookup(value)), one);
  }
  Value firstIndex(Location loc) {
    return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(0));
  }

  OpBuilder &b;
  Block *block;
  IRMapping map;
  const warp::Batches &batches;
  /// Bytes from the memory of the batch's first block.
  Value memory;
};

} // namespace

/// The address of a place in the memory of the batch's first block.
Value EntryBuilder::placeInBatch(int64_t offset) {
  Type i64 = b.getI64Type();
  Value memory = warp::BlockMemoryOp::create(b, loc, i64, offset);
  auto type = warp::ArrayType::get(b.getContext(), 1, b.getF32Type());
  Value array = warp::ArrayAtOp::create(b, loc, type, memory,
                                        constant(b.getI32Type(), 1));
  return warp::PointerOp::create(b, loc, i64, array);
}

void EntryBuilder::callForBatch(const SystemCalls &calls,
                                const Batches &batches, Value count) {
  Type i32 = b.getI32Type();
  int64_t scratch = Batches::width * batches.blockBytes;
  auto place = [&](int64_t offset) {
    return placeInBatch(offset < 0 ? 0 : offset);
  };
  Values args{place(calls.out), place(calls.in)};
  bool differentiates = calls.steps & SystemCalls::differentiates;
  if (!differentiates)
    args.push_back(place(calls.sides));
  args.append({place(scratch), constant(i32, batches.blockBytes),
               narrow(count, i32), constant(i32, calls.n)});
  if (differentiates)
    args.push_back(constant(i32, bool(calls.steps & SystemCalls::isUpper)));
  else
    args.append({constant(i32, calls.columns), constant(i32, calls.steps)});
  std::string name = "warp_tile_systems";
  name += differentiates ? "_adjoint" : "";
  name += calls.real.isF32() ? "_f32" : "_f64";
  warp::LibraryCallOp::create(b, loc, TypeRange(), b.getStringAttr(name), args);
}

void EntryBuilder::buildBatches(const Batches &batches, Value begin,
                                Value end) {
  Type i64 = b.getI64Type();
  Value width = constant(i64, Batches::width);
  auto loop = scf::ForOp::create(b, loc, begin, end, width);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  Value first = loop.getInductionVar();
  Value count = arith::MinSIOp::create(b, loc, sub(end, first), width);
  for (const BatchPart &part : batches.parts) {
    if (part.calls) {
      callForBatch(*part.calls, batches, count);
      continue;
    }
    if (llvm::all_of(part.ops, isRepeated))
      continue;
    auto blocks =
        scf::ForOp::create(b, loc, constant(i64, 0), count, constant(i64, 1));
    OpBuilder::InsertionGuard inside(b);
    b.setInsertionPointToStart(blocks.getBody());
    Value number = blocks.getInductionVar();
    // Rows of a launch may be short, so blocks are numbered over all of them.
    Value linear = add(first, number);
    Values indices =
        unravel(index32 ? narrow(linear, b.getI32Type()) : linear, rank);
    IRMapping map;
    for (auto [argument, index] :
         llvm::zip_equal(threads.getIndices(), indices))
      map.map(argument, narrow(index, argument.getType()));
    PartCopy copy(b, threads.getThread(), map, batches,
                  mul(number, constant(i64, batches.blockBytes)));
    for (Operation *op : part.ops)
      copy.copy(op);
  }
}

/// The entry's memory, ranges and notes.
void EntryBuilder::describeBatches(const Batches &batches) {
  entry->setAttr(warp::attr::blockBytes, b.getI64IntegerAttr(batches.bytes));
  // A range has whole batches where a worker gets as much work as this.
  constexpr int64_t mostCost = 16384;
  ScheduleAttr schedule = getSchedule(entry);
  setSchedule(entry, schedule.withCost(std::min(schedule.getCost(), mostCost)));
  noteChoice(entry, "blocks", Twine(Batches::width),
             "their small systems are lanes of vectors");
}
