//===- Cost.cpp - How much work one thread is -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The runtime decides from this whether a launch is worth waking its threads.
//
//===----------------------------------------------------------------------===//

#include "Analysis/CostModel.h"
#include "Compilation.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

static double costOf(Operation *op);

static double costOf(Region &region) {
  double sum = 0;
  for (Block &block : region)
    for (Operation &op : block)
      sum += costOf(&op);
  return sum;
}

static double costOf(Operation *op) {
  if (isa<math::MathDialect>(op->getDialect()))
    return warp::cost::function;
  if (auto access = dyn_cast<warp::AccessOp>(op)) {
    size_t components =
        std::max(access.getRead().size(), access.getWritten().size());
    return access.isUpdate() ? warp::cost::atomic * components : components;
  }
  if (op->hasTrait<OpTrait::ConstantLike>())
    return 0;
  double inside = 0;
  for (Region &region : op->getRegions())
    inside += costOf(region);
  if (isa<scf::ForOp, scf::WhileOp>(op))
    inside *= warp::cost::loopTrips;
  return 1 + inside;
}

double warp::estimateCost(ModuleOp module) {
  return costOf(module.getBodyRegion());
}
