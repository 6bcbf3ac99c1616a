//===- CoarsenReductions.cpp - Thread coarsening of block reductions ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If threads are so short that the reduction over their block is most of
// the work of a large launch, a thread takes 32 indices, a block apart, and
// accumulates their values in registers. The block then reduces once for all:
//
//   for i = thread to 32 * blockDim step blockDim: sum += f(start + i)
//   reduce sum over the block
//
// In blocks that have all their indices, eight are unrolled, so that their
// loads are in flight together.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"

#include "warp/Schedule.h"

#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;
using namespace warp;

/// Indices of a thread, and those that are unrolled.
constexpr int64_t count = 32, unrolled = 8;
/// Operations of a body that is short beside the reduction.
constexpr int64_t mostOperations = 64;

namespace {

class CoarsenReductions : public GridMapping {
public:
  using GridMapping::GridMapping;

  bool applies() override;
  bool profit() override { return variant.getLarge(); }
  Description describe(bool isMade) override {
    if (!isMade)
      return {"coarsening", "1", "the launch is not large"};
    return {"coarsening", std::to_string(count),
            "one block reduction for all indices of a thread"};
  }
  int sizeFacts() const override { return largeFact; }
  bool needsRegisters(bool isMade) const override { return isMade; }

private:
  Values build() override;
  /// Accumulates the indices below `limit`, `step` blocks at a time; returns
  /// the sums. `take` runs the thread for an index.
  Values accumulate(Value start, Value lane, Value width, Value limit,
                    int64_t step, ValueRange none,
                    function_ref<Values(Value)> take);
};

} // namespace

bool CoarsenReductions::applies() {
  if (rank != 1 || !hasPlainThreads() || threads.getNumResults() == 0)
    return false;
  int64_t operations = 0;
  WalkResult result = threads.getBody().walk([&](Operation *op) {
    return isa<LoopLikeOpInterface>(op) || ++operations > mostOperations
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

CoarsenReductions::Values
CoarsenReductions::accumulate(Value start, Value lane, Value width, Value limit,
                              int64_t step, ValueRange none,
                              function_ref<Values(Value)> take) {
  Value stride = mul(width, constant32(step));
  auto loop = scf::ForOp::create(b, loc, lane, limit, stride, none);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  Values sums(loop.getRegionIterArgs());
  Value index = add(start, loop.getInductionVar());
  for (int64_t i = 0; i < step; ++i, index = add(index, width))
    sums = combine(sums, take(index));
  scf::YieldOp::create(b, loc, sums);
  return Values(loop.getResults());
}

CoarsenReductions::Values CoarsenReductions::build() {
  setSchedule(site.function, getSchedule(site.function).withCoarsening(count));
  Value width = read(GridValue::blockDim);
  Value size = mul(width, constant32(count));
  Value start = mul(read(GridValue::blockId), size);
  Value lane = read(GridValue::threadId);
  // Counted from the block's first: an index beyond the last may not fit.
  Value left = sub(dims[0], start);
  Value whole = cmp(arith::CmpIPredicate::sge, left, size);
  Values none = identities(/*inLanes=*/false);
  auto branch = scf::IfOp::create(b, loc, TypeRange(ValueRange(none)), whole,
                                  /*withElseRegion=*/true);
  b.setInsertionPointToStart(branch.thenBlock());
  Values all = accumulate(start, lane, width, size, unrolled, none,
                          [&](Value index) { return cloneThread(index); });
  scf::YieldOp::create(b, loc, all);
  b.setInsertionPointToStart(branch.elseBlock());
  Values some = accumulate(start, lane, width, left, 1, none,
                           [&](Value index) { return takeThread(index); });
  scf::YieldOp::create(b, loc, some);
  return Values(branch.getResults());
}

WARP_MAKE_SCHEDULE(CoarsenReductions)
