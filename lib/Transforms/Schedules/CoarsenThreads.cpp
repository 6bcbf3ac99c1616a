//===- CoarsenThreads.cpp - Thread coarsening for memory parallelism ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel that only streams a few bytes per item leaves a GPU waiting: too
// few loads are under way. Where the launch is large (`large`), such a
// thread takes several items, of the first dimension mostly:
//
//   rank 1       a block apart, so that neighbours still touch neighbouring
//                memory;
//   rank 2, 3    one after the other, so that what a stencil reads of one
//                plane serves the next plane too; in rank 3 also pairs of rows.
//
// Operations of the items are interleaved one by one, which puts all loads
// before the first store; threads of a launch are independent, so the order
// between items is free. A body may end in a guard, `if inside: ...`; where it
// holds for all items they go together. Threads that miss an item, or whose
// guards differ, take their items one by one.
//
//===----------------------------------------------------------------------===//

#include "Analysis/Ranges.h"
#include "Choices.h"
#include "Launch/EntryBuilder.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;
using warp::EntryBuilder;
using warp::summedItems;

/// Bytes of loads and stores that keep a thread of the card busy.
constexpr int64_t bytesInFlight = 48;
/// The same where neighbouring items share most of what they load.
constexpr int64_t bytesOfPlanes = 256;
constexpr int64_t maxItems = 4;
constexpr int64_t maxPlanes = 8;
/// Items with sums whose loads are under way together; of longer bodies none.
constexpr int64_t summedTogether = 8;
constexpr int64_t longestTogether = 64;

namespace {

/// Straight-line code, and perhaps a guard with more of it at its end.
struct Stretch {
  SmallVector<Operation *> ops;
  scf::IfOp guard;
  /// The branch of the guard that does something.
  Block *inside = nullptr;
};

} // namespace

/// Adds the bytes that an operation moves; fails where it does anything else
/// to memory, or loops: a few threads with several long items would keep the
/// card waiting at the end.
static LogicalResult countBytes(Operation &op, int64_t &bytes, bool &stores) {
  Value array;
  if (auto load = dyn_cast<warp::LoadComponentsOp>(op))
    array = load.getArray();
  else if (auto store = dyn_cast<warp::StoreComponentsOp>(op))
    array = store.getArray();
  else
    return success(isMemoryEffectFree(&op) &&
                   !op.walk([](LoopLikeOpInterface) {
                        return WalkResult::interrupt();
                      }).wasInterrupted());
  stores |= isa<warp::StoreComponentsOp>(op);
  bytes += warp::getByteSize(
      cast<warp::ArrayType>(array.getType()).getElementType());
  return success();
}

/// Takes a block apart; fails where it is not of that form.
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
    bool otherwise = !guard.elseBlock() ||
                     guard.elseBlock()->without_terminator().empty();
    bool then = guard.thenBlock()->without_terminator().empty();
    if (otherwise == then)
      return failure();
    result.guard = guard;
    result.inside = otherwise ? guard.thenBlock() : guard.elseBlock();
  }
  return result;
}

/// Items of one thread of a large launch: 1 unless the body is of that form and
/// moves little.
int64_t EntryBuilder::countItems() {
  if (rank > 3 || flat || !index32 || variant.getDebug() ||
      threads.getNumResults() != 0)
    return 1;
  int64_t bytes = 0;
  for (Block *block = threads.getThread(); block;) {
    FailureOr<Stretch> stretch = parseStretch(*block, bytes);
    if (failed(stretch) || (stretch->guard && rank == 1))
      return 1;
    block = stretch->inside;
  }
  if (bytes == 0)
    return 1;
  int64_t items = rank == 1 ? maxItems : maxPlanes;
  int64_t most = rank == 1 ? bytesInFlight : bytesOfPlanes;
  while (items > 1 && items * bytes > most)
    items /= 2;
  return items;
}

