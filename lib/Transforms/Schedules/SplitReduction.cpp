//===- SplitReduction.cpp - Split-K: a reduction over warps of a block ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch of few threads with a long loop each leaves most of a GPU idle.
// If the loop is a reduction whose order is open, the warps of a block split
// its iterations: thread (i, s) reduces part s, the parts are exchanged through
// shared memory, and thread (i, 0) continues with their sum:
//
//   for j in part s of range(n): sum += f(i, j)
//   parts[s][i] = sum; barrier
//   if s == 0: sum = parts[0][i] + parts[1][i] + ...; the rest of the kernel
//
// Threads beyond the last index run all that for the last one, up to the rest
// of the kernel. The sum has the same bits in every run.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"
#include "LoopSchedule.h"

#include "Launch/LoopSums.h"
#include "Updates/Atomics.h"
#include "warp/Schedule.h"

#include "mlir/IR/Matchers.h"

using namespace mlir;
using namespace warp;

/// Bytes of shared memory, iterations that are worth a part, and parts.
constexpr int64_t mostBytes = 40 * 1024, fewestTrips = 512, mostParts = 8;

namespace {

class SplitReduction : public GridMapping {
public:
  explicit SplitReduction(ScheduleSite &site)
      : GridMapping(site), warpSize(site.target.getSubgroupSize()),
        parts(variant.getBlockDim() / warpSize) {}

  bool applies() override;
  bool profit() override { return variant.getUnderfilled(); }
  Description describe(bool isMade) override {
    if (!isMade)
      return {"split_reduction", "1", "the launch has enough threads"};
    return {"split_reduction", std::to_string(parts),
            "few threads: the warps of a block split a loop's sum", loop};
  }
  int sizeFacts() const override { return underfilledFact; }
  bool needsRegisters(bool isMade) const override { return isMade; }

private:
  bool canSplit(scf::ForOp loop);
  int64_t countBytes(TypeRange types);
  Values build() override;
  Values addParts(ValueRange sums, Value lane, Value part, Value isFirst);

  int64_t warpSize;
  /// Warps of a block.
  int64_t parts;
  scf::ForOp loop;
};

} // namespace

/// Bytes of shared memory for the sums of a block.
int64_t SplitReduction::countBytes(TypeRange types) {
  int64_t bytes = 0;
  for (Type type : types)
    bytes += parts * warpSize * type.getIntOrFloatBitWidth() / 8;
  return bytes;
}

/// True if a loop is a reduction with the same trip count in all threads.
bool SplitReduction::canSplit(scf::ForOp loop) {
  // A loop may carry arrays, too.
  auto isWord = [](Type type) {
    return type.isIntOrFloat() && type.getIntOrFloatBitWidth() >= 32;
  };
  auto isUniform = [&](Value value) {
    return site.getVariance().isUniform(value, Scope::Launch);
  };
  return loop.getNumResults() > 0 &&
         llvm::all_of(loop.getResultTypes(), isWord) &&
         countBytes(loop.getResultTypes()) <= mostBytes &&
         !loop.getUnsignedCmp() && !hasFewerTrips(loop, fewestTrips) &&
         matchPattern(loop.getStep(), m_One()) &&
         isa<IntegerType>(loop.getInductionVar().getType()) &&
         isUniform(loop.getUpperBound()) && isUniform(loop.getLowerBound()) &&
         carriesSums(loop, variant.getFastMath());
}

/// The first loop of the kernel only loads and accumulates, and so does the
/// code before it.
bool SplitReduction::applies() {
  if (rank != 1 || !hasPlainThreads() || threads.getNumResults() != 0 ||
      parts < 2 || parts > mostParts || !variant.hasWholeWarps())
    return false;
  for (Operation &op : thread->without_terminator()) {
    loop = dyn_cast<scf::ForOp>(op);
    if (loop || !onlyLoads(op, /*loops=*/false))
      break;
  }
  return loop && onlyLoads(*loop, /*loops=*/true) && canSplit(loop);
}

/// Bounds of part `part` of a range; parts are multiples of a warp.
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
  int64_t warpSize = subgroupSizeAt(b), unit = parts * warpSize;
  Value size = arith::AddIOp::create(b, loc, trips, constant(unit - 1));
  size = arith::DivUIOp::create(b, loc, size, constant(unit));
  size = arith::MulIOp::create(b, loc, size, constant(warpSize));
  Value from = arith::MulIOp::create(b, loc, size, widen(part));
  Value to = arith::AddIOp::create(b, loc, from, size);
  auto bound = [&](Value trip) -> Value {
    trip = arith::MinSIOp::create(b, loc, trip, trips);
    Value counter = arith::AddIOp::create(b, loc, begin, trip);
    if (type == i64)
      return counter;
    return arith::TruncIOp::create(b, loc, type, counter);
  };
  return {bound(from), bound(to)};
}

/// Adds up the sums of all parts; continues in a branch for the threads of the
/// first.
SplitReduction::Values SplitReduction::addParts(ValueRange sums, Value lane,
                                                Value part, Value isFirst) {
  int64_t bytes = 0;
  SmallVector<int64_t> starts;
  for (Value sum : sums) {
    starts.push_back(bytes);
    bytes += countBytes(sum.getType());
  }
  auto type = LLVM::LLVMArrayType::get(b.getI8Type(), bytes);
  Value slab = makeShared(b, loc, site.function->getParentOfType<ModuleOp>(),
                          type, "reduction_parts");
  auto address = [&](size_t i, Value number) -> Value {
    Value start =
        LLVM::GEPOp::create(b, loc, slab.getType(), b.getI8Type(), slab,
                            ArrayRef<LLVM::GEPArg>(int32_t(starts[i])));
    return LLVM::GEPOp::create(b, loc, slab.getType(), sums[i].getType(), start,
                               ArrayRef<LLVM::GEPArg>(number));
  };
  Value own = add(lane, mul(part, constant32(warpSize)));
  for (auto [i, sum] : llvm::enumerate(sums))
    LLVM::StoreOp::create(b, loc, sum, address(i, own));
  synchronizeBlock(b, loc);
  enterIf(isFirst);
  Values totals(sums);
  for (int64_t other = 1; other < parts; ++other) {
    Value number = add(lane, constant32(other * warpSize));
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

SplitReduction::Values SplitReduction::build() {
  setSchedule(site.function,
              getSchedule(site.function).withSplitReduction(parts));
  Value lane = read(GridValue::threadId);
  Value part = read(GridValue::threadId, Axis::y);
  Value block = read(GridValue::blockId);
  Value index = add(mul(block, constant32(warpSize)), lane);
  Value exists = isLess(index, dims[0]);
  Value last = sub(dims[0], constant32(1));
  Value isPartZero = cmp(arith::CmpIPredicate::eq, part, constant32(0));
  Value isFirst = both(isPartZero, exists);

  IRMapping map;
  map.map(indices()[0],
          arith::MinSIOp::create(b, loc, index, last).getResult());
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

  Values totals = addParts(shared.getResults(), lane, part, isFirst);
  map.map(loop.getResults(), totals);
  for (Operation &op : llvm::make_range(std::next(ops), thread->end()))
    if (!op.hasTrait<OpTrait::IsTerminator>())
      b.clone(op, map);
  return {};
}

WARP_MAKE_SCHEDULE(SplitReduction)
