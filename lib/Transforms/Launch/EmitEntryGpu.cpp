//===- EmitEntryGpu.cpp - One thread of a GPU launch ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A thread finds its indices on the axes of the grid and returns if the launch
// does not have them.
//
// Where that pays, it takes several indices, not one (Schedules/).
//
//===----------------------------------------------------------------------===//

#include "Choices.h"
#include "EntryBuilder.h"
#include "Updates/BlockReduce.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TilePasses.h"
#include "warp/SizeFacts.h"

using namespace mlir;
using warp::EntryBuilder;

/// block index * block size + thread index, along one axis.
Value EntryBuilder::gridIndex(warp::Axis axis, Type type) {
  auto read = [&](warp::GridValue value) {
    return narrow(warp::readGrid(b, loc, value, axis), type);
  };
  Value start =
      mul(narrow(blockIndex(axis), type), read(warp::GridValue::blockDim));
  return add(start, read(warp::GridValue::threadId));
}

/// Thread indices, and whether the launch has that thread.
EntryBuilder::Values EntryBuilder::gridIndices(Value &inside) {
  Type i64 = b.getI64Type();
  Type type = index32 ? b.getI32Type() : i64;
  auto guard = [&](Value index, Value extent) {
    Value fits =
        cmp(arith::CmpIPredicate::slt, index, narrow(extent, index.getType()));
    inside = inside ? arith::AndIOp::create(b, loc, inside, fits) : fits;
  };
  if (kernel->hasAttr(warp::attr::ragged)) {
    // Threads beyond the launch take part in what their block does
    // (warp-mask-threads).
    Value last = sub(countAll(), constant(i64, 1));
    Value linear =
        arith::MinSIOp::create(b, loc, gridIndex(warp::Axis::x, i64), last);
    return unravel(linear, rank);
  }
  if (rank > 1 && kernel->hasAttr(warp::attr::blockThreads)) {
    // Threads that work together are one row of the last dimension.
    auto read = [&](warp::GridValue value) {
      return narrow(warp::readGrid(b, loc, value), type);
    };
    Value row = narrow(blockIndex(), type), rows = narrow(dims[0], type);
    for (Value extent : ArrayRef(dims).drop_front().drop_back())
      rows = mul(rows, narrow(extent, type));
    guard(row, rows);
    Values indices = unravel(row, rank - 1);
    indices.push_back(read(warp::GridValue::threadId));
    return indices;
  }
  if (flat) {
    Value linear = gridIndex(warp::Axis::x, i64);
    guard(linear, countAll());
    return unravel(linear, rank);
  }
  Values indices(rank);
  indices[rank - 1] = gridIndex(warp::Axis::x, type);
  guard(indices[rank - 1], dims[rank - 1]);
  if (rank > 1) {
    indices[rank - 2] = gridIndex(warp::Axis::y, type);
    guard(indices[rank - 2], dims[rank - 2]);
  }
  if (rank > 2) {
    Value slab = gridIndex(warp::Axis::z, type);
    Value extent = narrow(dims[0], type);
    if (rank == 4)
      extent = mul(extent, narrow(dims[1], type));
    guard(slab, extent);
    llvm::copy(unravel(slab, rank - 2), indices.begin());
  }
  return indices;
}

EntryBuilder::Values EntryBuilder::buildOneItem() {
  Value inside;
  Values indices = gridIndices(inside);
  if (!inside)
    inside = arith::ConstantOp::create(b, loc, b.getBoolAttr(true));
  Values sums = identities(/*inLanes=*/false);
  auto branch = scf::IfOp::create(b, loc, TypeRange(ValueRange(sums)), inside,
                                  /*withElseRegion=*/!sums.empty());
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  Values terms = takeThread(indices);
  if (!sums.empty()) {
    scf::YieldOp::create(b, loc, terms);
    b.setInsertionPointToStart(branch.elseBlock());
    scf::YieldOp::create(b, loc, sums);
  }
  return Values(branch.getResults());
}

/// Threads of the whole launch, i64.
Value EntryBuilder::countAll() {
  Type i64 = b.getI64Type();
  Value total = narrow(dims[0], i64);
  for (Value extent : ArrayRef(dims).drop_front())
    total = mul(total, narrow(extent, i64));
  return total;
}

/// The only block of the launch; its threads take turns at the indices, so that
/// which thread runs which index does not depend on the card.
EntryBuilder::Values EntryBuilder::buildOneBlock() {
  Type i64 = b.getI64Type();
  Value begin = narrow(warp::readGrid(b, loc, warp::GridValue::threadId), i64);
  Value step = narrow(warp::readGrid(b, loc, warp::GridValue::blockDim), i64);
  Values sums = identities(/*inLanes=*/false);
  auto loop = scf::ForOp::create(b, loc, begin, countAll(), step, sums);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  Values terms = takeThread(unravel(loop.getInductionVar(), rank));
  Values next = combine(loop.getRegionIterArgs(), terms);
  if (!sums.empty())
    scf::YieldOp::create(b, loc, next);
  return Values(loop.getResults());
}

