//===- LaneCalls.cpp - Functions that lanes call --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LaneCalls.h"

#include "Analysis/ArrayOrigins.h"
#include "KernelFunction.h"
#include "LanePlan.h"
#include "WarpDialect/CallAttributes.h"

#include "mlir/IR/SymbolTable.h"

using namespace mlir;
using warp::LaneCalls;
using warp::LaneFunction;
using warp::ThreadVariance;

static bool isVarying(Value value, const ThreadVariance &variance) {
  return !variance.isUniform(value, warp::Scope::Lanes);
}

static SmallVector<func::CallOp> callsOf(Operation *function) {
  SmallVector<func::CallOp> found;
  function->walk([&](func::CallOp call) { found.push_back(call); });
  return found;
}

static func::FuncOp calleeOf(func::CallOp call) {
  return SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(
      call, call.getCalleeAttr());
}

/// Adds a function to the module under a name of its own.
static void add(func::FuncOp function, func::FuncOp like, StringRef suffix) {
  auto module = like->getParentOfType<ModuleOp>();
  std::string name = (like.getName() + suffix).str(), free = name;
  for (unsigned number = 2; module.lookupSymbol(free); ++number)
    free = name + "_" + std::to_string(number);
  function.setName(free);
  module.insert(like, function);
}

//===----------------------------------------------------------------------===//
// Rows
//===----------------------------------------------------------------------===//

/// The copy of a function that gets, for some of its arrays, the array that
/// the row is one of and its indices.
func::FuncOp LaneCalls::withRows(func::CallOp call, ArrayRef<unsigned> rows) {
  func::FuncOp callee = calleeOf(call);
  std::string key = callee.getName().str();
  llvm::raw_string_ostream stream(key);
  for (unsigned row : rows)
    stream << "/" << row
           << call.getOperand(row).getDefiningOp()->getOperandTypes();
  func::FuncOp &found = rowFunctions[key];
  if (found)
    return found;
  found = callee.clone();
  add(found, callee, "_rows");
  Block &body = found.front();
  OpBuilder b(&body, body.begin());
  for (unsigned row : llvm::reverse(rows)) {
    auto view = call.getOperand(row).getDefiningOp<ViewOp>();
    BlockArgument old = body.getArgument(row);
    SmallVector<Value> parts;
    unsigned place = row;
    for (Value part : view->getOperands())
      parts.push_back(
          body.insertArgument(++place, part.getType(), old.getLoc()));
    old.replaceAllUsesWith(ViewOp::create(b, old.getLoc(), view.getType(),
                                          parts.front(),
                                          ArrayRef(parts).drop_front()));
    body.eraseArgument(row);
  }
  found->removeAttr(found.getArgAttrsAttrName());
  found.setType(FunctionType::get(found.getContext(), body.getArgumentTypes(),
                                  found.getResultTypes()));
  warp::foldViews(found);
  return found;
}

/// Passes rows that differ as arrays and indices; true if there are any.
bool LaneCalls::passRows(FunctionOpInterface caller,
                         const ThreadVariance &variance) {
  bool changed = false;
  for (func::CallOp call : callsOf(caller)) {
    SmallVector<unsigned> rows;
    SmallVector<Value> operands;
    SmallVector<Operation *> views;
    for (auto [i, operand] : llvm::enumerate(call.getOperands())) {
      auto view = operand.getDefiningOp<ViewOp>();
      if (!view || !isVarying(operand, variance)) {
        operands.push_back(operand);
        continue;
      }
      rows.push_back(i);
      views.push_back(view);
      llvm::append_range(operands, view->getOperands());
    }
    if (rows.empty())
      continue;
    changed = true;
    call.setCallee(withRows(call, rows).getName());
    call->setOperands(operands);
    llvm::sort(views);
    views.erase(llvm::unique(views), views.end());
    for (Operation *view : views)
      if (view->use_empty())
        view->erase();
  }
  return changed;
}

