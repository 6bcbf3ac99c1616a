//===- CheckTiles.cpp - What a block does together ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A condition differs between threads of a block if it comes from the number of
// the thread, from what a thread loads there, or from an atomic. What is loaded
// at the same index by all is the same. Of a block of one thread everything is.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "TileBuffers.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_CHECKTILES
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

namespace {

/// Values that may differ between the threads of a block.
class Varying {
public:
  explicit Varying(FunctionOpInterface kernel) {
    rank = warp::getVariant(kernel).getRank();
    // To a fixed point, as loops carry values backwards.
    bool changed = true;
    while (changed) {
      changed = false;
      kernel->walk([&](Operation *op) { changed |= visit(op); });
    }
  }
  bool contains(Value value) const { return values.contains(value); }

private:
  bool mark(ValueRange results) {
    bool changed = false;
    for (Value result : results)
      if (!isTile(result))
        changed |= values.insert(result).second;
    return changed;
  }

  bool anyOf(ValueRange operands) const {
    return llvm::any_of(operands, [&](Value v) { return contains(v); });
  }

  /// Of the indices of a thread only the last one differs within a block, if
  /// its extent is that of the block; that is what wp.launch_tiled makes.
  bool visit(Operation *op) {
    if (auto tid = dyn_cast<TidOp>(op))
      return mark(tid.getResults().drop_front(
          std::min<size_t>(rank - 1, tid.getNumResults())));
    if (isa<TileToThreadsOp, AtomicOp, AtomicCasOp>(op))
      return mark(op->getResults());
    if (isa<TileMapOp, TileFoldOp>(op))
      return false;
    if (op->getNumRegions() == 0)
      return !op->hasTrait<OpTrait::IsTerminator>() &&
             anyOf(op->getOperands()) && mark(op->getResults());
    bool changed = false;
    if (auto branch = dyn_cast<scf::IfOp>(op)) {
      bool differs = contains(branch.getCondition());
      for (auto [i, result] : llvm::enumerate(branch.getResults()))
        if (differs || contains(branch.thenYield().getOperand(i)) ||
            contains(branch.elseYield().getOperand(i)))
          changed |= mark(result);
    } else if (auto loop = dyn_cast<scf::ForOp>(op)) {
      bool differs = anyOf({loop.getLowerBound(), loop.getUpperBound(),
                            loop.getStep()});
      if (differs)
        changed |= mark(loop.getInductionVar());
      for (auto [init, argument, next, result] :
           llvm::zip(loop.getInitArgs(), loop.getRegionIterArgs(),
                     loop.getYieldedValues(), loop.getResults()))
        if (differs || contains(init) || contains(next)) {
          changed |= mark(argument);
          changed |= mark(result);
        }
    } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
      auto condition = loop.getConditionOp();
      for (auto [init, argument, next] :
           llvm::zip(loop.getInits(), loop.getBeforeArguments(),
                     loop.getYieldOp().getOperands()))
        if (contains(init) || contains(next))
          changed |= mark(argument);
      for (auto [value, argument, result] :
           llvm::zip(condition.getArgs(), loop.getAfterArguments(),
                     loop.getResults()))
        if (contains(condition.getCondition()) || contains(value)) {
          changed |= mark(argument);
          changed |= mark(result);
        }
    }
    return changed;
  }

  size_t rank;
  llvm::DenseSet<Value> values;
};

/// Elements may be read by any thread.
bool isCollective(Operation *op) {
  return computesTiles(op) && !isa<TileGetOp>(op);
}

/// The condition of a branch, or bound of a loop, that differs between threads.
Value findVaryingCondition(Operation *around, const Varying &varying) {
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
  Varying varying(kernel);
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
