//===- CheckTiles.cpp - Uniformity of tile operations -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A condition may not differ between the threads of a block (BlockVariance.h).
// None does in a block of one thread.
//
//===----------------------------------------------------------------------===//

#include "BlockVariance.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_CHECKTILES
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

namespace {

/// The condition of a branch, or bound of a loop, that differs between threads.
Value findVaryingCondition(Operation *around, const BlockVariance &varying) {
  SmallVector<Value> conditions;
  if (auto branch = dyn_cast<scf::IfOp>(around))
    conditions = {branch.getCondition()};
  else if (auto loop = dyn_cast<scf::WhileOp>(around))
    conditions = {loop.getConditionOp().getCondition()};
  else if (auto loop = dyn_cast<scf::ForOp>(around))
    conditions = {loop.getLowerBound(), loop.getUpperBound()};
  for (Value condition : conditions)
    if (varying.contains(condition))
      return condition;
  return nullptr;
}

LogicalResult check(FunctionOpInterface kernel, int64_t threads) {
  if (threads == 1)
    return success();
  BlockVariance varying(kernel);
  auto result = kernel->walk([&](Operation *op) {
    if (!isCollective(op))
      return WalkResult::advance();
    for (Operation *around = op->getParentOp(); around != kernel;
         around = around->getParentOp()) {
      Value condition = findVaryingCondition(around, varying);
      if (!condition)
        continue;
      auto diagnostic = op->emitError(
          "all threads of a block have to come by here, but this stands under "
          "a condition that differs between them; move it out");
      diagnostic.attachNote(condition.getLoc()) << "the condition";
      return WalkResult::interrupt();
    }
    return WalkResult::advance();
  });
  return failure(result.wasInterrupted());
}

struct CheckTiles : warp::impl::CheckTilesBase<CheckTiles> {
  void runOnOperation() override {
    if (failed(forTileKernel(getOperation(), check)))
      signalPassFailure();
  }
};

} // namespace
