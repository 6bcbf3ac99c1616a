//===- SplitReduction.cpp - Split-K: a reduction over warps of a block ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch of few threads with a long loop each leaves most of a card idle.
// Where the loop adds up and the order is open, as many threads as a block has
// warps share one index: thread (i, s) of a block runs the s-th part of the
// iterations, the parts come together in the memory of the block, and thread
// (i, 0) goes on with their sum:
//
//   for j in part s of range(n): sum += f(i, j)
//   slab[s][i] = sum          (the block waits)
//   if s = 0: sum = slab[0][i] + slab[1][i] + ...; the rest of the kernel
//
// Threads beyond the last index go through all that with the last one, up to
// the rest of the kernel. The sum is the same in every run.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "Choices.h"
#include "Launch/EntryBuilder.h"
#include "Launch/LoopSums.h"
#include "Updates/Atomics.h"

#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;
using warp::EntryBuilder;

/// Bytes of block memory, and iterations that are worth a part.
constexpr int64_t mostBytes = 40 * 1024, fewestTrips = 512;

int64_t warp::countParts(Operation *kernel) {
  int64_t warps =
      warp::getVariant(kernel).getBlock() / warp::warpSize;
  return warps <= 8 ? warps : 0;
}

/// Whether an operation, with all in it, does nothing to memory but load.
static bool onlyLoads(Operation &op) {
  return !op.walk([](Operation *inner) {
              bool simple =
                  isa<warp::LoadComponentsOp>(inner) ||
                  inner->hasTrait<OpTrait::HasRecursiveMemoryEffects>() ||
                  isMemoryEffectFree(inner);
              return simple ? WalkResult::advance() : WalkResult::interrupt();
            })
              .wasInterrupted();
}

static bool isShort(scf::ForOp loop) {
  APInt first, last;
  return matchPattern(loop.getLowerBound(), m_ConstantInt(&first)) &&
         matchPattern(loop.getUpperBound(), m_ConstantInt(&last)) &&
         last.getSExtValue() - first.getSExtValue() < fewestTrips;
}

/// The first loop of a kernel, if its iterations can be shared: it only loads
/// and adds up, and so does what is before it.
scf::ForOp EntryBuilder::findSplitLoop() {
  int64_t parts = countParts(kernel);
  if (rank != 1 || flat || !index32 || threads.getNumResults() != 0 ||
      variant.getDebug() || parts < 2 ||
      !variant.hasWholeWarps())
    return {};
  for (Operation &op : threads.getThread()->without_terminator()) {
    if (!onlyLoads(op))
      return {};
    auto loop = dyn_cast<scf::ForOp>(op);
    if (!loop) {
      if (op.walk([](LoopLikeOpInterface) { return WalkResult::interrupt(); })
              .wasInterrupted())
        return {};
      continue;
    }
    // A loop may hand on arrays, too.
    auto isWide = [](Type type) {
      return type.isIntOrFloat() && type.getIntOrFloatBitWidth() % 32 == 0;
    };
    if (!llvm::all_of(loop.getResultTypes(), isWide))
      return {};
    int64_t bytes = 0;
    for (Type type : loop.getResultTypes())
      bytes += parts * warp::warpSize * type.getIntOrFloatBitWidth() / 8;
    warp::ThreadVariance variance(kernel);
    bool fits = loop.getNumResults() > 0 && bytes <= mostBytes &&
                !loop.getUnsignedCmp() && !isShort(loop) &&
                matchPattern(loop.getStep(), m_One()) &&
                isa<IntegerType>(loop.getInductionVar().getType()) &&
                variance.isUniform(loop.getUpperBound(), Scope::Launch) &&
                variance.isUniform(loop.getLowerBound(), Scope::Launch) &&
                warp::carriesSums(loop, variant.getFastMath());
    return fits ? loop : scf::ForOp();
  }
  return {};
}

/// The part of a range that is number `part` of `parts`: multiples of a warp.
static std::pair<Value, Value> partOf(OpBuilder &b, Location loc, Value first,
                                      Value last, Value part, int64_t parts) {
  Type i64 = b.getI64Type(), type = first.getType();
  auto constant = [&](int64_t value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(value));
  };
  auto widen = [&](Value value) -> Value {
    if (value.getType() == i64)
      return value;
    return arith::ExtSIOp::create(b, loc, i64, value);
  };
  Value begin = widen(first);
  Value trips = arith::SubIOp::create(b, loc, widen(last), begin);
  trips = arith::MaxSIOp::create(b, loc, trips, constant(0));
  int64_t unit = parts * warp::warpSize;
  Value size = arith::AddIOp::create(b, loc, trips, constant(unit - 1));
  size = arith::DivUIOp::create(b, loc, size, constant(unit));
  size = arith::MulIOp::create(b, loc, size, constant(warp::warpSize));
  Value from = arith::MulIOp::create(b, loc, size, widen(part));
  Value to = arith::AddIOp::create(b, loc, from, size);
  auto place = [&](Value trip) -> Value {
    trip = arith::MinSIOp::create(b, loc, trip, trips);
    Value counter = arith::AddIOp::create(b, loc, begin, trip);
    if (type == i64)
      return counter;
    return arith::TruncIOp::create(b, loc, type, counter);
  };
  return {place(from), place(to)};
}

