//===- InStep.cpp - Lockstep loops of lanes -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "InStep.h"

#include "Updates/Atomics.h"
#include "WarpDialect/LaneOps.h"
#include "WarpDialect/Passes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

/// Puts the arm of a branch that is always taken in its place.
static void take(scf::IfOp branch) {
  Block *arm = branch.thenBlock();
  Operation *yield = arm->getTerminator();
  branch.replaceAllUsesWith(yield->getOperands());
  branch->getBlock()->getOperations().splice(branch->getIterator(),
                                             arm->getOperations(), arm->begin(),
                                             yield->getIterator());
  branch.erase();
}

static bool isInStep(scf::IfOp branch) {
  Operation *condition = branch.getCondition().getDefiningOp();
  return condition && condition->hasAttr(warp::attr::inStep);
}

bool warp::updatesInStep(FunctionOpInterface kernel) {
  return kernel
      ->walk([](AtomicComponentsOp op) {
        if (getUpdate(op).getScope() != UpdateScope::lanes)
          return WalkResult::advance();
        for (auto branch = op->getParentOfType<scf::IfOp>(); branch;
             branch = branch->getParentOfType<scf::IfOp>())
          if (isInStep(branch))
            return WalkResult::interrupt();
        return WalkResult::advance();
      })
      .wasInterrupted();
}

void warp::leaveStep(FunctionOpInterface kernel) {
  SmallVector<MostTripsOp> trips;
  kernel->walk([&](MostTripsOp op) { trips.push_back(op); });
  if (trips.empty())
    return;
  SmallVector<scf::IfOp> branches;
  kernel->walk([&](scf::IfOp branch) {
    if (isInStep(branch))
      branches.push_back(branch);
  });
  for (scf::IfOp branch : branches)
    take(branch);
  for (MostTripsOp op : trips) {
    op.getResult().replaceAllUsesWith(op.getOwn());
    op.erase();
  }
}
