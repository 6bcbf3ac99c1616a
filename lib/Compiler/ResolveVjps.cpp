//===- ResolveVjps.cpp - Derivatives that a kernel calls ------------------===//
//
// Replaces `warp.vjp @f` by a call of a function that computes it. If @f has a
// derivative of its own that is the one; else the function is made by the same
// passes as the adjoint of a kernel: a kernel is built around @f,
//
//   x = load X[0]; ...; y = call @f(x, ...); store y, Y[0]
//
// differentiated, and turned back into a function in which the gradients of X
// and Y, each of one element, are values again. So all that kernels can do
// has a derivative here as well, and there is one engine. The result is
// ordinary code, and may be differentiated once more.
//
// A launch of the primal needs no derivatives: those of functions that are
// merely called are dropped, together with all that nobody calls.
//
//===----------------------------------------------------------------------===//

#include "Derivation.h"

#include "../Transforms/Autodiff/Rules.h"
#include "../Transforms/KernelFunction.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/SymbolTable.h"
#include "mlir/IR/Verifier.h"
#include "mlir/Pass/PassManager.h"

#include "llvm/ADT/MapVector.h"

namespace warp {
#define GEN_PASS_DEF_RESOLVEVJPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

static bool hasCotangent(Type type) {
  Type scalar = warp::getElementScalar(type);
  return scalar && warp::isFloat(scalar);
}

static func::FuncOp lookup(ModuleOp module, Attribute symbol) {
  auto name = dyn_cast_or_null<FlatSymbolRefAttr>(symbol);
  return name ? module.lookupSymbol<func::FuncOp>(name.getValue()) : nullptr;
}

static std::string freshName(ModuleOp module, StringRef name,
                             StringRef suffix) {
  std::string made = (name + suffix).str();
  while (module.lookupSymbol(made))
    made += "_";
  return made;
}

//===----------------------------------------------------------------------===//
// What is needed
//===----------------------------------------------------------------------===//

namespace {

/// The functions that a kernel needs, callees before callers, and whether
/// their derivatives are needed too.
struct Reached {
  Reached(ModuleOp module, bool differentiated) : module(module) {
    for (auto function : module.getOps<func::FuncOp>())
      if (!function.isPrivate())
        visit(function, differentiated);
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
    });
    if (differentiated) {
      visitSymbol(function->getAttr(warp::attr::vjp), true);
      visitSymbol(function->getAttr(warp::attr::replay), true);
    }
    if (isNew)
      order.push_back(function);
  }

  void visitSymbol(Attribute symbol, bool differentiated) {
    if (func::FuncOp function = lookup(module, symbol))
      visit(function, differentiated);
  }

  ModuleOp module;
  SmallVector<func::FuncOp> order;
  llvm::DenseMap<func::FuncOp, bool> isDifferentiated;
};

} // namespace

static void prune(ModuleOp module, const Reached &reached) {
  for (auto function : llvm::make_early_inc_range(
           module.getOps<func::FuncOp>())) {
    auto found = reached.isDifferentiated.find(function);
    if (found == reached.isDifferentiated.end()) {
      function.erase();
    } else if (!found->second) {
      function->removeAttr(warp::attr::vjp);
      function->removeAttr(warp::attr::replay);
      function->removeAttr(warp::attr::residuals);
    }
  }
}

//===----------------------------------------------------------------------===//
// A kernel around a function
//===----------------------------------------------------------------------===//

namespace {

/// Parameters of the kernel: those of the function, with an array of one
/// element for each that has a cotangent, and an array for each such result.
struct KernelAround {
  KernelAround(ModuleOp module, func::FuncOp function);

  func::FuncOp kernel;
  unsigned argumentCount;
};

} // namespace