//===----------------------------------------------------------------------===//
// Functions
//===----------------------------------------------------------------------===//

std::string LaneCalls::visit(FunctionOpInterface caller,
                             std::unique_ptr<ThreadVariance> &variance,
                             MakeVariance makeVariance) {
  variance = makeVariance();
  if (passRows(caller, *variance))
    variance = makeVariance();
  for (func::CallOp call : callsOf(caller))
    if (!variance->isOneCall(call))
      if (std::string reason = resolve(call, *variance); !reason.empty())
        return reason;
  return "";
}

/// Finds or makes the function for a call.
std::string LaneCalls::resolve(func::CallOp call,
                               const ThreadVariance &variance) {
  func::FuncOp callee = calleeOf(call);
  if (!callee || callee.isExternal())
    return "a function is not known";
  SmallVector<LaneArgument> arguments;
  std::string key = callee.getName().str() + "/";
  for (Value operand : call.getOperands()) {
    bool isArray = isa<warp::ArrayType>(operand.getType());
    bool varies = isVarying(operand, variance);
    if (isArray && varies)
      return "an array differs from thread to thread";
    arguments.push_back({varies, isArray && variance.isWritten(operand)});
    key += varies ? 'v' : arguments.back().isWritten ? 'w' : 'u';
  }
  LaneFunction *&known = byName[key];
  if (!known) {
    auto function = std::make_unique<LaneFunction>();
    known = function.get();
    func::FuncOp scalar = function->scalar = callee.clone();
    add(scalar, callee, "_lane");
    bool anyWrites = variance.hasWrites();
    std::string reason = visit(scalar, function->variance, [&] {
      return std::make_unique<ThreadVariance>(scalar, arguments, anyWrites);
    });
    if (reason.empty())
      reason = whyNotLanes(scalar.getBody(), *function->variance, kernel);
    if (!reason.empty()) {
      made.push_back(std::move(function));
      return reason;
    }
    function->cost =
        costOfLanes(scalar.front(), *function->variance, false, this);
    calls[call] = function.get();
    made.push_back(std::move(function));
    return "";
  }
  calls[call] = known;
  return "";
}

std::string LaneCalls::find() {
  return visit(kernel, variance,
               [&] { return std::make_unique<ThreadVariance>(kernel); });
}

void LaneCalls::declare(int64_t lanes) {
  MLIRContext *context = kernel->getContext();
  auto lanesOf = [&](Type type) -> Type {
    return VectorType::get(lanes, type);
  };
  for (auto &function : made) {
    func::FuncOp scalar = function->scalar;
    SmallVector<Type> types{lanesOf(IntegerType::get(context, 1))};
    for (BlockArgument argument : scalar.getArguments())
      types.push_back(isVarying(argument, *function->variance)
                          ? lanesOf(argument.getType())
                          : argument.getType());
    auto type = FunctionType::get(
        context, types, llvm::map_to_vector(scalar.getResultTypes(), lanesOf));
    auto wide = func::FuncOp::create(scalar.getLoc(), scalar.getName(), type);
    wide.setPrivate();
    wide.setNoInline(true);
    wide->setAttr(warp::attr::kept, UnitAttr::get(context));
    add(wide, scalar, "s");
    function->wide = wide;
  }
}

void LaneCalls::finish() {
  for (auto &function : made)
    function->scalar.erase();
  made.clear();
  llvm::DenseSet<Operation *> reached;
  SmallVector<Operation *> pending{kernel};
  while (!pending.empty())
    for (func::CallOp call : callsOf(pending.pop_back_val()))
      if (func::FuncOp callee = calleeOf(call);
          callee && reached.insert(callee).second)
        pending.push_back(callee);
  for (auto function : llvm::make_early_inc_range(
           kernel->getParentOfType<ModuleOp>().getOps<func::FuncOp>()))
    if (function->hasAttr(warp::attr::kept) && !reached.contains(function))
      function.erase();
}
