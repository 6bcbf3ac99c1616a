//===- Cotangents.cpp - Cotangents of values, summed lazily ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Code that takes a matrix apart gives its cotangent one component at a time.
// Adding a matrix that is zero but for one component each time would cost the
// square of the number of components; so components are summed on their own
// and put together when somebody asks for the whole.
//
//===----------------------------------------------------------------------===//

#include "Cotangents.h"

#include "Analysis/Forms.h"
#include "Autodiff/Rules/Rules.h"

#include "WarpDialect/WarpOps.h"

using namespace mlir;

namespace warp::autodiff {

SmallVector<Value, 2> getSlotIndices(OpBuilder &builder, Location loc,
                                     Type type, int64_t slot) {
  SmallVector<Value, 2> indices;
  auto push = [&](int64_t index) {
    auto attr = builder.getIntegerAttr(builder.getIntegerType(32, true), index);
    indices.push_back(ConstantOp::create(builder, loc, attr));
  };
  if (auto matrix = dyn_cast<MatType>(type)) {
    push(slot / matrix.getCols());
    push(slot % matrix.getCols());
  } else {
    push(slot);
  }
  return indices;
}

std::optional<int64_t> getFirstSlot(ExtractOp op) {
  Type type = op.getSource().getType();
  auto matrix = dyn_cast<MatType>(type);
  int64_t extents[] = {matrix ? matrix.getRows() : getComponentCount(type),
                       matrix ? matrix.getCols() : 1};
  int64_t slot = 0;
  for (auto [i, index] : llvm::enumerate(op.getIndices())) {
    std::optional<int64_t> number = getConstantInteger(index);
    if (!number)
      return std::nullopt;
    if (*number < 0)
      *number += extents[i];
    if (*number < 0 || *number >= extents[i])
      return std::nullopt;
    slot += *number * (i == 0 ? extents[1] : 1);
  }
  return slot;
}

/// The composite with these components, and zero where there is none.
static Value combine(OpBuilder &builder, Location loc, Type type,
                     const std::map<int64_t, Value> &slots) {
  Value none = zero(builder, loc, getElementScalar(type));
  SmallVector<Value> components(getComponentCount(type), none);
  for (auto [slot, value] : slots)
    components[slot] = value;
  return ConstructOp::create(builder, loc, type, components);
}

void Cotangents::add(OpBuilder &builder, Location loc, Value primal,
                     Value cotangent) {
  if (!cotangent)
    return;
  Cotangent &sum = map[primal];
  sum.whole = autodiff::add(builder, loc, sum.whole, cotangent);
}

void Cotangents::addSlot(OpBuilder &builder, Location loc, Value primal,
                         int64_t slot, Value cotangent) {
  if (!cotangent)
    return;
  Value &sum = map[primal].slots[slot];
  sum = autodiff::add(builder, loc, sum, cotangent);
}

Cotangent Cotangents::takeParts(Value primal) {
  auto found = map.find(primal);
  if (found == map.end())
    return {};
  return std::exchange(found->second, {});
}

Value Cotangents::take(OpBuilder &builder, Location loc, Value primal) {
  Cotangent parts = takeParts(primal);
  if (parts.slots.empty())
    return parts.whole;
  Type type = differentialType(primal.getType());
  return autodiff::add(builder, loc, parts.whole,
                       combine(builder, loc, type, parts.slots));
}

bool Cotangents::isZero(Value primal) const {
  auto found = map.find(primal);
  return found == map.end() || found->second.isZero();
}

SmallVector<Value> Cotangents::getPrimals() const {
  SmallVector<Value> primals;
  for (auto &[primal, cotangent] : map)
    if (!cotangent.isZero())
      primals.push_back(primal);
  return primals;
}

} // namespace warp::autodiff