KernelAround::KernelAround(ModuleOp module, func::FuncOp function)
    : argumentCount(function.getNumArguments()) {
  OpBuilder b(module.getContext());
  Location loc = function.getLoc();
  SmallVector<Type> types;
  auto boxed = [&](Type type) {
    types.push_back(hasCotangent(type) ? warp::ArrayType::get(type.getContext(), 1, type)
                                       : type);
  };
  llvm::for_each(function.getArgumentTypes(), boxed);
  for (Type type : function.getResultTypes())
    if (hasCotangent(type))
      boxed(type);
  b.setInsertionPointToEnd(module.getBody());
  kernel = func::FuncOp::create(b, loc, (function.getName() + "_vjp").str(),
                                b.getFunctionType(types, {}));
  SmallVector<std::string> names;
  for (unsigned i = 0; i < types.size(); ++i)
    names.push_back("x" + std::to_string(i));
  SmallVector<StringRef> texts(names.begin(), names.end());
  kernel->setAttr(warp::kernelAttrName, b.getUnitAttr());
  kernel->setAttr(warp::attr::argNames, b.getStrArrayAttr(texts));
  Block *body = kernel.addEntryBlock();
  b.setInsertionPointToStart(body);
  Value zero = warp::ConstantOp::create(
      b, loc,
      cast<TypedAttr>(IntegerAttr::get(b.getIntegerType(32, true), 0)));
  SmallVector<Value> operands;
  for (auto [argument, type] :
       llvm::zip(body->getArguments(), function.getArgumentTypes())) {
    Value operand = argument;
    if (hasCotangent(type))
      operand = warp::LoadOp::create(b, loc, type, argument, zero);
    operands.push_back(operand);
  }
  auto call = func::CallOp::create(b, loc, function, operands);
  unsigned position = argumentCount;
  for (Value result : call.getResults())
    if (hasCotangent(result.getType()))
      warp::StoreOp::create(b, loc, result, body->getArgument(position++),
                            zero);
  func::ReturnOp::create(b, loc);
}

//===----------------------------------------------------------------------===//
// From the adjoint kernel to a function
//===----------------------------------------------------------------------===//

namespace {

/// Turns the arrays of one element into values.
class Unboxing {
public:
  Unboxing(func::FuncOp adjoint, func::FuncOp function)
      : adjoint(adjoint), function(function), b(adjoint.getContext()) {}

  LogicalResult run();
  /// The function that the adjoint has become, in another module.
  func::FuncOp moveTo(ModuleOp module);

private:
  struct Box {
    BlockArgument array;
    Type type;
    bool isResult;
    Value value = nullptr, gradient = nullptr;
  };
  void addBoxes();
  LogicalResult replaceUses(Box &box);
  LogicalResult replaceGradient(Box &box);
  LogicalResult fail(Operation *op) {
    return op->emitError("the derivative of '")
           << function.getName() << "' cannot be taken within a kernel: it "
           << "keeps values in memory";
  }

  func::FuncOp adjoint, function;
  OpBuilder b;
  SmallVector<Box> boxes;
};

} // namespace

void Unboxing::addBoxes() {
  Block &body = adjoint.front();
  for (auto [i, type] : llvm::enumerate(function.getArgumentTypes()))
    if (hasCotangent(type))
      boxes.push_back({body.getArgument(i), type, false});
  unsigned position = function.getNumArguments();
  for (Type type : function.getResultTypes())
    if (hasCotangent(type))
      boxes.push_back({body.getArgument(position++), type, true});
}

/// The primal value: loads see what is passed.
LogicalResult Unboxing::replaceUses(Box &box) {
  Block &body = adjoint.front();
  Value value = box.value = body.addArgument(box.type, adjoint.getLoc());
  for (Operation *user : llvm::make_early_inc_range(box.array.getUsers())) {
    if (isa<warp::GradOp>(user))
      continue;
    auto load = dyn_cast<warp::LoadOp>(user);
    if (!load || box.isResult)
      return fail(user);
    load.getResult().replaceAllUsesWith(value);
    load.erase();
  }
  if (box.isResult)
    box.gradient = value;
  return replaceGradient(box);
}

/// The gradient is a variable of the function's body.
LogicalResult Unboxing::replaceGradient(Box &box) {
  Block &body = adjoint.front();
  SmallVector<Operation *> grads(box.array.getUsers());
  SmallVector<Operation *> accesses;
  for (Operation *grad : grads)
    llvm::append_range(accesses, grad->getUsers());
  if (llvm::any_of(accesses,
                   [&](Operation *op) { return op->getBlock() != &body; }))
    return fail(adjoint);
  llvm::sort(accesses, [](Operation *x, Operation *y) {
    return x->isBeforeInBlock(y);
  });
  for (Operation *op : accesses) {
    b.setInsertionPoint(op);
    if (auto load = dyn_cast<warp::LoadOp>(op)) {
      Type type = load.getResult().getType();
      Value current = box.gradient;
      if (!current)
        current = warp::autodiff::zero(b, op->getLoc(), type);
      else if (current.getType() != type)
        current = warp::CastOp::create(b, op->getLoc(), type, current);
      load.getResult().replaceAllUsesWith(current);
    } else if (auto store = dyn_cast<warp::StoreOp>(op)) {
      box.gradient = store.getValue();
    } else if (auto sum = dyn_cast<warp::AccumulateOp>(op)) {
      box.gradient =
          warp::autodiff::add(b, op->getLoc(), box.gradient, sum.getValue());
    } else {
      return fail(op);
    }
    op->erase();
  }
  for (Operation *grad : grads)
    grad->erase();
  return success();
}

