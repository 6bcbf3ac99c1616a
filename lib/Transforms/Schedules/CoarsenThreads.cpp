//===- CoarsenThreads.cpp - Thread coarsening for memory parallelism ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A streaming kernel that moves a few bytes per index has too few loads in
// flight to cover the latency of memory. In a large launch its threads take
// several indices each, of the first dimension mostly:
//
//   rank 1       a block apart, so that accesses stay coalesced;
//   rank 2, 3    consecutive ones, so that a stencil reuses the planes that it
//                loads; in rank 3 also pairs of rows.
//
// The code of the indices is interleaved operation by operation, which puts
// all loads before the first store; threads of a launch are independent, so
// the order between indices is free. A body may end in a guard, `if inside:
// ...`; where it holds for all indices they stay together. Threads that miss an
// index, or whose guards differ, run their indices one by one.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"

#include "Analysis/Ranges.h"
#include "warp/Schedule.h"

using namespace mlir;
using namespace warp;

/// Bytes of loads and stores that a thread needs in flight.
constexpr int64_t bytesInFlight = 48;
/// The same where neighbouring indices share most of what they load.
constexpr int64_t bytesOfPlanes = 256;
constexpr int64_t mostIndices = 4, mostPlanes = 8;

namespace {

/// Straight-line code, and perhaps a guard with more of it at its end.
struct Stretch {
  SmallVector<Operation *> ops;
  scf::IfOp guard;
  /// The branch of the guard that does something.
  Block *inside = nullptr;
};

class CoarsenThreads : public GridMapping {
public:
  using GridMapping::GridMapping;

  bool applies() override;
  bool profit() override { return variant.getLarge(); }
  Description describe(bool isMade) override {
    if (!isMade)
      return {"coarsening", "1", "the launch is not large"};
    return {"coarsening", std::to_string(count),
            "more loads of a thread are in flight"};
  }
  int sizeFacts() const override { return largeFact; }
  bool hasIndependentBlocks() const override { return true; }

private:
  int64_t countRows() const { return rank == 3 && count == mostPlanes ? 2 : 1; }
  Values build() override;
  void buildStrided();
  void buildConsecutive();
  void buildIndices(ArrayRef<Values> indices, Value allExist,
                    function_ref<void()> buildAlone);
  Value cloneStretch(Block *body, MutableArrayRef<IRMapping> clones);

  /// Indices of a thread.
  int64_t count = 1;
};

} // namespace

/// Adds the bytes that an operation moves; fails where it has other effects on
/// memory, or loops: a few threads with several long bodies would leave the GPU
/// idle at the end.
static LogicalResult countBytes(Operation &op, int64_t &bytes, bool &stores) {
  Value array;
  if (auto load = dyn_cast<LoadComponentsOp>(op))
    array = load.getArray();
  else if (auto store = dyn_cast<StoreComponentsOp>(op))
    array = store.getArray();
  else
    return success(isMemoryEffectFree(&op) && !hasLoop(op));
  stores |= isa<StoreComponentsOp>(op);
  bytes += getByteSize(cast<ArrayType>(array.getType()).getElementType());
  return success();
}

/// Splits a block into code and guard; fails where it is not of that form.
static FailureOr<Stretch> parseStretch(Block &block, int64_t &bytes) {
  Stretch result;
  bool stores = false;
  for (Operation &op : block.without_terminator()) {
    if (result.guard)
      return failure();
    if (succeeded(countBytes(op, bytes, stores))) {
      result.ops.push_back(&op);
      continue;
    }
    auto guard = dyn_cast<scf::IfOp>(op);
    // A store before a guard would be repeated where guards differ.
    if (!guard || guard.getNumResults() != 0 || stores)
      return failure();
    bool noElse =
        !guard.elseBlock() || guard.elseBlock()->without_terminator().empty();
    bool noThen = guard.thenBlock()->without_terminator().empty();
    if (noElse == noThen)
      return failure();
    result.guard = guard;
    result.inside = noElse ? guard.thenBlock() : guard.elseBlock();
  }
  return result;
}

bool CoarsenThreads::applies() {
  if (rank > 3 || !hasPlainThreads() || threads.getNumResults() != 0)
    return false;
  int64_t bytes = 0;
  for (Block *block = thread; block;) {
    FailureOr<Stretch> stretch = parseStretch(*block, bytes);
    if (failed(stretch) || (stretch->guard && rank == 1))
      return false;
    block = stretch->inside;
  }
  if (bytes == 0)
    return false;
  count = rank == 1 ? mostIndices : mostPlanes;
  int64_t most = rank == 1 ? bytesInFlight : bytesOfPlanes;
  while (count > 1 && count * bytes > most)
    count /= 2;
  return count > 1;
}

/// Marks indices that the guard around a block proves not to be negative,
/// before the guard is gone.
static void markIndices(Block &block) {
  for (Operation &op : block)
    if (isa<arith::SubIOp>(op) && isNonNegative(op.getResult(0), &block))
      op.setAttr(attr::nonNegative, UnitAttr::get(op.getContext()));
}

