//===- UpdateCosts.cpp - Costs of the updates of a kernel -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "UpdateCosts.h"

#include "Analysis/CostModel.h"
#include "Atomics.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
namespace cost = warp::cost;

/// How often an operation runs per thread, as the estimate of cost has it.
static double estimatedTrips(Operation *op) {
  double trips = 1;
  for (Operation *parent = op->getParentOp(); parent;
       parent = parent->getParentOp())
    if (isa<scf::ForOp, scf::WhileOp>(parent))
      trips *= cost::loopTrips;
  return trips;
}

void warp::UpdateCosts::add(double updates, double share, double plainCost,
                            double atomicCost) {
  estimated += cost::atomic * updates;
  plain += plainCost * updates * share;
  atomic += atomicCost * updates * share;
}

warp::UpdateCosts::UpdateCosts(ThreadsOp threads, int64_t operations,
                               int64_t lanes) {
  threads.walk([&](AtomicComponentsOp op) {
    UpdateAttr plan = getUpdate(op);
    bool isForGroup = plan.getScope() == UpdateScope::group;
    double updates = double(op.getComponents().size()) * estimatedTrips(op);
    if (plan.isExact())
      return add(updates, 1, cost::exactSum,
                 isForGroup ? cost::exactSum : cost::atomicExactSum);
    if (isForGroup)
      return;
    bool together = plan.getScope() == UpdateScope::lanes && plan.getRun() == 0;
    add(updates, together ? 1.0 / double(lanes) : 1, cost::plainUpdate,
        cost::atomic);
  });
  threads.walk([&](AtomicCasOp op) {
    add(estimatedTrips(op), 1, cost::plainUpdate, cost::atomic);
  });
  // Two operations take one cycle.
  double rest = std::max(0.0, double(operations) - estimated) / 2;
  if (lanes > 1)
    rest /= cost::gainOfLanes;
  plain += rest;
  atomic += rest;
}