/// Whether threads that combine values over their block are each so short that
/// to combine them is most of the work of a large launch.
bool EntryBuilder::sumsManyItems() {
  if (rank != 1 || flat || !index32 || threads.getNumResults() == 0 ||
      variant.getDebug())
    return false;
  int64_t count = 0;
  WalkResult result = threads.getBody().walk([&](Operation *op) {
    return isa<LoopLikeOpInterface>(op) || ++count > longestTogether
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

/// Notes what the guard around a block says about indices, before it is gone.
static void markIndices(Block &block) {
  for (Operation &op : block)
    if (isa<arith::SubIOp>(op) &&
        warp::isNonNegative(op.getResult(0), &block))
      op.setAttr(warp::attr::nonNegative, UnitAttr::get(op.getContext()));
}

/// Copies of a stretch for several items, operation by operation, from the
/// insertion point on. Returns whether it was performed: not if a guard in it
/// does not hold for all, which it asks before anything is stored.
Value EntryBuilder::cloneInterleaved(ArrayRef<Values> items, Block *body,
                                     MutableArrayRef<IRMapping> clones) {
  int64_t bytes = 0;
  Stretch stretch = *parseStretch(*body, bytes);
  for (Operation *op : stretch.ops)
    for (IRMapping &clone : clones)
      b.clone(*op, clone);
  Type i1 = b.getI1Type();
  if (!stretch.guard)
    return constant(i1, 1);
  Value all, any;
  for (IRMapping &clone : clones) {
    Value holds = clone.lookupOrDefault(stretch.guard.getCondition());
    if (stretch.inside == stretch.guard.elseBlock())
      holds = arith::XOrIOp::create(b, loc, holds, constant(i1, 1));
    all = all ? arith::AndIOp::create(b, loc, all, holds) : holds;
    any = any ? arith::OrIOp::create(b, loc, any, holds) : holds;
  }
  auto together =
      scf::IfOp::create(b, loc, TypeRange(i1), all, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(together.thenBlock());
  markIndices(*stretch.inside);
  Value done = cloneInterleaved(items, stretch.inside, clones);
  scf::YieldOp::create(b, loc, done);
  // Where none of them is inside, as at the edge of a stencil, that was all.
  b.setInsertionPointToStart(together.elseBlock());
  Value none = arith::XOrIOp::create(b, loc, any, constant(i1, 1));
  scf::YieldOp::create(b, loc, none);
  return together.getResult(0);
}

/// The items of a thread with these indices, together if all of them exist;
/// `buildAlone` writes code for those that do, one by one.
EntryBuilder::Values
EntryBuilder::buildItems(ArrayRef<Values> indices, Value allExist,
                         function_ref<void()> buildAlone) {
  Type i1 = b.getI1Type();
  auto whole =
      scf::IfOp::create(b, loc, TypeRange(i1), allExist, /*withElse=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(whole.elseBlock());
  scf::YieldOp::create(b, loc, Value(constant(i1, 0)));
  b.setInsertionPointToStart(whole.thenBlock());
  SmallVector<IRMapping> clones(indices.size());
  for (auto [clone, item] : llvm::zip_equal(clones, indices))
    clone.map(threads.getIndices(), item);
  Value done = cloneInterleaved(indices, threads.getThread(), clones);
  scf::YieldOp::create(b, loc, done);

  b.setInsertionPointAfter(whole);
  Value left = arith::XOrIOp::create(b, loc, whole.getResult(0),
                                     constant(i1, 1));
  auto alone = scf::IfOp::create(b, loc, left, /*withElseRegion=*/false);
  b.setInsertionPointToStart(alone.thenBlock());
  buildAlone();
  warp::setSchedule(
      entry, warp::getSchedule(entry).withCoarsening(int64_t(indices.size())));
  return {};
}

/// A loop from `begin` to `end`, or to that extent; goes on inside of it.
Value EntryBuilder::buildLoop(Value begin, Value end, Value extent,
                              Value step) {
  Value limit = arith::MinSIOp::create(b, loc, end, extent);
  auto loop = scf::ForOp::create(b, loc, begin, limit, step);
  b.setInsertionPointToStart(loop.getBody());
  return loop.getInductionVar();
}

/// Items a block apart along the only axis.
EntryBuilder::Values EntryBuilder::buildStream() {
  Type i32 = b.getI32Type();
  Value width = warp::readGrid(b, loc, warp::GridValue::blockDim);
  Value start = mul(mul(blockIndex(), width), constant(i32, items));
  Value lane = add(start, warp::readGrid(b, loc, warp::GridValue::threadId));
  Value end = add(start, mul(width, constant(i32, items)));
  SmallVector<Values> indices;
  for (Value i = lane; int64_t(indices.size()) < items; i = add(i, width))
    indices.push_back({i});
  return buildItems(indices, cmp(arith::CmpIPredicate::sle, end, dims[0]),
                    [&] { takeThread(buildLoop(lane, end, dims[0], width)); });
}

/// Items a block apart whose sums a thread carries along, so that the block
/// combines once for all of them. Where all exist, loads of several are under
/// way together.
EntryBuilder::Values EntryBuilder::buildSums() {
  Type i32 = b.getI32Type();
  Value width = warp::readGrid(b, loc, warp::GridValue::blockDim);
  Value size = mul(width, constant(i32, summedItems));
  Value start = mul(warp::readGrid(b, loc, warp::GridValue::blockId), size);
  Value lane = warp::readGrid(b, loc, warp::GridValue::threadId);
  // Counted from the block's first: an index beyond the last may not fit.
  Value left = sub(dims[0], start);
  Value whole = cmp(arith::CmpIPredicate::sge, left, size);
  Values none = identities(/*inLanes=*/false);
  auto branch = scf::IfOp::create(b, loc, TypeRange(ValueRange(none)), whole,
                                  /*withElseRegion=*/true);
  warp::setSchedule(entry,
                    warp::getSchedule(entry).withCoarsening(summedItems));
  OpBuilder::InsertionGuard guard(b);
  auto addUp = [&](Value limit, int64_t together, bool isLast) {
    Value step = mul(width, constant(i32, together));
    auto loop = scf::ForOp::create(b, loc, lane, limit, step, none);
    OpBuilder::InsertionGuard inLoop(b);
    b.setInsertionPointToStart(loop.getBody());
    Values sums(loop.getRegionIterArgs());
    Value index = add(start, loop.getInductionVar());
    for (int64_t i = 0; i < together; ++i, index = add(index, width))
      sums = combine(sums, isLast ? takeThread(index)
                                  : cloneThread(index, /*live=*/Value()));
    scf::YieldOp::create(b, loc, sums);
    return loop;
  };
  b.setInsertionPointToStart(branch.thenBlock());
  auto all = addUp(size, summedTogether, /*isLast=*/false);
  scf::YieldOp::create(b, loc, all.getResults());
  b.setInsertionPointToStart(branch.elseBlock());
  auto some = addUp(left, 1, /*isLast=*/true);
  scf::YieldOp::create(b, loc, some.getResults());
  return Values(branch.getResults());
}

/// Items one after the other along the first of two or three axes; of many,
/// every other one along the second of three.
EntryBuilder::Values EntryBuilder::buildPlanes() {
  Type i32 = b.getI32Type();
  int64_t rows = rank == 3 && items == maxPlanes ? 2 : 1;
  int64_t planes = items / rows;
  auto fits = [&](Value index, Value extent) {
    return cmp(arith::CmpIPredicate::slt, index, extent);
  };
  Value x = gridIndex(warp::Axis::x, i32), inside = fits(x, dims[rank - 1]);
  Value start = mul(gridIndex(rank == 2 ? warp::Axis::y : warp::Axis::z, i32),
                    constant(i32, planes));
  Value end = add(start, constant(i32, planes)), row, last;
  Value whole = cmp(arith::CmpIPredicate::sle, end, dims[0]);
  if (rank == 3) {
    row = mul(gridIndex(warp::Axis::y, i32), constant(i32, rows));
    last = add(row, constant(i32, rows));
    inside = arith::AndIOp::create(b, loc, inside, fits(row, dims[1]));
    whole = arith::AndIOp::create(
        b, loc, whole, cmp(arith::CmpIPredicate::sle, last, dims[1]));
  }
  auto exists = scf::IfOp::create(b, loc, inside, /*withElseRegion=*/false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(exists.thenBlock());
  Value one = constant(i32, 1);
  SmallVector<Values> indices;
  for (int64_t i = 0; i < items; ++i) {
    Values item{add(start, constant(i32, i / rows))};
    if (rank == 3)
      item.push_back(add(row, constant(i32, i % rows)));
    item.push_back(x);
    indices.push_back(item);
  }
  warp::setSchedule(entry, warp::getSchedule(entry).withRowCoarsening(rows));
  return buildItems(indices, whole, [&] {
    Values item{buildLoop(start, end, dims[0], one)};
    if (rows > 1)
      item.push_back(buildLoop(row, last, dims[1], one));
    else if (rank == 3)
      item.push_back(row);
    item.push_back(x);
    takeThread(item);
  });
}
