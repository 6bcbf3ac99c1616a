//===- SameArrays.cpp - Aliasing of kernel arguments ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch may get one array as several arguments. A derivative that took them
// for different ones would read what the launch has overwritten by another
// name, and would not see that threads conflict. So the derivative is made of a
// kernel with one argument for all of them, of which everything is known that
// is known of any array that is read and written. The others stay, unused. A
// struct with such an array becomes one with the array that is used.
//
//===----------------------------------------------------------------------===//

#include "SameArrays.h"

#include "Analysis/ArrayOrigins.h"

#include "WarpDialect/WarpOps.h"

using namespace mlir;

namespace {

class Joining {
public:
  Joining(func::FuncOp kernel, ArrayRef<int> same)
      : kernel(kernel), same(same), leaves(kernel),
        b(OpBuilder::atBlockBegin(&kernel.getBody().front())) {}

  LogicalResult run();

private:
  Value find(unsigned leaf);
  Value find(Value value, unsigned number);
  Value rebuild(Value value, unsigned first);
  bool isJoined(Type type, unsigned first) const;

  func::FuncOp kernel;
  ArrayRef<int> same;
  warp::ArrayLeaves leaves;
  OpBuilder b;
};

} // namespace

/// The array with a number as the kernel gets it.
Value Joining::find(unsigned leaf) {
  for (BlockArgument argument : llvm::reverse(kernel.getArguments())) {
    unsigned first = leaves.getFirst(argument.getArgNumber());
    if (first <= leaf && leaf - first < warp::countArrays(argument.getType()))
      return find(argument, leaf - first);
  }
  return {};
}

/// Array `number` of a value.
Value Joining::find(Value value, unsigned number) {
  auto type = dyn_cast<warp::StructType>(value.getType());
  if (!type)
    return value;
  for (auto [name, field] :
       llvm::zip(type.getFieldNames(), type.getFieldTypes())) {
    unsigned count = warp::countArrays(field);
    if (number < count)
      return find(
          warp::StructGetOp::create(b, value.getLoc(), field, value, name),
          number);
    number -= count;
  }
  return {};
}

/// True if another array is to be used for one of a value's, the first of which
/// has a number.
bool Joining::isJoined(Type type, unsigned first) const {
  for (unsigned i = 0, end = warp::countArrays(type); i < end; ++i)
    if (same[first + i] != int(first + i))
      return true;
  return false;
}

/// A value with the arrays that are to be used.
Value Joining::rebuild(Value value, unsigned first) {
  if (!isJoined(value.getType(), first))
    return value;
  auto type = dyn_cast<warp::StructType>(value.getType());
  if (!type)
    return find(unsigned(same[first]));
  Location loc = value.getLoc();
  SmallVector<Value> fields;
  for (auto [name, field] :
       llvm::zip(type.getFieldNames(), type.getFieldTypes())) {
    Value read = warp::StructGetOp::create(b, loc, field, value, name);
    fields.push_back(rebuild(read, first));
    first += warp::countArrays(field);
  }
  return warp::StructCreateOp::create(b, loc, type, fields);
}

LogicalResult Joining::run() {
  SmallVector<std::pair<BlockArgument, Value>> replaced;
  for (auto [i, array] : llvm::enumerate(same)) {
    Value own = find(unsigned(i)), used = find(unsigned(array));
    if (!own || !used || own.getType() != used.getType())
      return kernel.emitError("array ")
             << i << " has another type than array " << array;
  }
  Operation *end = &*b.getInsertionPoint();
  for (BlockArgument argument : kernel.getArguments()) {
    unsigned first = leaves.getFirst(argument.getArgNumber());
    if (Value made = rebuild(argument, first); made != argument)
      replaced.push_back({argument, made});
  }
  for (auto [argument, made] : replaced)
    argument.replaceUsesWithIf(made, [&](OpOperand &use) {
      Operation *user = use.getOwner();
      return user->getBlock() != end->getBlock() || !user->isBeforeInBlock(end);
    });
  return success();
}

LogicalResult warp::joinSameArrays(func::FuncOp kernel,
                                   const std::vector<int> &same) {
  return Joining(kernel, same).run();
}
