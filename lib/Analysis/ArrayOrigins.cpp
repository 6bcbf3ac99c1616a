//===- ArrayOrigins.cpp - Underlying memory of array values ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One step leads from an array to those that it may come from: the operand of
// a view or of `warp.grad`, the field that a struct was made with, what enters
// a loop or leaves a branch, what a caller passes or a callee returns. A
// search takes steps until it arrives at arguments of the kernel. Within a
// struct an array is known by its number among the struct's arrays.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/IR/Matchers.h"
#include "mlir/IR/SymbolTable.h"

#include "llvm/ADT/SetVector.h"

using namespace mlir;

Value warp::rootOf(Value array) {
  while (auto view = array.getDefiningOp<ArrayViewOp>())
    array = view.getArray();
  return array;
}

Value warp::gradientOwner(Value array) {
  auto gradients = rootOf(array).getDefiningOp<GradOp>();
  return gradients ? gradients.getArray() : Value();
}

unsigned warp::countArrays(Type type) {
  if (isa<ArrayType>(type))
    return 1;
  unsigned count = 0;
  if (auto structure = dyn_cast<StructType>(type))
    for (Type field : structure.getFieldTypes())
      count += countArrays(field);
  return count;
}

bool warp::isCallWithArrays(Operation *op) {
  return isa<func::CallOp>(op) &&
         llvm::any_of(op->getOperandTypes(),
                      [](Type type) { return countArrays(type) != 0; });
}

/// Arrays of a struct that come before those of a field.
static unsigned firstOfField(warp::StructType type, StringRef field) {
  unsigned first = 0;
  for (Type before : type.getFieldTypes().take_front(type.getFieldIndex(field)))
    first += warp::countArrays(before);
  return first;
}

//===----------------------------------------------------------------------===//
// One step
//===----------------------------------------------------------------------===//

namespace {

/// Array number `number` of a value, or its gradients.
struct Place {
  Value value;
  unsigned number = 0;
  bool isGradient = false;

  bool operator==(const Place &other) const {
    return value == other.value && number == other.number &&
           isGradient == other.isGradient;
  }
};

} // namespace

/// True for what a struct's field is before it is given an array: no memory.
static bool isNoArray(Operation *op) {
  auto at = dyn_cast_or_null<warp::ArrayAtOp>(op);
  return at && matchPattern(at.getAddress(), m_Zero());
}

/// The place that this one is a view or a field of; none if it is neither.
static std::optional<Place> stepUp(const Place &place) {
  Operation *op = place.value.getDefiningOp();
  if (auto view = dyn_cast_or_null<warp::ArrayViewOp>(op))
    return Place{view.getArray(), place.number, place.isGradient};
  if (auto get = dyn_cast_or_null<warp::StructGetOp>(op)) {
    auto type = cast<warp::StructType>(get.getSource().getType());
    return Place{get.getSource(),
                 place.number + firstOfField(type, get.getField()),
                 place.isGradient};
  }
  return std::nullopt;
}

/// The same for the operations that make structs.
static std::optional<Place> stepIntoStruct(const Place &place) {
  Operation *op = place.value.getDefiningOp();
  if (auto set = dyn_cast_or_null<warp::StructSetOp>(op)) {
    auto type = cast<warp::StructType>(set.getTarget().getType());
    unsigned first = firstOfField(type, set.getField());
    bool isInField =
        place.number >= first &&
        place.number - first < warp::countArrays(set.getValue().getType());
    return isInField
               ? Place{set.getValue(), place.number - first, place.isGradient}
               : Place{set.getTarget(), place.number, place.isGradient};
  }
  if (auto create = dyn_cast_or_null<warp::StructCreateOp>(op)) {
    unsigned number = place.number;
    for (Value field : create.getFields()) {
      unsigned count = warp::countArrays(field.getType());
      if (number < count)
        return Place{field, number, place.isGradient};
      number -= count;
    }
  }
  return std::nullopt;
}

