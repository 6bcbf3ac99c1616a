//===- Cost.cpp - Cost estimate of one thread -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The runtime decides from this whether a launch is worth waking its threads.
//
//===----------------------------------------------------------------------===//

#include "Analysis/CostModel.h"
#include "Compilation.h"

#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace {
/// Adds up operations; those of a function that is called are counted once.
class Counter {
public:
  explicit Counter(ModuleOp module) : module(module) {}
  double costOf(Region &region);

private:
  double costOf(Operation *op);
  double costOfCallee(func::CallOp call);

  ModuleOp module;
  llvm::DenseMap<Operation *, double> functions;
};
} // namespace

double Counter::costOf(Region &region) {
  double sum = 0;
  for (Block &block : region)
    for (Operation &op : block)
      sum += costOf(&op);
  return sum;
}

double Counter::costOfCallee(func::CallOp call) {
  auto callee = module.lookupSymbol<func::FuncOp>(call.getCallee());
  if (!callee)
    return 0;
  auto known = functions.find(callee);
  if (known != functions.end())
    return known->second;
  double sum = costOf(callee.getBody());
  functions[callee] = sum;
  return sum;
}

double Counter::costOf(Operation *op) {
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
  if (auto call = dyn_cast<func::CallOp>(op))
    inside = costOfCallee(call);
  for (Region &region : op->getRegions())
    inside += costOf(region);
  if (isa<scf::ForOp, scf::WhileOp>(op))
    inside *= warp::cost::loopTrips;
  return 1 + inside;
}

double warp::estimateCost(ModuleOp module) {
  double cost = 0;
  for (auto function : module.getOps<func::FuncOp>())
    if (function->hasAttr(kernelAttrName))
      cost += 1 + Counter(module).costOf(function.getBody());
  return cost;
}