//===----------------------------------------------------------------------===//
// Forms
//===----------------------------------------------------------------------===//

/// Notes what of the size of the launch the code depends on.
void EntryBuilder::dependOn(int facts) {
  warp::setSchedule(kernel, warp::getSchedule(kernel).withSizeFacts(facts));
}

/// NVIDIA's assembler gives threads as few registers as let a multiprocessor
/// run as many as it can, unless it is told that one block will do. Threads of
/// a launch that has few, or that work on much at a time, do better with more
/// (H200: forces of 16 k bodies 1.77 times as fast with 54 as with 32).
static void takeRegisters(Operation *kernel) {
  kernel->setAttr(warp::attr::leastBlocks,
                  Builder(kernel->getContext()).getI64IntegerAttr(1));
}

/// Decides how the launch is made.
void EntryBuilder::planGpu() {
  planForm();
  alternates = canAlternate();
  if (!alternates)
    return;
  warp::setSchedule(kernel, warp::getSchedule(kernel).withReverseOrder(true));
  warp::noteChoice(kernel, "order", "from either end",
                   "a launch over more than the cache holds begins with what "
                   "the last one left there");
}

void EntryBuilder::planForm() {
  if (warp::getSchedule(kernel).getSingleBlock() != 0) {
    form = Form::Block;
    return warp::noteChoice(kernel, "blocks", "1", "sums are in one order");
  }
  if (kernel->hasAttr(warp::attr::blockThreads))
    return warp::noteChoice(kernel, "items", "1",
                            "the threads of a block work together");
  int facts = 0;
  if (planTiles()) {
    facts |= warp::skinnyFact;
    if (!variant.getSkinny()) {
      form = Form::Tiles;
      dependOn(facts);
      return warp::noteChoice(kernel, "tiles", "32 x 32",
                              "indices are exchanged; warps touch whole lines",
                              *turned.begin());
    }
  }
  bool large = variant.getLarge(), under = variant.getUnderfilled();
  int64_t most = countItems();
  bool sums = sumsManyItems();
  scf::ForOp shared = findSharedLoop(), split = findSplitLoop();
  bool hasItems = sums || most > 1;
  if (hasItems)
    facts |= warp::largeFact;
  if ((shared || split) && !(large && hasItems))
    facts |= warp::underfilledFact;
  dependOn(facts);
  if ((large && sums) || ((facts & warp::underfilledFact) && (under || shared)))
    takeRegisters(kernel);
  if (large && sums) {
    form = Form::Sums;
    warp::noteChoice(kernel, "items", Twine(summedItems),
                     "a block combines sums once for all");
  } else if (large && most > 1) {
    form = Form::Items;
    items = most;
    warp::noteChoice(kernel, "items", Twine(items),
                     "loads of several are under way together");
  } else if (under && split) {
    form = Form::Split;
    loop = split;
    warp::noteChoice(kernel, "split", Twine(countParts(kernel)),
                     "few threads, and a sum in any order", loop);
  } else if (!under && shared) {
    form = Form::Jammed;
    loop = shared;
    warp::noteChoice(kernel, "items", "2", "they share what a loop loads",
                     loop);
  } else {
    warp::noteChoice(kernel, "items", "1",
                     most > 1 || sums ? "the launch is not large"
                     : shared         ? "the launch has too few threads"
                                      : "more would not share anything");
  }
}

EntryBuilder::Values EntryBuilder::buildForm() {
  switch (form) {
  case Form::One:
    return buildOneItem();
  case Form::Block:
    return buildOneBlock();
  case Form::Sums:
    return buildSums();
  case Form::Items:
    return rank == 1 ? buildStream() : buildPlanes();
  case Form::Jammed:
    return buildJammed();
  case Form::Split:
    return buildSplit();
  case Form::Tiles:
    return buildTiles();
  }
  llvm_unreachable("no such form");
}

EntryBuilder::Values EntryBuilder::buildGpu() {
  Values sums = buildForm();
  if (sums.empty())
    return sums;
  warp::BlockReduce reduce(b, loc, kernel->getParentOfType<ModuleOp>(),
                           variant.getBlock());
  SmallVector<warp::Reduced> reduced;
  for (auto [kind, type, sum, identity] : llvm::zip_equal(
           threads.getKinds(), threads.getTypes().getAsValueRange<TypeAttr>(),
           sums, identities(/*inLanes=*/false)))
    if (!type.isInteger(1))
      reduced.push_back({warp::AtomicKind(kind), sum, identity, type});
  SmallVector<Value> totals = reduce.reduce(reduced);
  Values combined;
  auto total = totals.begin();
  for (Value sum : sums)
    combined.push_back(sum.getType().isInteger(1) ? reduce.any(sum) : *total++);
  return combined;
}