/// The argument of the function that contains it, if the value is one.
static std::optional<unsigned> getArgument(Value value,
                                           FunctionOpInterface &function) {
  auto argument = dyn_cast<BlockArgument>(value);
  if (!argument || !argument.getOwner()->isEntryBlock())
    return std::nullopt;
  function = dyn_cast<FunctionOpInterface>(argument.getOwner()->getParentOp());
  if (!function)
    return std::nullopt;
  return argument.getArgNumber();
}

//===----------------------------------------------------------------------===//
// Leaves
//===----------------------------------------------------------------------===//

warp::ArrayLeaves::ArrayLeaves(FunctionOpInterface function)
    : function(function) {
  for (Type type : function.getArgumentTypes()) {
    first.push_back(count);
    count += countArrays(type);
  }
}

SmallVector<unsigned, 1> warp::ArrayLeaves::of(Value array) const {
  Place place{array};
  while (std::optional<Place> next = stepUp(place))
    place = *next;
  FunctionOpInterface owner;
  std::optional<unsigned> argument = getArgument(place.value, owner);
  if (!argument)
    return {};
  return {first[*argument] + place.number};
}

/// The path to array number `leaf` of a value, after its name.
static std::string getPath(Type type, unsigned leaf) {
  auto structure = dyn_cast<warp::StructType>(type);
  if (!structure)
    return "";
  for (auto [name, field] :
       llvm::zip(structure.getFieldNames(), structure.getFieldTypes())) {
    unsigned count = warp::countArrays(field);
    if (leaf < count)
      return "." + name.getValue().str() + getPath(field, leaf);
    leaf -= count;
  }
  return "";
}

std::string warp::ArrayLeaves::getName(unsigned leaf) const {
  unsigned argument = first.size() - 1;
  while (first[argument] > leaf)
    --argument;
  auto names = function->getAttrOfType<ArrayAttr>(attr::argNames);
  std::string name = names && argument < names.size()
                         ? cast<StringAttr>(names[argument]).getValue().str()
                         : "argument " + std::to_string(argument);
  Type type = function.getArgumentTypes()[argument];
  return name + getPath(type, leaf - first[argument]);
}

//===----------------------------------------------------------------------===//
// The search
//===----------------------------------------------------------------------===//

namespace {

using CallSites = DenseMap<StringAttr, SmallVector<Operation *, 2>>;

class Search {
public:
  /// `calls`: all of the module, by callee, if they are known.
  Search(const warp::ArrayLeaves &leaves, const CallSites *calls)
      : leaves(leaves), calls(calls) {}
  warp::ArrayOrigin run(Value array);

private:
  void push(Place place) {
    if (!llvm::is_contained(seen, place))
      seen.push_back(place);
  }
  void visit(const Place &place);
  void visitArgument(const Place &place, FunctionOpInterface function,
                     unsigned argument);
  void visitCall(const Place &place, func::CallOp call);
  void visitRegions(const Place &place, Operation *op);
  void visitOperands(const Place &place, Operation *op);
  void arrive(int64_t leaf, bool isGradient) {
    origin.memories.push_back({leaf, isGradient});
  }

  const warp::ArrayLeaves &leaves;
  const CallSites *calls;
  SmallVector<Place> seen;
  warp::ArrayOrigin origin;
};

} // namespace

warp::ArrayOrigin Search::run(Value array) {
  push({array});
  for (size_t i = 0; i < seen.size(); ++i)
    visit(Place(seen[i]));
  llvm::sort(origin.memories);
  origin.memories.erase(llvm::unique(origin.memories), origin.memories.end());
  return std::move(origin);
}

