//===- LowerLaunchGpu.cpp - One thread of a GPU launch ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A thread finds its indices on the axes of the grid and returns if the launch
// does not have them.
//
// A kernel that only streams a few bytes per item leaves a GPU waiting: too
// few loads are under way. Where the launch is large (`warp.large`), such a
// thread takes several items, a block apart so that neighbours still touch
// neighbouring memory. Their operations are interleaved one by one, which puts
// all loads before the first store; threads of a launch are independent, so
// the order between items is free. The last block takes its items one by one.
//
//===----------------------------------------------------------------------===//

#include "LowerLaunch.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/IR/IRMapping.h"

using namespace mlir;
using warp::Launch;

/// Bytes of loads and stores that keep a thread of the card busy.
constexpr int64_t bytesInFlight = 48;
constexpr int64_t maxItems = 4;

/// A special register of the grid.
Value Launch::readSpecial(StringRef name, StringRef axis) {
  std::string intrinsic =
      ("llvm.nvvm.read.ptx.sreg." + name + "." + axis).str();
  return LLVM::CallIntrinsicOp::create(b, loc, b.getI32Type(),
                                       b.getStringAttr(intrinsic),
                                       ValueRange())
      .getResult(0);
}

/// block index * block size + thread index, along one axis.
Value Launch::gridIndex(StringRef axis, Type type) {
  auto read = [&](StringRef name) {
    return narrow(readSpecial(name, axis), type);
  };
  Value start = mul(read("ctaid"), read("ntid"));
  return add(start, read("tid"));
}

/// Thread indices, and whether the launch has that thread.
SmallVector<Value> Launch::gridIndices(Value &inside) {
  Type i64 = b.getI64Type();
  Type type = index32 ? b.getI32Type() : i64;
  auto guard = [&](Value index, Value extent) {
    Value fits = cmp(arith::CmpIPredicate::slt, index,
                     narrow(extent, index.getType()));
    inside = inside ? arith::AndIOp::create(b, loc, inside, fits) : fits;
  };
  if (flat) {
    Value linear = gridIndex("x", i64);
    Value total = narrow(dims[0], i64);
    for (Value extent : ArrayRef(dims).drop_front())
      total = mul(total, narrow(extent, i64));
    guard(linear, total);
    return unravel(linear, rank);
  }
  SmallVector<Value> indices(rank);
  indices[rank - 1] = gridIndex("x", type);
  guard(indices[rank - 1], dims[rank - 1]);
  if (rank > 1) {
    indices[rank - 2] = gridIndex("y", type);
    guard(indices[rank - 2], dims[rank - 2]);
  }
  if (rank > 2) {
    Value slab = gridIndex("z", type);
    Value extent = narrow(dims[0], type);
    if (rank == 4)
      extent = mul(extent, narrow(dims[1], type));
    guard(slab, extent);
    llvm::copy(unravel(slab, rank - 2), indices.begin());
  }
  return indices;
}

/// Items of one thread: 1 unless the body is straight-line code that moves
/// little.
int64_t Launch::chooseItems() {
  if (rank != 1 || flat || !index32 || !kernel->hasAttr(warp::attr::large) ||
      kernel->hasAttr(warp::attr::debug))
    return 1;
  int64_t bytes = 0;
  for (Operation &op : kernel.getFunctionBody().front().without_terminator()) {
    Value array;
    if (auto load = dyn_cast<warp::LoadComponentsOp>(op))
      array = load.getArray();
    else if (auto store = dyn_cast<warp::StoreComponentsOp>(op))
      array = store.getArray();
    else if (!isMemoryEffectFree(&op) || op.getNumRegions() != 0)
      return 1;
    if (array)
      bytes += warp::getByteSize(
          cast<warp::ArrayType>(array.getType()).getElementType());
  }
  if (bytes == 0)
    return 1;
  int64_t items = maxItems;
  while (items > 1 && items * bytes > bytesInFlight)
    items /= 2;
  return items;
}

/// Copies of the body for several values of the thread index, operation by
/// operation.
void Launch::cloneInterleaved(ArrayRef<Value> items) {
  Block &body = kernel.getFunctionBody().front();
  SmallVector<IRMapping> clones(items.size());
  for (IRMapping &clone : clones)
    clone.map(body.getArguments(), arguments);
  for (Operation &op : body.without_terminator())
    for (auto [clone, item] : llvm::zip_equal(clones, items)) {
      auto tid = dyn_cast<warp::TidOp>(op);
      if (!tid) {
        b.clone(op, clone);
        continue;
      }
      for (auto [i, result] : llvm::enumerate(tid.getResults())) {
        Type type = warp::getSignless(result.getType());
        clone.map(result, i == 0 ? narrow(item, type) : constant(type, 0));
      }
    }
}

void Launch::buildItems(Block *first, Block *exit, int64_t items) {
  Type i32 = b.getI32Type();
  Block *single = b.createBlock(exit, {i32}, {loc});
  Block *run = b.createBlock(exit);
  Block *next = b.createBlock(exit);
  Block *all = b.createBlock(single);

  b.setInsertionPointToEnd(first);
  Value width = readSpecial("ntid", "x");
  Value start = mul(mul(readSpecial("ctaid", "x"), width),
                    constant(i32, items));
  Value lane = add(start, readSpecial("tid", "x"));
  Value end = add(start, mul(width, constant(i32, items)));
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::sle, end, dims[0]),
                         all, ValueRange(), single, ValueRange(lane));

  b.setInsertionPointToEnd(all);
  SmallVector<Value> indices{lane};
  while (int64_t(indices.size()) < items)
    indices.push_back(add(indices.back(), width));
  cloneInterleaved(indices);
  LLVM::BrOp::create(b, loc, ValueRange(), exit);

  b.setInsertionPointToEnd(single);
  Value index = single->getArgument(0);
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::slt, index, dims[0]),
                         run, ValueRange(), exit, ValueRange());
  b.setInsertionPointToEnd(run);
  LLVM::BrOp::create(b, loc, ValueRange(), next);
  b.setInsertionPointToStart(run);
  inlineBody(index);
  b.setInsertionPointToEnd(next);
  Value step = add(index, width);
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::slt, step, end),
                         single, ValueRange(step), exit, ValueRange());
  entry->setAttr(warp::attr::items, b.getI64IntegerAttr(items));
}

void Launch::buildOneItem(Block *first, Block *exit) {
  Block *body = b.createBlock(exit);
  b.setInsertionPointToEnd(first);
  Value inside;
  SmallVector<Value> indices = gridIndices(inside);
  LLVM::CondBrOp::create(b, loc, inside, body, ValueRange(), exit,
                         ValueRange());
  b.setInsertionPointToEnd(body);
  LLVM::BrOp::create(b, loc, ValueRange(), exit);
  b.setInsertionPointToStart(body);
  inlineBody(indices);
}

void Launch::buildGpu() {
  Block *first = b.getInsertionBlock();
  Block *exit = b.createBlock(&entry.getBody());
  if (int64_t items = chooseItems(); items > 1)
    buildItems(first, exit, items);
  else
    buildOneItem(first, exit);
  b.setInsertionPointToEnd(exit);
  LLVM::ReturnOp::create(b, loc, ValueRange());
}
