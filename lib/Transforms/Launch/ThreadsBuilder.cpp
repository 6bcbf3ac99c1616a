//===- ThreadsBuilder.cpp - Code that runs threads of a group -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "ThreadsBuilder.h"

#include "Updates/Atomics.h"

#include "mlir/IR/IRMapping.h"

using namespace mlir;
using warp::ThreadsBuilder;

ThreadsBuilder::Values ThreadsBuilder::identities(bool inLanes) {
  Values values;
  for (auto [kind, type] :
       llvm::zip_equal(threads.getKinds(),
                       threads.getTypes().getAsValueRange<TypeAttr>())) {
    Value one = warp::identity(b, loc, warp::AtomicKind(kind), type);
    if (inLanes)
      one = warp::BroadcastOp::create(
          b, loc, VectorType::get(threads.getWidth(), one.getType()), one);
    values.push_back(one);
  }
  return values;
}

ThreadsBuilder::Values ThreadsBuilder::combine(ValueRange sums,
                                               ValueRange terms) {
  Values combined;
  for (auto [kind, type, sum, term] : llvm::zip_equal(
           threads.getKinds(), threads.getTypes().getAsValueRange<TypeAttr>(),
           sums, terms))
    combined.push_back(warp::combine(b, loc, warp::AtomicKind(kind), sum, term,
                                     type, /*anyOrder=*/true));
  return combined;
}

ThreadsBuilder::Values ThreadsBuilder::cloneThread(ValueRange indices,
                                                   Value live) {
  IRMapping map;
  for (auto [argument, index] : llvm::zip_equal(this->indices(), indices))
    map.map(argument, narrow(index, argument.getType()));
  if (live)
    map.map(threads.getLive(), live);
  for (Operation &op : thread->without_terminator())
    b.clone(op, map);
  return llvm::map_to_vector(thread->getTerminator()->getOperands(),
                             [&](Value v) { return map.lookupOrDefault(v); });
}

ThreadsBuilder::Values ThreadsBuilder::takeThread(ValueRange indices) {
  for (auto [argument, index] : llvm::zip_equal(this->indices(), indices)) {
    Value thisIndex = argument;
    thisIndex.replaceAllUsesWith(narrow(index, argument.getType()));
  }
  b.getInsertionBlock()->getOperations().splice(
      b.getInsertionPoint(), thread->getOperations(), thread->begin(),
      std::prev(thread->end()));
  return Values(thread->getTerminator()->getOperands());
}

ThreadsBuilder::Values ThreadsBuilder::unravel(Value linear, int count) {
  Values indices(count);
  for (int d = count - 1; d > 0; --d) {
    Value extent = narrow(dims[d], linear.getType());
    Value rest = div(linear, extent);
    indices[d] = sub(linear, mul(rest, extent));
    linear = rest;
  }
  indices[0] = linear;
  return indices;
}

Value ThreadsBuilder::countAll() {
  Type i64 = b.getI64Type();
  Value total = narrow(dims[0], i64);
  for (Value extent : ArrayRef(dims).drop_front())
    total = mul(total, narrow(extent, i64));
  return total;
}

Value ThreadsBuilder::narrow(Value x, Type type) {
  unsigned from = x.getType().getIntOrFloatBitWidth();
  unsigned to = type.getIntOrFloatBitWidth();
  if (from == to)
    return x;
  if (from < to)
    return arith::ExtUIOp::create(b, loc, type, x);
  return arith::TruncIOp::create(b, loc, type, x, noWrap);
}
