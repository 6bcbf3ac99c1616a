//===- KeptDerivatives.cpp - Out-of-line derivatives ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A derivative has all calls of its kernel inlined, so that in a tree of
// functions it would double with each level. Beyond the budget of a kernel, the
// large functions with several calls that only compute values are therefore
// differentiated once (ResolveDerivatives.cpp): their calls are reversed as
// those of functions with a derivative of their own are, and stay. All but the
// shortest are, so that no derivative is long: a launch inlines what its own
// budget has room for.
//
//===----------------------------------------------------------------------===//

#include "Context.h"
#include "KeptCalls.h"
#include "Pipelines.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"

#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/DenseSet.h"

using namespace mlir;

/// The budget of a kernel where nobody has set one: derivatives are for all
/// devices.
static constexpr double usualBudget = 12'000;

namespace {

/// The functions that a kernel calls, callees before callers.
class CallGraph {
public:
  explicit CallGraph(func::FuncOp kernel)
      : symbols(kernel->getParentOfType<ModuleOp>()) {
    visit(kernel);
  }

  SmallVector<warp::CallNode> nodes;
  bool isRecursive = false;

private:
  unsigned visit(func::FuncOp function);

  SymbolTable symbols;
  llvm::DenseMap<Operation *, unsigned> numbers;
  llvm::DenseSet<Operation *> open;
};

} // namespace

unsigned CallGraph::visit(func::FuncOp function) {
  if (auto known = numbers.find(function); known != numbers.end())
    return known->second;
  isRecursive |= !open.insert(function).second;
  if (isRecursive)
    return 0;
  warp::CallNode node;
  node.function = function;
  function.walk([&](Operation *op) {
    node.own += warp::scalarOperations(op);
    auto call = dyn_cast<func::CallOp>(op);
    auto callee =
        call ? symbols.lookup<func::FuncOp>(call.getCallee()) : nullptr;
    if (callee && !callee.isExternal())
      node.callees.push_back(visit(callee));
  });
  unsigned number = nodes.size();
  numbers[function] = number;
  nodes.push_back(std::move(node));
  return number;
}

/// True if arguments and results of a function are numbers and composites of
/// numbers, and the function has no derivative of its own.
static bool isOfValues(func::FuncOp function) {
  auto isPlain = [](Type type) { return bool(warp::getElementScalar(type)); };
  return llvm::all_of(function.getArgumentTypes(), isPlain) &&
         llvm::all_of(function.getResultTypes(), isPlain) &&
         llvm::none_of(ArrayRef<StringRef>{warp::attr::vjp, warp::attr::jvp,
                                           warp::attr::replay,
                                           warp::attr::residuals},
                       [&](StringRef name) { return function->hasAttr(name); });
}

void warp::markKeptDerivatives(ModuleOp module) {
  func::FuncOp kernel = findMarked(module, kernelAttrName);
  if (!kernel)
    return;
  CallGraph graph(kernel);
  if (graph.isRecursive || graph.nodes.size() == 1)
    return;
  auto budget = kernel->getAttrOfType<IntegerAttr>(attr::inlineBudget);
  std::optional<KeptCalls> kept = chooseKeptCalls(
      graph.nodes, budget ? double(budget.getInt()) : usualBudget);
  if (!kept)
    return;
  SmallVector<double> length;
  for (auto [i, node] : llvm::enumerate(graph.nodes)) {
    double sum = node.own;
    for (unsigned callee : node.callees)
      if (!graph.nodes[callee].function->hasAttr(attr::kept))
        sum += length[callee];
    length.push_back(sum);
    if (kept->mayStay[i] && sum >= KeptCalls::shortest &&
        isOfValues(node.function))
      node.function->setAttr(attr::kept, UnitAttr::get(kernel.getContext()));
  }
}

void warp::unmarkKeptDerivatives(ModuleOp module) {
  for (auto function : module.getOps<func::FuncOp>())
    if (function->removeAttr(attr::kept))
      function.removeNoInlineAttr();
}
