//===- LowerLaunchGpu.cpp - One thread of a GPU launch ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A thread finds its indices on the axes of the grid and returns if the launch
// does not have them.
//
// Where that pays, it takes several indices, not one (LowerLaunchItems.cpp).
//
//===----------------------------------------------------------------------===//

#include "Updates/Atomics.h"
#include "GpuBlock.h"
#include "LowerLaunch.h"
#include "WarpDialect/ParameterLayout.h"

using namespace mlir;
using warp::Launch;

/// A special register of the grid.
Value Launch::readSpecial(StringRef name, StringRef axis) {
  return warp::readSpecial(b, loc, (name + "." + axis).str());
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

/// The only block of the launch; its threads take turns at the indices, so that
/// which thread runs which index does not depend on the card.
void Launch::buildOneBlock(Block *first, Block *exit) {
  Type i64 = b.getI64Type();
  Block *loop = b.createBlock(exit, {i64}, {loc});
  b.setInsertionPointToEnd(first);
  Value begin = narrow(readSpecial("tid", "x"), i64);
  Value step = narrow(readSpecial("ntid", "x"), i64);
  Value total = narrow(dims[0], i64);
  for (Value extent : ArrayRef(dims).drop_front())
    total = mul(total, narrow(extent, i64));
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::slt, begin, total),
                         loop, ValueRange(begin), exit, ValueRange());
  b.setInsertionPointToStart(loop);
  Value index = loop->getArgument(0);
  inlineBody(unravel(index, rank));
  b.setInsertionPointToEnd(loop);
  Value next = add(index, step);
  LLVM::CondBrOp::create(b, loc, cmp(arith::CmpIPredicate::slt, next, total),
                         loop, ValueRange(next), exit, ValueRange());
  warp::setRecipe(entry, warp::getRecipe(entry).withExclusive());
}

void Launch::buildGpu() {
  Block *first = b.getInsertionBlock();
  Block *exit = b.createBlock(&entry.getBody());
  if (warp::getVariant(kernel).isDeterministic() &&
      warp::hasOrderedUpdates(kernel))
    buildOneBlock(first, exit);
  else if (int64_t items = chooseItems(); items > 1)
    rank == 1 ? buildStream(first, exit, items)
              : buildPlanes(first, exit, items);
  else
    buildOneItem(first, exit);
  b.setInsertionPointToEnd(exit);
  LLVM::ReturnOp::create(b, loc, ValueRange());
}
