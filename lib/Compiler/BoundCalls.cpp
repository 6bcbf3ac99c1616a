//===- BoundCalls.cpp - Inlining within a code size budget ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Every call becomes a copy of the function, so in a tree of functions that
// call the one before twice, code doubles at each level. In code for a launch,
// the largest functions with several calls therefore stay calls once the kernel
// is longer than its budget (KeptCalls.h). Where copies of the others make most
// of a kernel, functions are simplified from the innermost outward before they
// are copied: what copies compute alike is there once. Code that is too long
// even so is an error before it is made.
//
//===----------------------------------------------------------------------===//

#include "KeptCalls.h"
#include "Pipelines.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Pass/PassManager.h"
#include "mlir/Transforms/Inliner.h"
#include "mlir/Transforms/InliningUtils.h"

#include "llvm/ADT/DenseSet.h"
#include "llvm/ADT/MapVector.h"
#include "llvm/Support/FormatVariadic.h"

using namespace mlir;

/// Operations that are inlined as they come.
static constexpr double fewOperations = 50'000;
/// More take minutes and gigabytes to compile.
static constexpr double mostOperations = 150'000;
/// Copies make most of the code if it grows by this factor.
static constexpr double mostlyCopies = 4;

namespace {

struct Function {
  /// Operations of its own, and with copies of all that it calls.
  double own = 0, whole = 0;
  warp::CallNode node;
  /// Calls of it.
  unsigned uses = 0;
  /// It is a function of the target if it is large.
  bool mayStay = false;
  /// Calls, which are gone once they are inlined, with what they call.
  SmallVector<std::pair<func::CallOp, func::FuncOp>> calls;
};

class BoundCalls : public PassWrapper<BoundCalls, OperationPass<ModuleOp>> {
public:
  MLIR_DEFINE_EXPLICIT_INTERNAL_INLINE_TYPE_ID(BoundCalls)

  BoundCalls(bool all, bool mayKeep) : all(all), mayKeep(mayKeep) {}

  StringRef getArgument() const override { return "warp-bound-calls"; }

  void runOnOperation() override;

private:
  using Functions = llvm::MapVector<Operation *, Function>;

  func::FuncOp calleeOf(func::CallOp call, const SymbolTable &symbols) const;
  void count(func::FuncOp function, Functions &functions,
             const SymbolTable &symbols);
  bool chooseKept(Functions &functions);
  void settle(func::FuncOp function, bool mayStay);
  LogicalResult inlineInto(func::FuncOp caller, Functions &functions,
                           OpPassManager &pm);
  LogicalResult tooLong(func::CallOp call, double operations,
                        Functions &functions);

  /// Functions that are kept as such so far are about to be inlined, too.
  bool all;
  /// Functions may become functions of the target.
  bool mayKeep;
  /// Functions that are being counted: one that calls one of them is recursive.
  llvm::DenseSet<Operation *> open;
  bool isRecursive = false;
  /// Scalar operations from which functions stay; 0 if none does.
  double least = 0;
};

} // namespace

/// The function that a call becomes a copy of, if it does.
func::FuncOp BoundCalls::calleeOf(func::CallOp call,
                                  const SymbolTable &symbols) const {
  auto callee = symbols.lookup<func::FuncOp>(call.getCallee());
  bool isKept = !callee || callee.isExternal() || call.getNoInline() ||
                callee->hasAttr(warp::attr::kept) ||
                (callee.getNoInline() && !all);
  return isKept ? func::FuncOp() : callee;
}

/// Counts a function and those it calls, which come before it in the list.
void BoundCalls::count(func::FuncOp function, Functions &functions,
                       const SymbolTable &symbols) {
  if (functions.contains(function))
    return;
  if (!open.insert(function).second) {
    isRecursive = true;
    return;
  }
  Function found;
  function.walk([&](Operation *op) {
    ++found.own;
    if (mayKeep)
      found.node.own += warp::scalarOperations(op);
    if (auto call = dyn_cast<func::CallOp>(op))
      if (func::FuncOp callee = calleeOf(call, symbols))
        found.calls.push_back({call, callee});
  });
  found.whole = found.own;
  for (auto [call, callee] : found.calls) {
    count(callee, functions, symbols);
    found.whole += functions[callee].whole;
    ++functions[callee].uses;
  }
  open.erase(function);
  functions[function] = std::move(found);
}