void Search::visit(const Place &place) {
  std::optional<Place> next = stepUp(place);
  if (!next)
    next = stepIntoStruct(place);
  if (next)
    return push(*next);
  Operation *op = place.value.getDefiningOp();
  if (!op) {
    FunctionOpInterface function;
    if (auto argument = getArgument(place.value, function))
      return visitArgument(place, function, *argument);
    Value carried = place.value;
    return visitRegions(place, carried.getParentBlock()->getParentOp());
  }
  if (auto gradients = dyn_cast<warp::GradOp>(op))
    return push({gradients.getArray(), place.number, true});
  if (auto parameter = dyn_cast<warp::ParameterOp>(op))
    return arrive(parameter.getOffset(), place.isGradient);
  if (auto call = dyn_cast<func::CallOp>(op))
    return visitCall(place, call);
  if (isNoArray(op))
    return;
  if (op->getNumRegions() != 0)
    return visitRegions(place, op);
  visitOperands(place, op);
}

void Search::visitArgument(const Place &place, FunctionOpInterface function,
                           unsigned argument) {
  if (function == leaves.getFunction())
    return arrive(leaves.getFirst(argument) + place.number, place.isGradient);
  auto pass = [&](Operation *call) {
    push({call->getOperand(argument), place.number, place.isGradient});
  };
  if (calls) {
    if (auto found = calls->find(function.getNameAttr()); found != calls->end())
      llvm::for_each(found->second, pass);
    return;
  }
  auto module = function->getParentOfType<ModuleOp>();
  module.walk([&](func::CallOp call) {
    if (call.getCallee() == function.getName())
      pass(call);
  });
}

void Search::visitCall(const Place &place, func::CallOp call) {
  auto module = call->getParentOfType<ModuleOp>();
  auto callee = module.lookupSymbol<func::FuncOp>(call.getCallee());
  if (!callee || callee.isExternal()) {
    origin.isComplete = false;
    return;
  }
  unsigned result = cast<OpResult>(place.value).getResultNumber();
  callee.walk([&](func::ReturnOp end) {
    push({end.getOperand(result), place.number, place.isGradient});
  });
}

void Search::visitRegions(const Place &place, Operation *op) {
  auto pushAll = [&](ValueRange values) {
    for (Value value : values)
      if (value.getType() == place.value.getType())
        push({value, place.number, place.isGradient});
  };
  pushAll(op->getOperands());
  for (Region &region : op->getRegions())
    for (Block &block : region)
      if (block.mightHaveTerminator())
        pushAll(block.getTerminator()->getOperands());
}

/// An operation that chooses between arrays; what else makes one is unknown.
void Search::visitOperands(const Place &place, Operation *op) {
  bool isChoice = false;
  for (Value operand : op->getOperands())
    if (operand.getType() == place.value.getType()) {
      push({operand, place.number, place.isGradient});
      isChoice = true;
    }
  origin.isComplete &= isChoice;
}

warp::ArrayOrigins::ArrayOrigins(FunctionOpInterface function, bool disjoint)
    : leaves(function), disjoint(disjoint) {}

void warp::ArrayOrigins::freeze() {
  frozen = std::make_unique<Frozen>();
  auto module = leaves.getFunction()->getParentOfType<ModuleOp>();
  module.walk([&](func::CallOp call) {
    frozen->calls[call.getCalleeAttr().getAttr()].push_back(call);
  });
}

warp::ArrayOrigin warp::ArrayOrigins::of(Value array) const {
  if (!frozen)
    return Search(leaves, nullptr).run(array);
  auto [found, isNew] = frozen->known.try_emplace(array);
  if (isNew)
    found->second = Search(leaves, &frozen->calls).run(array);
  return found->second;
}

bool warp::ArrayOrigins::mayAlias(Value a, Value b) const {
  if (!disjoint || rootOf(a) == rootOf(b))
    return true;
  ArrayOrigin first = of(a), second = of(b);
  if (!first.isComplete || !second.isComplete)
    return true;
  return llvm::any_of(first.memories, [&](const ArrayMemory &memory) {
    return llvm::is_contained(second.memories, memory);
  });
}
