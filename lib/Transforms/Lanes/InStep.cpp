//===- InStep.cpp - Loops that lanes go through in step -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "InStep.h"

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

void warp::leaveStep(FunctionOpInterface kernel) {
  SmallVector<MostTripsOp> trips;
  kernel->walk([&](MostTripsOp op) { trips.push_back(op); });
  if (trips.empty())
    return;
  SmallVector<scf::IfOp> branches;
  kernel->walk([&](scf::IfOp branch) {
    Operation *condition = branch.getCondition().getDefiningOp();
    if (condition && condition->hasAttr(attr::inStep))
      branches.push_back(branch);
  });
  for (scf::IfOp branch : branches)
    take(branch);
  for (MostTripsOp op : trips) {
    op.getResult().replaceAllUsesWith(op.getOwn());
    op.erase();
  }
}
