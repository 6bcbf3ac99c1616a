//===- RingLoop.cpp - Loops that a ring reduction applies to --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The order of iterations is open if the loop does nothing to memory but load
// and update in ways that commute, and what it carries are integer sums or such
// whose order is declared open (`reassoc`), as cotangents are.
//
//===----------------------------------------------------------------------===//

#include "RingLoop.h"

#include "Launch/LoopSums.h"
#include "LoopSchedule.h"
#include "Updates/Atomics.h"

using namespace mlir;
using warp::RingLoop;

/// True if nothing in the loop does to memory what iterations could see of each
/// other. An array that a commuting update names is not accessed otherwise.
bool RingLoop::isOrderOpen() {
  WalkResult result = loop.getBody()->walk([&](Operation *op) {
    auto update = dyn_cast<warp::AtomicComponentsOp>(op);
    bool open = update
                    ? warp::commutes(update)
                    : isa<warp::LoadComponentsOp>(op) ||
                          op->hasTrait<OpTrait::HasRecursiveMemoryEffects>() ||
                          isMemoryEffectFree(op);
    return open ? WalkResult::advance() : WalkResult::interrupt();
  });
  return !result.wasInterrupted();
}

/// True if each lane walks along a row, and others along other rows.
static bool isAlongRow(warp::AtomicComponentsOp op,
                       const warp::ThreadVariance &variance) {
  auto isUniform = [&](Value index) {
    return variance.isUniform(index, warp::Scope::Lanes);
  };
  OperandRange indices = op.getIndices();
  return indices.size() > 1 && isUniform(indices.back()) &&
         !llvm::all_of(indices.drop_back(), isUniform);
}

/// Finds updates of one element per iteration, the same for all threads. Sums
/// of fewer than 32 bits would round. Updates that depend on the thread and the
/// iteration would no longer be coalesced; those along rows of threads are not.
bool RingLoop::collectUpdates(const ThreadVariance &variance) {
  bool wouldScatter = false;
  loop.getBody()->walk([&](warp::AtomicComponentsOp op) {
    Operation *parent = op->getParentOp();
    while (isa<scf::IfOp>(parent))
      parent = parent->getParentOp();
    bool differs = false;
    auto isKnown = [&](Value index) {
      std::optional<int64_t> stride =
          variance.strideIfEqual(index, loop, compared);
      differs |= stride.value_or(0) != 0;
      return stride.has_value();
    };
    if (parent != loop ||
        variance.strideIfEqual(op.getArray(), loop, compared) != 0 ||
        !warp::canCombine(op) || !llvm::all_of(op.getIndices(), isKnown) ||
        !differs) {
      wouldScatter |= !isAlongRow(op, variance) &&
                      !llvm::all_of(op.getIndices(), [&](Value index) {
                        return loop.isDefinedOutsideOfLoop(index);
                      });
      return;
    }
    updates.push_back(op);
  });
  return !updates.empty() && !wouldScatter;
}

bool RingLoop::qualifies(const ThreadVariance &variance) {
  return warp::hasWarpTiles(loop, variance, compared) && isOrderOpen() &&
         carriesSums(loop, anyOrder) && collectUpdates(variance);
}
