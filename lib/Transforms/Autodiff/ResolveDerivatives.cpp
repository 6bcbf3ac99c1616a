//===- ResolveDerivatives.cpp - Derivatives called by kernels -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Replaces `warp.vjp @f` and `warp.jvp @f` by calls of functions that compute
// them. If @f has a derivative of its own, that is the one for `warp.vjp`; else
// the function is made by the same passes as the derivative of a kernel, from
// a kernel around @f (FunctionKernel.h). So all that kernels can do has a
// derivative here as well, and there is one engine. The result is ordinary
// code, and may be differentiated once more.
//
// A launch of the primal needs no derivatives: those of functions that are
// merely called are dropped, together with all that nobody calls.
//
//===----------------------------------------------------------------------===//

#include "Analysis/Effects.h"
#include "Autodiff/Rules/Rules.h"
#include "Derivation.h"
#include "FunctionKernel.h"
#include "KernelFunction.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Pass/PassManager.h"

#include "llvm/ADT/SetVector.h"

namespace warp {
#define GEN_PASS_DEF_RESOLVEDERIVATIVES
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

static func::FuncOp lookup(ModuleOp module, Attribute symbol) {
  auto name = dyn_cast_or_null<FlatSymbolRefAttr>(symbol);
  return name ? module.lookupSymbol<func::FuncOp>(name.getValue()) : nullptr;
}

//===----------------------------------------------------------------------===//
// Required derivatives
//===----------------------------------------------------------------------===//

namespace {

/// The functions that a kernel needs, callees before callers, and whether
/// their derivatives are needed too: for forward mode as they are, for reverse
/// mode complete.
struct Reached {
  Reached(ModuleOp module, bool reverse, bool forward)
      : module(module), forward(forward) {
    for (auto function : module.getOps<func::FuncOp>())
      if (!function.isPrivate())
        visit(function, reverse);
  }

  void visit(func::FuncOp function, bool differentiated) {
    auto [place, isNew] = isDifferentiated.insert({function, differentiated});
    if (!isNew && (place->second || !differentiated))
      return;
    place->second = differentiated;
    function.walk([&](Operation *op) {
      if (auto call = dyn_cast<func::CallOp>(op))
        visitSymbol(call.getCalleeAttr(), differentiated);
      else if (auto vjp = dyn_cast<warp::VjpOp>(op))
        visitSymbol(vjp.getCalleeAttr(), /*differentiated=*/true);
      else if (auto jvp = dyn_cast<warp::JvpOp>(op))
        visitSymbol(jvp.getCalleeAttr(), differentiated);
    });
    if (differentiated || forward) {
      visitSymbol(function->getAttr(warp::attr::vjp), differentiated);
      visitSymbol(function->getAttr(warp::attr::jvp), differentiated);
    }
    if (differentiated)
      visitSymbol(function->getAttr(warp::attr::replay), true);
    if (isNew)
      order.push_back(function);
  }

  void visitSymbol(Attribute symbol, bool differentiated) {
    if (func::FuncOp function = lookup(module, symbol))
      visit(function, differentiated);
  }