/// Adds up the sums of all parts, for the threads of the first.
SmallVector<Value> EntryBuilder::joinParts(ValueRange sums, Value lane,
                                           Value part, Value isFirst,
                                           int64_t parts) {
  int64_t bytes = 0;
  SmallVector<int64_t> starts;
  for (Value sum : sums) {
    starts.push_back(bytes);
    bytes += parts * warp::warpSize * sum.getType().getIntOrFloatBitWidth() / 8;
  }
  auto type = LLVM::LLVMArrayType::get(b.getI8Type(), bytes);
  Value slab = warp::makeShared(b, loc, kernel->getParentOfType<ModuleOp>(),
                                type, "loop_parts");
  auto address = [&](size_t i, Value number) -> Value {
    Value start = LLVM::GEPOp::create(
        b, loc, slab.getType(), b.getI8Type(), slab,
        ArrayRef<LLVM::GEPArg>(int32_t(starts[i])));
    return LLVM::GEPOp::create(b, loc, slab.getType(), sums[i].getType(),
                               start, ArrayRef<LLVM::GEPArg>(number));
  };
  Type i32 = b.getI32Type();
  Value own = add(lane, mul(part, constant(i32, warp::warpSize)));
  for (auto [i, sum] : llvm::enumerate(sums))
    LLVM::StoreOp::create(b, loc, sum, address(i, own));
  warp::synchronizeBlock(b, loc);
  auto first = scf::IfOp::create(b, loc, isFirst, /*withElseRegion=*/false);
  b.setInsertionPointToStart(first.thenBlock());
  Values totals(sums);
  for (int64_t other = 1; other < parts; ++other) {
    Value number = add(lane, constant(i32, other * warp::warpSize));
    for (auto [i, total] : llvm::enumerate(totals)) {
      Type word = total.getType();
      Value term = LLVM::LoadOp::create(b, loc, word, address(i, number));
      total = isa<FloatType>(word)
                  ? arith::AddFOp::create(b, loc, total, term).getResult()
                  : arith::AddIOp::create(b, loc, total, term).getResult();
    }
  }
  return totals;
}

EntryBuilder::Values EntryBuilder::buildSplit() {
  int64_t parts = countParts(kernel);
  Type i32 = b.getI32Type();
  Value lane = warp::readGrid(b, loc, warp::GridValue::threadId);
  Value part =
      warp::readGrid(b, loc, warp::GridValue::threadId, warp::Axis::y);
  Value block = warp::readGrid(b, loc, warp::GridValue::blockId);
  Value index = add(mul(block, constant(i32, warp::warpSize)), lane);
  Value exists = cmp(arith::CmpIPredicate::slt, index, dims[0]);
  Value last = sub(dims[0], constant(i32, 1));
  Value isPartZero =
      cmp(arith::CmpIPredicate::eq, part, constant(i32, 0));
  Value isFirst = arith::AndIOp::create(b, loc, isPartZero, exists);
  warp::setSchedule(entry, warp::getSchedule(entry).withSplitReduction(parts));

  IRMapping map;
  map.map(threads.getIndices()[0],
          arith::MinSIOp::create(b, loc, index, last).getResult());
  Block *thread = threads.getThread();
  auto ops = thread->begin();
  for (; &*ops != loop.getOperation(); ++ops)
    b.clone(*ops, map);
  Values inits;
  for (Value init : loop.getInitArgs()) {
    Value none = arith::ConstantOp::create(
        b, loc, cast<TypedAttr>(b.getZeroAttr(init.getType())));
    inits.push_back(arith::SelectOp::create(b, loc, isPartZero,
                                            map.lookupOrDefault(init), none));
  }
  auto [begin, end] =
      partOf(b, loc, map.lookupOrDefault(loop.getLowerBound()),
             map.lookupOrDefault(loop.getUpperBound()), part, parts);
  auto shared = cast<scf::ForOp>(b.clone(*loop, map));
  shared.getLowerBoundMutable().assign(begin);
  shared.getUpperBoundMutable().assign(end);
  shared.getInitArgsMutable().assign(inits);

  OpBuilder::InsertionGuard guard(b);
  Values totals = joinParts(shared.getResults(), lane, part, isFirst, parts);
  map.map(loop.getResults(), totals);
  for (Operation &op : llvm::make_range(std::next(ops), thread->end()))
    if (!op.hasTrait<OpTrait::IsTerminator>())
      b.clone(op, map);
  return {};
}
