//===- LowerLaunchItems.cpp - Several indices for one GPU thread ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel that only streams a few bytes per item leaves a GPU waiting: too
// few loads are under way. Where the launch is large (`warp.large`), such a
// thread takes several items of the first dimension:
//
//   rank 1       a block apart, so that neighbours still touch neighbouring
//                memory;
//   rank 2, 3    one after the other, so that what a stencil reads of one
//                plane serves the next plane too.
//
// Operations of the items are interleaved one by one, which puts all loads
// before the first store; threads of a launch are independent, so the order
// between items is free. A body may end in a guard, `if inside: ...`; where it
// holds for all items they go together. Threads that miss an item, or whose
// guards differ, take their items one by one.
//
//===----------------------------------------------------------------------===//

#include "Emit/ArrayLowering.h"
#include "LowerLaunch.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;
using warp::Launch;

/// Bytes of loads and stores that keep a thread of the card busy.
constexpr int64_t bytesInFlight = 48;
/// The same where neighbouring items share most of what they load.
constexpr int64_t bytesOfPlanes = 256;
constexpr int64_t maxItems = 4;
constexpr int64_t maxPlanes = 8;

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
/// to memory.
static LogicalResult countBytes(Operation &op, int64_t &bytes, bool &stores) {
  Value array;
  if (auto load = dyn_cast<warp::LoadComponentsOp>(op))
    array = load.getArray();
  else if (auto store = dyn_cast<warp::StoreComponentsOp>(op))
    array = store.getArray();
  else
    return success(isMemoryEffectFree(&op));
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

/// Items of one thread: 1 unless the body is of that form and moves little.
int64_t Launch::chooseItems() {
  if (rank > 3 || flat || !index32 || !warp::getVariant(kernel).getLarge() ||
      warp::getVariant(kernel).getDebug())
    return 1;
  int64_t bytes = 0;
  for (Block *block = &kernel.getFunctionBody().front(); block;) {
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

/// Notes what the guard around a block says about indices, before it is gone.
static void markIndices(Block &block) {
  for (Operation &op : block)
    if (isa<arith::SubIOp>(op) &&
        warp::isNonNegative(op.getResult(0), &block))
      op.setAttr(warp::attr::nonNegative, UnitAttr::get(op.getContext()));
}

/// Copies of the body for several values of the first thread index, operation
/// by operation, from the insertion point on. Control goes to `exit` when they
/// are done, and to `single` if a guard does not hold for all.
void Launch::cloneInterleaved(ArrayRef<SmallVector<Value>> items, Block *single,
                              Value start, Block *exit) {
  Block *body = &kernel.getFunctionBody().front();
  SmallVector<IRMapping> clones(items.size());
  for (IRMapping &clone : clones)
    clone.map(body->getArguments(), arguments);
  while (true) {
    int64_t bytes = 0;
    Stretch stretch = *parseStretch(*body, bytes);
    for (Operation *op : stretch.ops)
      for (auto [clone, indices] : llvm::zip_equal(clones, items)) {
        auto tid = dyn_cast<warp::TidOp>(op);
        if (!tid) {
          b.clone(*op, clone);
          continue;
        }
        for (auto [i, result] : llvm::enumerate(tid.getResults())) {
          Type type = warp::getSignless(result.getType());
          clone.map(result, i < indices.size() ? narrow(indices[i], type)
                                               : constant(type, 0));
        }
      }
    if (!stretch.guard)
      break;
    Value all;
    for (IRMapping &clone : clones) {
      Value holds = clone.lookupOrDefault(stretch.guard.getCondition());
      if (stretch.inside == stretch.guard.elseBlock())
        holds = arith::XOrIOp::create(b, loc, holds,
                                      constant(b.getI1Type(), 1));
      all = all ? arith::AndIOp::create(b, loc, all, holds) : holds;
    }
    Block *together = b.createBlock(single);
    b.setInsertionPointToEnd(together->getPrevNode());
    LLVM::CondBrOp::create(b, loc, all, together, ValueRange(), single,
                           ValueRange(start));
    b.setInsertionPointToEnd(together);
    body = stretch.inside;
    markIndices(*body);
  }
  LLVM::BrOp::create(b, loc, ValueRange(), exit);
}

/// A thread's items begin at `lane` and are `step` apart; `rest` are its other
/// indices. Those from `end` on do not exist.
void Launch::buildItems(Block *exit, int64_t items, Value lane, Value step,
                        Value end, ArrayRef<Value> rest, Value allExist) {
  Block *before = b.getInsertionBlock();
  Block *single = b.createBlock(exit, {b.getI32Type()}, {loc});
  Block *run = b.createBlock(exit);
  Block *next = b.createBlock(exit);
  Block *all = b.createBlock(single);
  b.setInsertionPointToEnd(before);
  LLVM::CondBrOp::create(b, loc, allExist, all, ValueRange(), single,
                         ValueRange(lane));

  b.setInsertionPointToEnd(all);
  SmallVector<SmallVector<Value>> indices;
  for (Value first = lane; int64_t(indices.size()) < items;
       first = add(first, step)) {
    indices.push_back({first});
    llvm::append_range(indices.back(), rest);
  }
  cloneInterleaved(indices, single, lane, exit);

  b.setInsertionPointToEnd(single);
  Value index = single->getArgument(0);
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::slt, index, dims[0]),
                         run, ValueRange(), exit, ValueRange());
  b.setInsertionPointToEnd(run);
  LLVM::BrOp::create(b, loc, ValueRange(), next);
  b.setInsertionPointToStart(run);
  SmallVector<Value> indicesOfOne{index};
  llvm::append_range(indicesOfOne, rest);
  inlineBody(indicesOfOne);
  b.setInsertionPointToEnd(next);
  Value following = add(index, step);
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::slt, following, end),
                         single, ValueRange(following), exit, ValueRange());
  warp::setRecipe(entry, warp::getRecipe(entry).withItems(items));
}

/// Items a block apart along the only axis.
void Launch::buildStream(Block *first, Block *exit, int64_t items) {
  Type i32 = b.getI32Type();
  b.setInsertionPointToEnd(first);
  Value width = readSpecial("ntid", "x");
  Value start = mul(mul(readSpecial("ctaid", "x"), width),
                    constant(i32, items));
  Value lane = add(start, readSpecial("tid", "x"));
  Value end = add(start, mul(width, constant(i32, items)));
  buildItems(exit, items, lane, width, end, {},
             cmp(arith::CmpIPredicate::sle, end, dims[0]));
}

/// Items one after the other along the first of two or three axes.
void Launch::buildPlanes(Block *first, Block *exit, int64_t items) {
  Type i32 = b.getI32Type();
  b.setInsertionPointToEnd(first);
  SmallVector<Value> rest;
  Value inside;
  for (int64_t i = 1; i < rank; ++i) {
    rest.push_back(gridIndex(i == rank - 1 ? "x" : "y", i32));
    Value fits = cmp(arith::CmpIPredicate::slt, rest.back(), dims[i]);
    inside = inside ? arith::AndIOp::create(b, loc, inside, fits) : fits;
  }
  Block *exists = b.createBlock(exit);
  b.setInsertionPointToEnd(first);
  LLVM::CondBrOp::create(b, loc, inside, exists, ValueRange(), exit,
                         ValueRange());
  b.setInsertionPointToEnd(exists);
  Value start = mul(gridIndex(rank == 2 ? "y" : "z", i32), constant(i32, items));
  Value end = add(start, constant(i32, items));
  buildItems(exit, items, start, constant(i32, 1), end, rest,
             cmp(arith::CmpIPredicate::sle, end, dims[0]));
}