LogicalResult Unboxing::run() {
  addBoxes();
  Block &body = adjoint.front();
  unsigned expected = function.getNumArguments() +
                      llvm::count_if(boxes, [](Box &box) { return box.isResult; });
  // What is there besides are hidden arguments.
  if (body.getNumArguments() != expected)
    return fail(function);
  for (Box &box : boxes)
    if (failed(replaceUses(box)))
      return failure();
  auto end = cast<func::ReturnOp>(body.getTerminator());
  b.setInsertionPoint(end);
  SmallVector<Value> results;
  for (Box &box : boxes) {
    if (box.isResult)
      continue;
    Value found = box.gradient;
    if (!found)
      found = warp::autodiff::zero(b, end.getLoc(), box.type);
    else if (found.getType() != box.type)
      found = warp::CastOp::create(b, end.getLoc(), box.type, found);
    results.push_back(found);
  }
  end.getOperandsMutable().assign(results);
  return success();
}

func::FuncOp Unboxing::moveTo(ModuleOp module) {
  SmallVector<Type> types(function.getArgumentTypes());
  for (Box &box : boxes)
    if (box.isResult)
      types.push_back(box.type);
  auto end = cast<func::ReturnOp>(adjoint.front().getTerminator());
  b.setInsertionPointToEnd(module.getBody());
  std::string name = freshName(module, function.getName(), "_vjp");
  auto made = func::FuncOp::create(
      b, function.getLoc(), name,
      b.getFunctionType(types, end.getOperandTypes()));
  made.setPrivate();
  Block *body = made.addEntryBlock();
  IRMapping map;
  for (unsigned i = 0; i < function.getNumArguments(); ++i)
    map.map(adjoint.getArgument(i), body->getArgument(i));
  unsigned seed = function.getNumArguments();
  for (Box &box : boxes)
    map.map(box.value, body->getArgument(box.isResult
                                             ? seed++
                                             : box.array.getArgNumber()));
  b.setInsertionPointToStart(body);
  for (Operation &op : adjoint.front())
    b.clone(op, map);
  return made;
}

//===----------------------------------------------------------------------===//
// The pass
//===----------------------------------------------------------------------===//

namespace {

struct ResolveVjps : warp::impl::ResolveVjpsBase<ResolveVjps> {
  using ResolveVjpsBase::ResolveVjpsBase;

  void runOnOperation() override;
  LogicalResult resolve(warp::VjpOp op);
  LogicalResult resolveCustom(warp::VjpOp op, func::FuncOp callee);
  FailureOr<func::FuncOp> withoutGradients(func::FuncOp pullback);
  OwningOpRef<ModuleOp> copyFunctions();
  LogicalResult addMissing(func::FuncOp function);
  /// The derivative of a function that has none of its own, made once.
  FailureOr<func::FuncOp> derive(func::FuncOp function, bool arrays);
  LogicalResult differentiate(ModuleOp module, func::FuncOp function,
                              bool arrays);

  /// Without and with gradients of arrays.
  std::array<llvm::DenseMap<func::FuncOp, func::FuncOp>, 2> made;
};

} // namespace

void ResolveVjps::runOnOperation() {
  ModuleOp module = getOperation();
  // A kernel that calls nothing has nothing to resolve.
  if (llvm::hasSingleElement(module.getOps<func::FuncOp>()))
    return;
  Reached reached(module, keepDerivatives);
  prune(module, reached);
  for (auto &functions : made)
    functions.clear();
  for (func::FuncOp function : reached.order) {
    SmallVector<warp::VjpOp> ops;
    function.walk([&](warp::VjpOp op) { ops.push_back(op); });
    for (warp::VjpOp op : ops)
      if (failed(resolve(op)))
        return signalPassFailure();
    if (reached.isDifferentiated.lookup(function) &&
        failed(addMissing(function)))
      return signalPassFailure();
  }
}

