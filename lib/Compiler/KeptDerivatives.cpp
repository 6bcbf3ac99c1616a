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
// budget has room for. Such a function gets and returns the fields of structs
// instead of these, as derivatives are of numbers and composites of numbers.
//
//===----------------------------------------------------------------------===//

#include "Context.h"
#include "KeptCalls.h"
#include "Pipelines.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/DenseSet.h"
#include "llvm/ADT/StringMap.h"
#include "llvm/ADT/StringSet.h"

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

/// Appends the types of the fields of a struct, and of those within it.
static void appendFields(Type type, SmallVectorImpl<Type> &fields) {
  if (auto record = dyn_cast<warp::StructType>(type))
    for (Type field : record.getFieldTypes())
      appendFields(field, fields);
  else
    fields.push_back(type);
}

/// True if arguments and results of a function are numbers, composites of
/// numbers and structs of these, and it has no derivative of its own.
static bool isOfValues(func::FuncOp function) {
  SmallVector<Type> fields;
  for (Type type : function.getArgumentTypes())
    appendFields(type, fields);
  for (Type type : function.getResultTypes())
    appendFields(type, fields);
  auto isPlain = [](Type type) { return bool(warp::getElementScalar(type)); };
  return llvm::all_of(fields, isPlain) &&
         llvm::none_of(ArrayRef<StringRef>{warp::attr::vjp, warp::attr::jvp,
                                           warp::attr::replay,
                                           warp::attr::residuals},
                       [&](StringRef name) { return function->hasAttr(name); });
}

//===----------------------------------------------------------------------===//
// Structs
//===----------------------------------------------------------------------===//

/// Appends the fields of a value, or the value if it is no struct.
static void takeApart(OpBuilder &b, Value value,
                      SmallVectorImpl<Value> &parts) {
  auto record = dyn_cast<warp::StructType>(value.getType());
  if (!record)
    return parts.push_back(value);
  for (auto [name, type] :
       llvm::zip_equal(record.getFieldNames(), record.getFieldTypes()))
    takeApart(b,
              warp::StructGetOp::create(b, value.getLoc(), type, value, name),
              parts);
}

/// Makes a value of its fields, which are taken from the front of the list.
static Value putTogether(OpBuilder &b, Location loc, Type type,
                         ValueRange &parts) {
  auto record = dyn_cast<warp::StructType>(type);
  if (!record) {
    Value part = parts.front();
    parts = parts.drop_front();
    return part;
  }
  SmallVector<Value> fields;
  for (Type field : record.getFieldTypes())
    fields.push_back(putTogether(b, loc, field, parts));
  return warp::StructCreateOp::create(b, loc, record, fields);
}

static SmallVector<Value> takeApart(OpBuilder &b, ValueRange values) {
  SmallVector<Value> parts;
  for (Value value : values)
    takeApart(b, value, parts);
  return parts;
}

static bool hasStruct(TypeRange types) {
  return llvm::any_of(types, llvm::IsaPred<warp::StructType>);
}

/// Has a function get and return the fields of its structs.
static void passFields(func::FuncOp function, ArrayRef<func::CallOp> calls) {
  Location loc = function.getLoc();
  SmallVector<Type> argumentTypes(function.getArgumentTypes());
  SmallVector<Type> resultTypes(function.getResultTypes());
  Block &body = function.front();
  OpBuilder b(&body, body.begin());
  SmallVector<Type> types, results;
  for (Type type : argumentTypes)
    appendFields(type, types);
  for (Type type : resultTypes)
    appendFields(type, results);
  SmallVector<Value> fields;
  for (Type type : types)
    fields.push_back(body.addArgument(type, loc));
  ValueRange parts = fields;
  for (unsigned i = 0; i < argumentTypes.size(); ++i)
    body.getArgument(i).replaceAllUsesWith(
        putTogether(b, loc, argumentTypes[i], parts));
  body.eraseArguments(0, argumentTypes.size());
  Operation *end = body.getTerminator();
  b.setInsertionPoint(end);
  end->setOperands(takeApart(b, end->getOperands()));
  function->removeAttr(function.getArgAttrsAttrName());
  function->removeAttr(function.getResAttrsAttrName());
  function.setType(b.getFunctionType(types, results));
  for (func::CallOp call : calls) {
    b.setInsertionPoint(call);
    SmallVector<Value> operands = takeApart(b, call.getOperands());
    auto made = func::CallOp::create(b, call.getLoc(), function, operands);
    ValueRange returned = made.getResults();
    for (Value result : call.getResults())
      result.replaceAllUsesWith(
          putTogether(b, call.getLoc(), result.getType(), returned));
    call.erase();
  }
}

/// The calls of each function, if it is referred to by nothing else.
static llvm::StringMap<SmallVector<func::CallOp>> findCalls(ModuleOp module) {
  llvm::StringMap<SmallVector<func::CallOp>> calls;
  llvm::StringSet<> others;
  module.walk([&](Operation *op) {
    if (auto call = dyn_cast<func::CallOp>(op))
      calls[call.getCallee()].push_back(call);
    else
      op->getAttrDictionary().walk(
          [&](FlatSymbolRefAttr name) { others.insert(name.getValue()); });
  });
  for (auto &name : others)
    calls.erase(name.getKey());
  return calls;
}

//===----------------------------------------------------------------------===//
// Functions that stay
//===----------------------------------------------------------------------===//

void warp::markKeptDerivatives(ModuleOp module) {
  func::FuncOp kernel = findMarked(module, kernelAttrName);
  if (!kernel)
    return;
  CallGraph graph(kernel);
  if (graph.isRecursive || graph.nodes.size() == 1)
    return;
  auto budget = kernel->getAttrOfType<IntegerAttr>(attr::inlineBudget);
  std::optional<KeptCalls> kept = chooseKeptCalls(
      graph.nodes, budget ? double(budget.getInt()) : usualBudget,
      /*mayUpdate=*/false);
  if (!kept)
    return;
  llvm::StringMap<SmallVector<func::CallOp>> calls = findCalls(module);
  SmallVector<double> length;
  for (auto [i, node] : llvm::enumerate(graph.nodes)) {
    double sum = node.own;
    for (unsigned callee : node.callees)
      if (!graph.nodes[callee].function->hasAttr(attr::kept))
        sum += length[callee];
    length.push_back(sum);
    func::FuncOp function = node.function;
    if (!kept->mayStay[i] || sum < KeptCalls::shortest || !isOfValues(function))
      continue;
    if (hasStruct(function.getArgumentTypes()) ||
        hasStruct(function.getResultTypes())) {
      auto found = calls.find(function.getName());
      if (found == calls.end())
        continue;
      passFields(function, found->second);
    }
    function->setAttr(attr::kept, UnitAttr::get(kernel.getContext()));
  }
}

void warp::unmarkKeptDerivatives(ModuleOp module) {
  for (auto function : module.getOps<func::FuncOp>())
    if (function->removeAttr(attr::kept))
      function.removeNoInlineAttr();
}
