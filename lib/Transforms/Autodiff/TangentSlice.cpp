//===- TangentSlice.cpp - Forward slice of a result -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/TangentSlice.h"

#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;
using namespace warp;
using namespace warp::autodiff;

std::optional<bool> TangentSlice::depends(Value value) {
  if (value == values)
    return true;
  if (auto found = known.find(value); found != known.end())
    return found->second;
  std::optional<bool> answer = false;
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    // Values that a loop around the origin carries belong to another iteration.
    Operation *parent = argument.getOwner()->getParentOp();
    if (!parent->isProperAncestor(origin))
      answer = std::nullopt;
  } else if (differentialType(value.getType())) {
    answer = dependsBy(value.getDefiningOp());
  }
  known[value] = answer;
  return answer;
}

std::optional<bool> TangentSlice::dependsBy(Operation *op) {
  if (op == origin)
    return false;
  bool any = false;
  auto look = [&](Value operand) {
    std::optional<bool> answer = depends(operand);
    any |= answer.value_or(true);
    return answer.has_value();
  };
  if (op->getNumRegions() != 0) {
    // None that has a part in it.
    WalkResult result = op->walk([&](Operation *inner) {
      for (Value operand : inner->getOperands())
        if (!op->isAncestor(operand.getParentBlock()->getParentOp()) &&
            (!look(operand) || any))
          return WalkResult::interrupt();
      return WalkResult::advance();
    });
    if (result.wasInterrupted())
      return std::nullopt;
    return false;
  }
  for (Value operand : op->getOperands())
    if (!look(operand))
      return std::nullopt;
  if (!any)
    return false;
  if (!isMemoryEffectFree(op) || !hasRule(op))
    return std::nullopt;
  ops.insert(op);
  return true;
}

SmallVector<Value> TangentSlice::getTangents(RuleContext &context,
                                             ValueRange ends, Value seed,
                                             bool &failed) const {
  DenseMap<Value, Value> tangents = {{values, seed}};
  for (Operation *op : ops) {
    SmallVector<Value> seeds = llvm::map_to_vector(
        op->getOperands(), [&](Value v) { return tangents.lookup(v); });
    auto found =
        pushforward(context, op, op->getOperands(), op->getResults(), seeds);
    if (mlir::failed(found)) {
      failed = true;
      return {};
    }
    for (auto [result, tangent] : llvm::zip_equal(op->getResults(), *found))
      tangents[result] = tangent;
  }
  return llvm::map_to_vector(ends, [&](Value v) { return tangents.lookup(v); });
}