LogicalResult ResolveVjps::resolve(warp::VjpOp op) {
  func::FuncOp callee = lookup(getOperation(), op.getCalleeAttr());
  if (callee->hasAttr(warp::attr::vjp))
    return resolveCustom(op, callee);
  FailureOr<func::FuncOp> derivative = derive(callee, op.getArrays());
  if (failed(derivative))
    return failure();
  OpBuilder b(op);
  SmallVector<Value> operands(op.getArguments());
  llvm::append_range(operands, op.getCotangents());
  auto call = func::CallOp::create(b, op.getLoc(), *derivative, operands);
  op->replaceAllUsesWith(call.getResults());
  op.erase();
  return success();
}

LogicalResult ResolveVjps::resolveCustom(warp::VjpOp op, func::FuncOp callee) {
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
  auto call = func::CallOp::create(b, op.getLoc(), pullback, operands);
  op->replaceAllUsesWith(call.getResults());
  op.erase();
  return success();
}

/// A pullback that leaves the gradients of its array arguments alone.
FailureOr<func::FuncOp> ResolveVjps::withoutGradients(func::FuncOp pullback) {
  auto isArray = [](Type type) { return isa<warp::ArrayType>(type); };
  size_t arrays = llvm::count_if(pullback.getArgumentTypes(), isArray);
  func::FuncOp &found = made[false][pullback];
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
  found = cast<func::FuncOp>(b.clone(*inner));
  found->removeAttr(warp::kernelAttrName);
  found.setPrivate();
  found.setSymName(freshName(getOperation(), pullback.getName(), "_constant"));
  return found;
}

/// The module without its kernel.
OwningOpRef<ModuleOp> ResolveVjps::copyFunctions() {
  OwningOpRef<ModuleOp> copy = getOperation().clone();
  for (auto function : llvm::make_early_inc_range(copy->getOps<func::FuncOp>()))
    if (!function.isPrivate())
      function.erase();
  return copy;
}

/// A function that says how its results are had again stays a call, and needs
/// a derivative to call.
LogicalResult ResolveVjps::addMissing(func::FuncOp function) {
  if (!function->hasAttr(warp::attr::replay) ||
      function->hasAttr(warp::attr::vjp))
    return success();
  FailureOr<func::FuncOp> derivative = derive(function, /*arrays=*/true);
  if (succeeded(derivative))
    function->setAttr(warp::attr::vjp, FlatSymbolRefAttr::get(*derivative));
  return derivative;
}

FailureOr<func::FuncOp> ResolveVjps::derive(func::FuncOp function,
                                            bool arrays) {
  func::FuncOp &found = made[arrays][function];
  if (found)
    return found;
  ModuleOp module = getOperation();
  OwningOpRef<ModuleOp> copy = copyFunctions();
  auto inner = copy->lookupSymbol<func::FuncOp>(function.getName());
  inner->removeAttr(warp::attr::replay);
  KernelAround around(*copy, inner);
  if (failed(differentiate(*copy, function, arrays)))
    return failure();
  auto adjoint = cast<func::FuncOp>(warp::findKernel(*copy).getOperation());
  Unboxing unboxing(adjoint, function);
  if (failed(unboxing.run()))
    return failure();
  return found = unboxing.moveTo(module);
}

LogicalResult ResolveVjps::differentiate(ModuleOp module,
                                         func::FuncOp function, bool arrays) {
  warp::AutodiffOptions options;
  options.singular = singular;
  for (Type type : function.getArgumentTypes()) {
    if (hasCotangent(type))
      options.active.push_back(true);
    else if (isa<warp::ArrayType>(type))
      options.active.push_back(arrays);
  }
  for (Type type : function.getResultTypes())
    if (hasCotangent(type))
      options.active.push_back(true);
  warp::keepCalls(module, true);
  PassManager pm(module.getContext());
  pm.enableVerifier(false);
  warp::addDerivation(pm, options);
  if (failed(pm.run(module)))
    return failure();
  warp::keepCalls(module, false);
  return success();
}