  ModuleOp module;
  bool forward;
  SmallVector<func::FuncOp> order;
  llvm::DenseMap<func::FuncOp, bool> isDifferentiated;
};

} // namespace

static void prune(ModuleOp module, const Reached &reached) {
  for (auto function :
       llvm::make_early_inc_range(module.getOps<func::FuncOp>())) {
    auto found = reached.isDifferentiated.find(function);
    if (found == reached.isDifferentiated.end()) {
      function.erase();
    } else if (!found->second) {
      function->removeAttr(warp::attr::replay);
      if (!reached.forward)
        for (StringRef attribute :
             {warp::attr::vjp, warp::attr::jvp, warp::attr::residuals})
          function->removeAttr(attribute);
    }
  }
}

//===----------------------------------------------------------------------===//
// The pass
//===----------------------------------------------------------------------===//

namespace {

/// The inputs that a function is differentiated by.
struct Request {
  bool forward = false;
  /// Reverse mode: gradients of arrays are added to.
  bool arrays = false;
  /// How many differentiable arguments have tangents, or gradients that are
  /// used; the others are constants.
  unsigned boxes = ~0u;
  /// A derivative with notices is refused: calls have nobody to give them to.
  bool silent = false;
};

struct ResolveDerivatives
    : warp::impl::ResolveDerivativesBase<ResolveDerivatives> {
  using ResolveDerivativesBase::ResolveDerivativesBase;

  void runOnOperation() override;
  LogicalResult resolveAll();
  LogicalResult resolve(Operation *op);
  LogicalResult resolveVjp(warp::VjpOp op);
  LogicalResult resolveJvp(warp::JvpOp op);
  LogicalResult resolveCustom(warp::VjpOp op, func::FuncOp callee);
  LogicalResult addMissing(func::FuncOp function);
  void keepDerivative(func::FuncOp function);
  FailureOr<func::FuncOp> withoutEffects(func::FuncOp function);
  FailureOr<func::FuncOp> withoutGradients(func::FuncOp pullback);
  /// The derivative of a function that has none of its own, made once.
  FailureOr<func::FuncOp> derive(func::FuncOp function, Request request);
  LogicalResult differentiate(ModuleOp module, func::FuncOp function,
                              Request request);
  OwningOpRef<ModuleOp> copyFunctions();
  OwningOpRef<ModuleOp> copyCalled(func::FuncOp function);
  std::string keyOf(func::FuncOp function, StringRef what) {
    return (function.getName() + "/" + what).str();
  }

  llvm::StringMap<func::FuncOp> made;
};

} // namespace

/// Says whether the code is for derivatives, to what asks.
static void answer(ModuleOp module, bool differentiated) {
  SmallVector<warp::LibraryCallOp> questions;
  module.walk([&](warp::LibraryCallOp op) {
    if (op.getCallee() == warp::isDifferentiated)
      questions.push_back(op);
  });
  for (warp::LibraryCallOp op : questions) {
    OpBuilder b(op);
    Type type = op.getResult(0).getType();
    op.getResult(0).replaceAllUsesWith(warp::ConstantOp::create(
        b, op.getLoc(), b.getIntegerAttr(type, differentiated)));
    op->erase();
  }
}

void ResolveDerivatives::runOnOperation() {
  if (failed(resolveAll()))
    return signalPassFailure();
  // The derivatives made meanwhile have been told.
  answer(getOperation(), keepDerivatives);
}

LogicalResult ResolveDerivatives::resolveAll() {
  ModuleOp module = getOperation();
  // A kernel that calls nothing has nothing to resolve.
  if (llvm::hasSingleElement(module.getOps<func::FuncOp>()))
    return success();
  Reached reached(module, keepDerivatives && !forward,
                  keepDerivatives && forward);
  prune(module, reached);
  made.clear();
  for (func::FuncOp function : reached.order) {
    SmallVector<Operation *> ops;
    function.walk([&](Operation *op) {
      if (isa<warp::VjpOp, warp::JvpOp>(op))
        ops.push_back(op);
    });
    for (Operation *op : ops)
      if (failed(resolve(op)))
        return failure();
    bool isDifferentiated = reached.isDifferentiated.lookup(function);
    if (function->hasAttr(warp::attr::kept)) {
      // Policies that report need the kernel's counters.
      if ((isDifferentiated || reached.forward) && singular == "pinned")
        keepDerivative(function);
      else
        function->removeAttr(warp::attr::kept);
    }
    if (isDifferentiated && failed(addMissing(function)))
      return failure();
  }
  return success();
}

LogicalResult ResolveDerivatives::resolve(Operation *op) {
  if (auto vjp = dyn_cast<warp::VjpOp>(op))
    return resolveVjp(vjp);
  return resolveJvp(cast<warp::JvpOp>(op));
}

static void replaceByCall(Operation *op, func::FuncOp callee,
                          ValueRange operands) {
  OpBuilder b(op);
  auto call = func::CallOp::create(b, op->getLoc(), callee, operands);
  op->replaceAllUsesWith(call.getResults());
  op->erase();
}

LogicalResult ResolveDerivatives::resolveVjp(warp::VjpOp op) {
  func::FuncOp callee = lookup(getOperation(), op.getCalleeAttr());
  if (callee->hasAttr(warp::attr::vjp))
    return resolveCustom(op, callee);
  Request request;
  request.arrays = op.getArrays();
  request.boxes = 1;
  for (OpResult gradient : op->getResults())
    if (!gradient.use_empty())
      request.boxes = gradient.getResultNumber() + 1;
  FailureOr<func::FuncOp> derivative = derive(callee, request);
  if (succeeded(derivative))
    replaceByCall(op, *derivative, op.getOperands());
  return derivative;
}

LogicalResult ResolveDerivatives::resolveJvp(warp::JvpOp op) {
  Request request;
  request.forward = true;
  request.boxes = op.getTangents().size();
  FailureOr<func::FuncOp> derivative =
      derive(lookup(getOperation(), op.getCalleeAttr()), request);
  if (failed(derivative))
    return failure();
  // Constants have tangents of zero, which nothing uses.
  SmallVector<Value> operands(op.getOperands());
  OpBuilder b(op);
  for (Type type : derivative->getArgumentTypes().drop_front(operands.size()))
    operands.push_back(warp::autodiff::zero(b, op.getLoc(), type));
  replaceByCall(op, *derivative, operands);
  return success();
}

LogicalResult ResolveDerivatives::resolveCustom(warp::VjpOp op,
                                                func::FuncOp callee) {
  func::FuncOp pullback =
      lookup(getOperation(), callee->getAttr(warp::attr::vjp));
  if (!op.getArrays()) {
    FailureOr<func::FuncOp> constant = withoutGradients(pullback);
    if (failed(constant))
      return failure();
    pullback = *constant;
  }
  OpBuilder b(op);
  SmallVector<Value> operands(op.getArguments());
  if (auto count = callee->getAttrOfType<IntegerAttr>(warp::attr::residuals)) {
    auto values =
        func::CallOp::create(b, op.getLoc(), callee, op.getArguments());
    llvm::append_range(operands, values.getResults().take_back(count.getInt()));
  }
  llvm::append_range(operands, op.getCotangents());
  replaceByCall(op, pullback, operands);
  return success();
}

/// A pullback that leaves the gradients of its array arguments alone.
FailureOr<func::FuncOp>
ResolveDerivatives::withoutGradients(func::FuncOp pullback) {
  auto isArray = [](Type type) { return isa<warp::ArrayType>(type); };
  size_t arrays = llvm::count_if(pullback.getArgumentTypes(), isArray);
  func::FuncOp &found = made[keyOf(pullback, "constant")];
  if (found || arrays == 0)
    return found ? found : pullback;
  OwningOpRef<ModuleOp> copy = copyFunctions();
  auto inner = copy->lookupSymbol<func::FuncOp>(pullback.getName());
  inner.setPublic();
  inner->setAttr(warp::kernelAttrName, UnitAttr::get(&getContext()));
  PassManager pm(&getContext());
  pm.enableVerifier(false);
  pm.addPass(warp::createInlinePullbacks({std::string(arrays, '0')}));
  if (failed(pm.run(*copy)))
    return failure();
  OpBuilder b(&getContext());
  b.setInsertionPointToEnd(getOperation().getBody());
  std::string name =
      warp::freshName(getOperation(), pullback.getName(), "_constant");
  found = cast<func::FuncOp>(b.clone(*inner));
  found->removeAttr(warp::kernelAttrName);
  found.setSymName(name);
  found.setPrivate();
  return found;
}

/// Makes the derivative of a function that is to stay a call, once for all
/// calls. A function without one is inlined: loops may keep what their
/// derivative needs in memory of the kernel.
void ResolveDerivatives::keepDerivative(func::FuncOp function) {
  Request request;
  request.forward = forward;
  request.silent = true;
  ScopedDiagnosticHandler quiet(&getContext(),
                                [](Diagnostic &) { return success(); });
  FailureOr<func::FuncOp> derivative = derive(function, request);
  if (failed(derivative)) {
    function->removeAttr(warp::attr::kept);
    return;
  }
  function->setAttr(forward ? warp::attr::jvp : warp::attr::vjp,
                    FlatSymbolRefAttr::get(*derivative));
  for (func::FuncOp kept : {function, *derivative}) {
    kept->setAttr(warp::attr::kept, UnitAttr::get(&getContext()));
    kept.setNoInline(true);
  }
}

/// A function with one of the two attributes stays a call, and needs the other
/// function, too.
LogicalResult ResolveDerivatives::addMissing(func::FuncOp function) {
  bool hasPullback = function->hasAttr(warp::attr::vjp);
  bool hasReplay = function->hasAttr(warp::attr::replay);
  if (hasPullback == hasReplay)
    return success();
  Request request;
  request.arrays = true;
  FailureOr<func::FuncOp> other =
      hasPullback ? withoutEffects(function) : derive(function, request);
  if (succeeded(other) && *other != function)
    function->setAttr(hasPullback ? warp::attr::replay : warp::attr::vjp,
                      FlatSymbolRefAttr::get(*other));
  return other;
}

/// A function that gives the same results and leaves memory alone.
FailureOr<func::FuncOp>
ResolveDerivatives::withoutEffects(func::FuncOp function) {
  func::FuncOp &found = made[keyOf(function, "effects")];
  if (found)
    return found;
  func::FuncOp copy = function.clone();
  bool isChanged = false;
  auto strip = [&](Operation *op) -> WalkResult {
    if (auto call = dyn_cast<func::CallOp>(op)) {
      func::FuncOp callee = lookup(getOperation(), call.getCalleeAttr());
      FailureOr<func::FuncOp> other = withoutEffects(callee);
      if (failed(other))
        return WalkResult::interrupt();
      isChanged |= *other != callee;
      call.setCallee(other->getName());
    } else if (warp::isObservable(op) && !op->use_empty()) {
      op->emitError("the old value cannot be recovered when '")
          << function.getName() << "' is differentiated; say with "
          << "`@wp.func_replay` how its results are";
      return WalkResult::interrupt();
    } else if (warp::isObservable(op)) {
      isChanged = true;
      op->erase();
    }
    return WalkResult::advance();
  };
  if (copy.walk(strip).wasInterrupted()) {
    copy.erase();
    return failure();
  }
  if (!isChanged) {
    copy.erase();
    return found = function;
  }
  copy.setName(warp::freshName(getOperation(), function.getName(), "_replay"));
  copy->removeAttr(warp::attr::vjp);
  copy->removeAttr(warp::attr::residuals);
  getOperation().push_back(copy);
  return found = copy;
}

/// A module of a function and those it calls, for its derivative. Functions
/// that stay calls, and their derivatives, are there as declarations.
OwningOpRef<ModuleOp> ResolveDerivatives::copyCalled(func::FuncOp function) {
  ModuleOp module = getOperation();
  OwningOpRef<ModuleOp> copy = ModuleOp::create(module.getLoc());
  copy.get()->setAttrs(module->getAttrs());
  SymbolTable symbols(module);
  llvm::SetVector<func::FuncOp> reached;
  auto reach = [&](Operation *op) {
    op->getAttrDictionary().walk([&](FlatSymbolRefAttr name) {
      if (auto callee = symbols.lookup<func::FuncOp>(name.getValue()))
        reached.insert(callee);
    });
  };
  reached.insert(function);
  for (size_t i = 0; i < reached.size(); ++i) {
    func::FuncOp found = reached[i];
    bool stays = found != function && found.getNoInline() &&
                 found->hasAttr(warp::attr::kept);
    copy->push_back(stays ? found->cloneWithoutRegions() : found->clone());
    if (stays)
      reach(found);
    else
      found->walk(reach);
  }
  answer(*copy, true);
  return copy;
}

/// The module without its kernel, for derivatives.
OwningOpRef<ModuleOp> ResolveDerivatives::copyFunctions() {
  OwningOpRef<ModuleOp> copy = getOperation().clone();
  for (auto function : llvm::make_early_inc_range(copy->getOps<func::FuncOp>()))
    if (!function.isPrivate())
      function.erase();
  answer(*copy, true);
  return copy;
}

FailureOr<func::FuncOp> ResolveDerivatives::derive(func::FuncOp function,
                                                   Request request) {
  unsigned boxes =
      llvm::count_if(function.getArgumentTypes(), warp::hasDifferential);
  request.boxes = std::min(request.boxes, boxes);
  std::string what = request.forward  ? "tangents"
                     : request.arrays ? "arrays"
                                      : "values";
  what += std::to_string(request.boxes);
  func::FuncOp &found = made[keyOf(function, what)];
  if (found)
    return found;
  if (!function.isPrivate())
    return function.emitError("expects a private function to differentiate, ")
           << "but '" << function.getName() << "' is public";
  OwningOpRef<ModuleOp> copy = copyCalled(function);
  auto inner = copy->lookupSymbol<func::FuncOp>(function.getName());
  inner->removeAttr(warp::attr::replay);
  inner->removeAttr(warp::attr::kept);
  warp::FunctionKernel around(inner);
  if (failed(differentiate(*copy, inner, request)))
    return failure();
  auto derivative = cast<func::FuncOp>(warp::findKernel(*copy).getOperation());
  if (request.silent && derivative->hasAttr(warp::attr::notices))
    return failure();
  FailureOr<func::FuncOp> result =
      around.toFunction(derivative, getOperation(), request.forward);
  if (succeeded(result))
    found = *result;
  return result;
}

LogicalResult ResolveDerivatives::differentiate(ModuleOp module,
                                                func::FuncOp function,
                                                Request request) {
  warp::AutodiffOptions options;
  options.forward = request.forward;
  options.singular = singular;
  unsigned boxes = 0;
  for (Type type : function.getArgumentTypes()) {
    if (warp::hasDifferential(type))
      options.active.push_back(boxes++ < request.boxes);
    else if (isa<warp::ArrayType>(type))
      options.active.push_back(request.arrays);
  }
  for (Type type : function.getResultTypes())
    if (warp::hasDifferential(type))
      options.active.push_back(true);
  warp::autodiff::callBodies(module);
  warp::autodiff::keepCalls(module, true);
  return warp::autodiff::derive(module, options);
}