void BoundCalls::runOnOperation() {
  ModuleOp module = getOperation();
  if (llvm::hasSingleElement(module.getOps<func::FuncOp>()))
    return;
  SymbolTable symbols(module);
  Functions functions;
  double own = 0, whole = 0;
  open.clear();
  isRecursive = false;
  least = 0;
  for (auto function : module.getOps<func::FuncOp>()) {
    count(function, functions, symbols);
    own += functions[function].own;
    whole = std::max(whole, functions[function].whole);
  }
  // Recursion is the inliner's error.
  if (isRecursive)
    return;
  bool keeps = mayKeep && chooseKept(functions);
  if (!keeps && (whole <= fewOperations || whole <= mostlyCopies * own))
    return;
  if (all)
    for (auto &[op, _] : functions)
      if (!op->hasAttr(warp::attr::kept))
        cast<func::FuncOp>(op).removeNoInlineAttr();
  OpPassManager pm(func::FuncOp::getOperationName());
  warp::addSimplification(pm);
  for (auto &[op, function] : functions)
    if (failed(inlineInto(cast<func::FuncOp>(op), functions, pm)))
      return signalPassFailure();
}

/// Finds the functions that may stay; false if the kernel is within its budget.
bool BoundCalls::chooseKept(Functions &functions) {
  llvm::DenseMap<Operation *, unsigned> numbers;
  SmallVector<warp::CallNode> nodes;
  std::optional<warp::KeptCalls> kept;
  for (auto &[op, function] : functions) {
    warp::CallNode node = function.node;
    node.function = cast<func::FuncOp>(op);
    for (auto [_, callee] : function.calls)
      node.callees.push_back(numbers.lookup(callee));
    numbers[op] = nodes.size();
    nodes.push_back(std::move(node));
    // A function that comes after the kernel is not called by it.
    if (!op->hasAttr(warp::kernelAttrName))
      continue;
    auto budget = op->getAttrOfType<IntegerAttr>(warp::attr::inlineBudget);
    if (budget)
      kept = warp::chooseKeptCalls(nodes, double(budget.getInt()),
                                   op->hasAttr(warp::attr::keepsUpdates));
    break;
  }
  if (!kept)
    return false;
  for (auto [node, mayStay] : llvm::zip_equal(nodes, kept->mayStay))
    functions[node.function].mayStay = mayStay;
  least = kept->least;
  return true;
}

/// Has a function stay that is large once it is simplified, and says so of the
/// kernel if it calls some.
void BoundCalls::settle(func::FuncOp function, bool mayStay) {
  auto unit = UnitAttr::get(function.getContext());
  double length = 0;
  bool calls = false;
  function.walk([&](Operation *op) {
    length += warp::scalarOperations(op);
    calls |= isa<func::CallOp>(op);
  });
  if (mayStay && length >= least) {
    function.setNoInline(true);
    function->setAttr(warp::attr::kept, unit);
  } else if (calls && function->hasAttr(warp::kernelAttrName)) {
    function->setAttr(warp::attr::keepsCalls, unit);
  }
}

/// Replaces the calls of a function whose callees have no calls any more, but
/// for those that stay.
LogicalResult BoundCalls::inlineInto(func::FuncOp caller, Functions &functions,
                                     OpPassManager &pm) {
  Function &function = functions[caller];
  InlinerInterface inliner(&getContext());
  InlinerConfig config;
  double length = function.own;
  for (auto [call, callee] : function.calls) {
    if (callee->hasAttr(warp::attr::kept))
      continue;
    length += functions[callee].own;
    if (length > mostOperations)
      return tooLong(call, length, functions);
    if (succeeded(inlineCall(inliner, config.getCloneCallback(), call, callee,
                             &callee.getBody())))
      call.erase();
  }
  // A part of one caller is simplified there; a kernel, by the passes behind
  // this one.
  bool isCopied = function.uses > 1 || all;
  if (isCopied && failed(runPipeline(pm, caller)))
    return failure();
  if (least > 0)
    settle(caller, function.mayStay);
  function.own = 0;
  caller.walk([&](Operation *) { ++function.own; });
  return success();
}

/// The error at the call that is one too many; it names the function of which
/// there are the most copies in the kernel.
LogicalResult BoundCalls::tooLong(func::CallOp call, double operations,
                                  Functions &functions) {
  llvm::DenseMap<Operation *, double> copies;
  Operation *most = functions.front().first;
  for (auto &[op, function] : llvm::reverse(functions)) {
    double made = copies.try_emplace(op, 1).first->second;
    for (auto [_, callee] : function.calls)
      copies.try_emplace(callee, 0).first->second += made;
  }
  for (auto &[op, _] : functions)
    if (copies[op] > copies[most])
      most = op;
  auto number = [](double value) {
    return value < 1e15 ? std::to_string(static_cast<int64_t>(value))
                        : llvm::formatv("{0:e2}", value).str();
  };
  auto caller = call->getParentOfType<func::FuncOp>();
  return call.emitError("'")
         << caller.getName() << "' has " << number(operations)
         << " operations or more once calls are written out, the most is "
         << number(mostOperations) << "; there would be "
         << number(copies[most]) << " copies of '"
         << cast<func::FuncOp>(most).getName()
         << "'\nhint: loop over such calls, or keep results that are needed "
            "again in variables";
}

std::unique_ptr<Pass> warp::createBoundCalls(bool all, bool mayKeep) {
  return std::make_unique<BoundCalls>(all, mayKeep);
}