/// Copies a stretch for all indices of a thread, interleaved. Returns a
/// condition that it was performed: not if a guard in it differs between
/// indices, which is tested before any store.
Value CoarsenThreads::cloneStretch(Block *body,
                                   MutableArrayRef<IRMapping> clones) {
  int64_t bytes = 0;
  Stretch stretch = *parseStretch(*body, bytes);
  for (Operation *op : stretch.ops)
    cloneInterleaved(b, *op, clones);
  Type i1 = b.getI1Type();
  if (!stretch.guard)
    return constant(i1, 1);
  Value all, any;
  for (IRMapping &clone : clones) {
    Value holds = clone.lookupOrDefault(stretch.guard.getCondition());
    if (stretch.inside == stretch.guard.elseBlock())
      holds = arith::XOrIOp::create(b, loc, holds, constant(i1, 1));
    all = all ? both(all, holds) : holds;
    any = any ? arith::OrIOp::create(b, loc, any, holds) : holds;
  }
  auto together =
      scf::IfOp::create(b, loc, TypeRange(i1), all, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(together.thenBlock());
  markIndices(*stretch.inside);
  Value done = cloneStretch(stretch.inside, clones);
  scf::YieldOp::create(b, loc, done);
  // If no index is inside, as at the border of a stencil, nothing is left.
  b.setInsertionPointToStart(together.elseBlock());
  Value none = arith::XOrIOp::create(b, loc, any, constant(i1, 1));
  scf::YieldOp::create(b, loc, none);
  return together.getResult(0);
}

/// The indices of a thread, interleaved if the launch has all of them;
/// `buildAlone` builds the code for those it has, one by one.
void CoarsenThreads::buildIndices(ArrayRef<Values> indices, Value allExist,
                                  function_ref<void()> buildAlone) {
  Type i1 = b.getI1Type();
  auto whole =
      scf::IfOp::create(b, loc, TypeRange(i1), allExist, /*withElse=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(whole.elseBlock());
  scf::YieldOp::create(b, loc, Value(constant(i1, 0)));
  b.setInsertionPointToStart(whole.thenBlock());
  SmallVector<IRMapping> clones(indices.size());
  for (auto [clone, index] : llvm::zip_equal(clones, indices))
    clone.map(this->indices(), index);
  Value done = cloneStretch(thread, clones);
  scf::YieldOp::create(b, loc, done);

  b.setInsertionPointAfter(whole);
  Value left =
      arith::XOrIOp::create(b, loc, whole.getResult(0), constant(i1, 1));
  enterIf(left);
  buildAlone();
}

/// Indices a block apart along the only axis.
void CoarsenThreads::buildStrided() {
  Value width = read(GridValue::blockDim);
  Value start = mul(mul(read(GridValue::blockId), width), constant32(count));
  Value lane = add(start, read(GridValue::threadId));
  Value end = add(start, mul(width, constant32(count)));
  SmallVector<Values> indices;
  for (Value i = lane; int64_t(indices.size()) < count; i = add(i, width))
    indices.push_back({i});
  buildIndices(indices, isAtMost(end, dims[0]),
               [&] { takeThread(enterLoop(lane, min(end, dims[0]), width)); });
}

/// Consecutive indices along the first of two or three dimensions; of many,
/// every other one along the second of three.
void CoarsenThreads::buildConsecutive() {
  Type i32 = b.getI32Type();
  int64_t rows = countRows(), planes = count / rows;
  Value x = gridIndex(Axis::x, i32), inside = isLess(x, dims[rank - 1]);
  Value start =
      mul(gridIndex(rank == 2 ? Axis::y : Axis::z, i32), constant32(planes));
  Value end = add(start, constant32(planes)), row, last;
  Value whole = isAtMost(end, dims[0]);
  if (rank == 3) {
    row = mul(gridIndex(Axis::y, i32), constant32(rows));
    last = add(row, constant32(rows));
    inside = both(inside, isLess(row, dims[1]));
    whole = both(whole, isAtMost(last, dims[1]));
  }
  enterIf(inside);
  Value one = constant32(1);
  SmallVector<Values> indices;
  for (int64_t i = 0; i < count; ++i) {
    Values index{add(start, constant32(i / rows))};
    if (rank == 3)
      index.push_back(add(row, constant32(i % rows)));
    index.push_back(x);
    indices.push_back(index);
  }
  buildIndices(indices, whole, [&] {
    Values index{enterLoop(start, min(end, dims[0]), one)};
    if (rows > 1)
      index.push_back(enterLoop(row, min(last, dims[1]), one));
    else if (rank == 3)
      index.push_back(row);
    index.push_back(x);
    takeThread(index);
  });
}

CoarsenThreads::Values CoarsenThreads::build() {
  setSchedule(site.function, getSchedule(site.function)
                                 .withCoarsening(count)
                                 .withRowCoarsening(countRows()));
  if (rank == 1)
    buildStrided();
  else
    buildConsecutive();
  return {};
}

WARP_MAKE_SCHEDULE(CoarsenThreads)
