//===- OrderedReads.cpp - Recovery by comparison of indices ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `for k in range(n): y[i, k] = f(y[i, parent[k]])` writes each element once,
// in the order of its index. So the launch has left what the load read if the
// element came earlier, and a copy from before the launch has it otherwise:
//
//   v = y[i, p]   =>   v = p < k ? y[i, p] : copy of y[i, p]
//
// One comparison of indices tells the two apart, whatever memory the index
// comes from. No second run of the kernel is needed (MemoryLog.cpp). A launch
// without a copy asserts that each element came earlier. MemoryOrder.cpp
// decides for which loads that is so.
//
//===----------------------------------------------------------------------===//

#include "OrderedReads.h"

#include "Analysis/Effects.h"
#include "Analysis/Ranges.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Dominance.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;

namespace warp::autodiff {

/// The value at an earlier place of the code, computed again if need be; null
/// if that is more than arithmetic.
static Value computeBefore(Value value, Operation *place,
                           const DominanceInfo &dominance) {
  if (dominance.properlyDominates(value, place))
    return value;
  Operation *op = value.getDefiningOp();
  if (!op || !isPure(op) || op->getNumRegions() != 0)
    return nullptr;
  IRMapping map;
  for (Value operand : op->getOperands()) {
    Value before = computeBefore(operand, place, dominance);
    if (!before)
      return nullptr;
    map.map(operand, before);
  }
  Operation *clone = OpBuilder(place).clone(*op, map);
  return clone->getResult(cast<OpResult>(value).getResultNumber());
}

/// The index that an access means: one below zero counts from the end. Null if
/// that is not known.
static Value resolveIndex(OpBuilder &b, LoadOp load, const WriteOrder &order) {
  Value index = order.read;
  Location loc = load.getLoc();
  if (isNonNegative(index, load->getBlock()))
    return index;
  Type type = index.getType();
  if (type != b.getIntegerType(32, /*isSigned=*/true))
    return nullptr;
  Value zero = ConstantOp::create(b, loc, b.getIntegerAttr(type, 0));
  Value isNegative = createBuiltin(b, loc, "lt", {index, zero})->getResult(0);
  Value extent =
      DimOp::create(b, loc, type, rootOf(load.getArray()), order.axis);
  SmallVector<Value> sum{index, extent};
  Value fromEnd = AddOp::create(b, loc, TypeRange(type), sum)->getResult(0);
  return createBuiltin(b, loc, "where", {isNegative, fromEnd, index})
      ->getResult(0);
}

/// Compares the index of a load with that of the write; null if the writes
/// are not known to begin at zero or later.
static Value compareIndices(LoadOp load, const WriteOrder &order) {
  if (!isNonNegative(order.write, order.writer->getBlock()))
    return nullptr;
  DominanceInfo dominance(load->getParentOfType<func::FuncOp>());
  Value write = computeBefore(order.write, load, dominance);
  if (!write || write.getType() != order.read.getType())
    return nullptr;
  OpBuilder b(load);
  Value read = resolveIndex(b, load, order);
  if (!read)
    return nullptr;
  StringRef name = order.isDescending ? (order.isBefore ? "ge" : "gt")
                                      : (order.isBefore ? "le" : "lt");
  return createBuiltin(b, load.getLoc(), name, {read, write})->getResult(0);
}

OrderedReads findOrderedReads(func::FuncOp kernel,
                              const MemoryClasses &memory) {
  OrderedReads found;
  SmallVector<std::pair<LoadOp, WriteOrder>> loads;
  kernel.walk([&](LoadOp load) {
    std::string why;
    bool needsOneThread;
    if (memory.getRecovery(load, why, needsOneThread) != Recovery::Impossible)
      return;
    if (auto order = memory.getWriteOrder(load))
      loads.push_back({load, *order});
  });
  for (auto &[load, order] : loads)
    if (Value isWritten = compareIndices(load, order))
      found[load] = isWritten;
  return found;
}

} // namespace warp::autodiff
