//===- InlinePullbacks.cpp - Inlining of pullbacks ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions with a derivative of their own have been calls up to here. Once
// they and their pullbacks are inlined, it is known which arrays the latter
// add gradients to: the kernel's, perhaps through views. The gradient of a view
// becomes the view of the gradient. An array without a gradient has no memory
// for one, so what is added to it goes away, and what is read of it is zero.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "Activity.h"
#include "Autodiff/Rules/Rules.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Iterators.h"
#include "mlir/Pass/PassManager.h"
#include "mlir/Transforms/Passes.h"

namespace warp {
#define GEN_PASS_DEF_INLINEPULLBACKS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// The gradient of an array that is a view of one with a gradient.
static Value gradientOf(OpBuilder &b, Value array) {
  auto op = array.getDefiningOp<warp::ArrayViewOp>();
  if (!op)
    return warp::GradOp::create(b, array.getLoc(), array);
  IRMapping map;
  map.map(op.getArray(), gradientOf(b, op.getArray()));
  Operation *view = b.clone(*op, map);
  auto type = cast<warp::ArrayType>(array.getType());
  view->getResult(0).setType(
      warp::ArrayType::get(type.getContext(), type.getRank(),
                           warp::getGradientElement(type.getElementType())));
  return view->getResult(0);
}

/// Erases accesses to the gradients of an array that has none. Their extents
/// and strides, which lie in the array's descriptor, may be asked for; native
/// code gets a null pointer.
static LogicalResult eraseAccesses(Value gradients) {
  for (Operation *user : llvm::make_early_inc_range(gradients.getUsers())) {
    if (isa<warp::DimOp, warp::StrideOp>(user))
      continue;
    if (isa<warp::PointerOp>(user)) {
      OpBuilder b(user);
      user->getResult(0).replaceAllUsesWith(warp::autodiff::zero(
          b, user->getLoc(), user->getResult(0).getType()));
      user->erase();
      continue;
    }
    auto access = dyn_cast<warp::AccessOp>(user);
    if (isa<warp::ArrayViewOp>(user)) {
      if (failed(eraseAccesses(user->getResult(0))))
        return failure();
    } else if (!access || (access.isUpdate() && !access.getCombination())) {
      return user->emitError("'") << user->getName() << "' cannot be applied "
                                  << "to the gradients of an array";
    }
    OpBuilder b(user);
    if (access)
      for (Value result : access.getRead())
        if (!result.use_empty())
          result.replaceAllUsesWith(
              warp::autodiff::zero(b, user->getLoc(), result.getType()));
    if (user->use_empty())
      user->erase();
  }
  return success();
}

/// Functions that stay only compute values, which the adjoint may not need.
static void eraseUnusedCalls(ModuleOp module) {
  SymbolTable symbols(module);
  module.walk<WalkOrder::PostOrder, ReverseIterator>([&](Operation *op) {
    if (isa<func::CallOp>(op) ? op->use_empty() : isOpTriviallyDead(op)) {
      auto call = dyn_cast<func::CallOp>(op);
      Operation *callee = call ? symbols.lookup(call.getCallee()) : nullptr;
      if (!call || (callee && callee->hasAttr(warp::attr::kept)))
        op->erase();
    }
  });
}

namespace {

struct InlinePullbacks : warp::impl::InlinePullbacksBase<InlinePullbacks> {
  using InlinePullbacksBase::InlinePullbacksBase;

  void runOnOperation() override;
  LogicalResult settle(warp::GradOp grad,
                       const warp::ArrayLeaves &leaves);
};

} // namespace

void InlinePullbacks::runOnOperation() {
  ModuleOp module = getOperation();
  if (llvm::hasSingleElement(module.getOps<func::FuncOp>()))
    return;
  for (auto function : module.getOps<func::FuncOp>())
    if (!function->hasAttr(warp::attr::kept))
      function.removeNoInlineAttr();
  OpPassManager pm(ModuleOp::getOperationName());
  pm.addPass(createInlinerPass({}, [](OpPassManager &) {}));
  pm.addPass(createSymbolDCEPass());
  pm.addPass(createCSEPass());
  eraseUnusedCalls(module);
  FunctionOpInterface kernel;
  if (failed(runPipeline(pm, module)) || !(kernel = warp::findKernel(module)))
    return signalPassFailure();
  warp::ArrayLeaves leaves(kernel);
  SmallVector<warp::GradOp> grads;
  kernel->walk([&](warp::GradOp op) { grads.push_back(op); });
  for (warp::GradOp grad : grads)
    if (failed(settle(grad, leaves)))
      return signalPassFailure();
}

LogicalResult
InlinePullbacks::settle(warp::GradOp grad,
                        const warp::ArrayLeaves &leaves) {
  SmallVector<unsigned, 1> leaf = leaves.of(grad.getArray());
  if (leaf.size() != 1)
    return grad.emitError("cannot tell which array this gradient is of");
  bool isActive = leaf[0] >= active.size() || active[leaf[0]] == '1';
  if (isActive) {
    OpBuilder b(grad);
    Value gradient = gradientOf(b, grad.getArray());
    grad.replaceAllUsesWith(gradient);
  } else if (failed(eraseAccesses(grad))) {
    return failure();
  }
  if (grad->use_empty())
    grad.erase();
  return success();
}
