//===- Derivation.cpp - Derivatives on request of passes ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Derivation.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

using namespace mlir;

static warp::autodiff::Derive current = nullptr;

void warp::autodiff::setDerive(Derive pipeline) { current = pipeline; }

LogicalResult warp::autodiff::derive(ModuleOp module,
                                     const AutodiffOptions &options) {
  assert(current && "the compiler has not been set up");
  return current(module, options);
}

void warp::autodiff::keepCalls(ModuleOp module, bool keep) {
  for (auto function : module.getOps<func::FuncOp>()) {
    if (function->hasAttr(warp::attr::kept) ||
        (!function->hasAttr(warp::attr::vjp) &&
         !function->hasAttr(warp::attr::replay)))
      continue;
    if (keep)
      function.setNoInline(true);
    else
      function.removeNoInlineAttr();
  }
}

void warp::autodiff::callBodies(ModuleOp module) {
  SmallVector<func::CallOp> calls;
  module.walk([&](func::CallOp call) {
    auto callee = module.lookupSymbol<func::FuncOp>(call.getCallee());
    auto count =
        callee ? callee->getAttrOfType<IntegerAttr>(attr::residuals) : nullptr;
    if (count && !llvm::all_of(call.getResults().take_back(count.getInt()),
                               [](OpResult v) { return v.use_empty(); }))
      calls.push_back(call);
  });
  for (func::CallOp call : calls) {
    auto callee = module.lookupSymbol<func::FuncOp>(call.getCallee());
    std::string name = (callee.getName() + "_body").str();
    if (!module.lookupSymbol(name)) {
      func::FuncOp body = callee.clone();
      body.setName(name);
      for (StringRef attribute :
           {attr::vjp, attr::jvp, attr::replay, attr::residuals})
        body->removeAttr(attribute);
      module.insert(callee, body);
    }
    call.setCallee(name);
  }
}
