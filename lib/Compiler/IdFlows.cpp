//===- IdFlows.cpp - Data flow of geometry handles ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A saved graph has to know which 64-bit integers are ids of meshes, hash grids
// and the like, as other numbers may have the same value. An id is a word of
// the arguments, or of an array's elements, that reaches a handle operand of a
// library function:
//
//   %id = warp.struct_get %scene["mesh"]              scene.mesh is an id
//   %row = warp.load %rows[%i]                        so is rows[...].grid,
//   %grid = warp.struct_get %row["grid"]
//   warp.library_call "warp_mesh_closest"(%id, ...)
//   warp.library_call "warp_slot"(%grid, ...)
//   warp.store %arg2, %ids[%i]                        and arg2 if `ids` has ids
//
// A search goes backwards from such an operand, and from each 64-bit integer
// that is stored, by the steps of ArrayOrigins.cpp. Where it can't tell two
// words apart, as after arithmetic and between the components of a vector,
// each may be an id.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "Context.h"

#include "warp/Compile.h"
#include "warp/NativeCode.h"

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace {

/// The word at a byte of a value in memory; of a tile, of each element.
struct Place {
  Value value;
  int64_t offset = 0;

  bool operator==(const Place &other) const {
    return value == other.value && offset == other.offset;
  }
};

class Search {
public:
  Search(ModuleOp module, func::FuncOp kernel);

  /// Begins at all words of a value of any type, or at one.
  void pushAll(Value value);
  void push(const Place &place) {
    if (seen.insert(place).second)
      queue.push_back(place);
  }
  /// The words that those may be.
  std::vector<warp::IdWord> run();
  /// The words of an array's elements at some bytes of those.
  std::vector<warp::IdWord> elements(Value array, ArrayRef<int64_t> offsets);

private:
  void visit(const Place &place);
  bool visitStruct(const Place &place);
  void visitArgument(const Place &place, BlockArgument argument);
  void visitResult(const Place &place, OpResult result);
  void visitCall(const Place &place, func::CallOp call, unsigned result);
  void visitAccess(const Place &place, Value array);
  void visitOperands(Operation *op);

  struct PlaceInfo : DenseMapInfo<Value> {
    static Place getEmptyKey() {
      return {DenseMapInfo<Value>::getEmptyKey(), 0};
    }
    static Place getTombstoneKey() {
      return {DenseMapInfo<Value>::getTombstoneKey(), 0};
    }
    static unsigned getHashValue(const Place &place) {
      return llvm::hash_combine(place.value, place.offset);
    }
    static bool isEqual(const Place &a, const Place &b) { return a == b; }
  };

  func::FuncOp kernel;
  warp::ArrayOrigins origins;
  warp::ParameterLayout layout;
  SmallVector<Type> elementTypes;
  DenseMap<StringAttr, SmallVector<func::CallOp, 2>> calls;
  SmallVector<Operation *> storesElsewhere;

  DenseSet<Place, PlaceInfo> seen;
  SmallVector<Place> queue;
  std::vector<warp::IdWord> found;
};

} // namespace

//===----------------------------------------------------------------------===//
// Words of types
//===----------------------------------------------------------------------===//

static bool isWord(Type type) {
  auto integer = dyn_cast<IntegerType>(type);
  return integer && integer.getWidth() == 64;
}

/// Bytes of a value, or of an element of a tile, at which it has such words.
static SmallVector<int64_t> wordsOf(Type type) {
  if (auto tile = dyn_cast<warp::TileType>(type))
    type = tile.getElementType();
  SmallVector<int64_t> offsets;
  if (!warp::isArrayElement(type))
    return offsets;
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(type, 0, leaves);
  for (const warp::Leaf &leaf : leaves)
    if (isWord(leaf.type))
      offsets.push_back(leaf.offset);
  return offsets;
}

static int64_t fieldOffset(warp::StructType type, StringRef field) {
  return warp::getFieldOffset(type, type.getFieldIndex(field));
}

//===----------------------------------------------------------------------===//
// Arrays
//===----------------------------------------------------------------------===//

static void collectArrays(Type type, SmallVectorImpl<Type> &elements) {
  if (auto array = dyn_cast<warp::ArrayType>(type))
    elements.push_back(array.getElementType());
  else if (auto record = dyn_cast<warp::StructType>(type))
    for (Type field : record.getFieldTypes())
      collectArrays(field, elements);
}

Search::Search(ModuleOp module, func::FuncOp kernel)
    : kernel(kernel), origins(kernel),
      layout(warp::layOutParameters(kernel.getArgumentTypes())) {
  origins.freeze();
  for (Type type : kernel.getArgumentTypes())
    collectArrays(type, elementTypes);
  module.walk([&](Operation *op) {
    if (auto call = dyn_cast<func::CallOp>(op))
      calls[call.getCalleeAttr().getAttr()].push_back(call);
    if (auto access = dyn_cast<warp::AccessOp>(op);
        access && access.mayWrite() &&
        !origins.of(access.getArray()).isComplete)
      storesElsewhere.push_back(op);
  });
}

std::vector<warp::IdWord> Search::elements(Value array,
                                           ArrayRef<int64_t> offsets) {
  // Views of fields begin in the middle of the elements.
  int64_t start = 0;
  bool isExact = true;
  while (auto view = array.getDefiningOp<warp::ArrayViewOp>()) {
    auto part = dyn_cast<warp::ComponentViewOp>(view.getOperation());
    array = view.getArray();
    if (!part)
      continue;
    auto record = dyn_cast<warp::StructType>(
        cast<warp::ArrayType>(array.getType()).getElementType());
    isExact &= record && part.getField();
    if (isExact)
      start += fieldOffset(record, *part.getField());
  }
  Type type = cast<warp::ArrayType>(array.getType()).getElementType();
  std::vector<warp::IdWord> words;
  for (warp::ArrayMemory memory : origins.of(array).memories) {
    if (memory.isGradient)
      continue;
    SmallVector<int64_t> all = wordsOf(elementTypes[memory.leaf]);
    bool isSame = isExact && elementTypes[memory.leaf] == type;
    for (int64_t offset : all)
      if (!isSame || llvm::is_contained(offsets, offset - start))
        words.push_back({int32_t(memory.leaf), offset});
  }
  return words;
}

void Search::visitAccess(const Place &place, Value array) {
  for (const warp::IdWord &word : elements(array, {place.offset}))
    found.push_back(word);
  if (origins.of(array).isComplete)
    return;
  // Memory that no argument names has what the kernel stores there.
  for (Operation *store : storesElsewhere)
    for (Value value : cast<warp::AccessOp>(store).getWritten())
      pushAll(value);
}

//===----------------------------------------------------------------------===//
// The search
//===----------------------------------------------------------------------===//

void Search::pushAll(Value value) {
  for (int64_t offset : wordsOf(value.getType()))
    push({value, offset});
}

std::vector<warp::IdWord> Search::run() {
  for (size_t i = 0; i < queue.size(); ++i)
    visit(Place(queue[i]));
  queue.clear();
  seen.clear();
  llvm::sort(found);
  found.erase(llvm::unique(found), found.end());
  return std::exchange(found, {});
}

void Search::visit(const Place &place) {
  if (auto argument = dyn_cast<BlockArgument>(place.value))
    return visitArgument(place, argument);
  if (!visitStruct(place))
    visitResult(place, cast<OpResult>(place.value));
}

bool Search::visitStruct(const Place &place) {
  Operation *op = place.value.getDefiningOp();
  if (auto get = dyn_cast<warp::StructGetOp>(op)) {
    auto type = cast<warp::StructType>(get.getSource().getType());
    push({get.getSource(), place.offset + fieldOffset(type, get.getField())});
    return true;
  }
  auto isWithin = [&](Value part, int64_t start) {
    return place.offset >= start &&
           place.offset < start + warp::getByteSize(part.getType());
  };
  if (auto set = dyn_cast<warp::StructSetOp>(op)) {
    auto type = cast<warp::StructType>(set.getTarget().getType());
    int64_t start = fieldOffset(type, set.getField());
    if (isWithin(set.getValue(), start))
      push({set.getValue(), place.offset - start});
    else
      push({set.getTarget(), place.offset});
    return true;
  }
  auto create = dyn_cast<warp::StructCreateOp>(op);
  if (!create)
    return false;
  auto type = cast<warp::StructType>(create.getType());
  for (auto [i, field] : llvm::enumerate(create.getFields()))
    if (int64_t start = warp::getFieldOffset(type, int64_t(i));
        isWithin(field, start))
      push({field, place.offset - start});
  return true;
}

void Search::visitArgument(const Place &place, BlockArgument argument) {
  unsigned number = argument.getArgNumber();
  Operation *owner = argument.getOwner()->getParentOp();
  auto pushAt = [&](ValueRange values, unsigned at) {
    push({values[at], place.offset});
  };
  if (auto function = dyn_cast<func::FuncOp>(owner)) {
    if (function == kernel)
      found.push_back({-1, layout.offsets[number] + place.offset});
    else
      for (func::CallOp call : calls[function.getNameAttr()])
        pushAt(call.getOperands(), number);
  } else if (auto loop = dyn_cast<scf::ForOp>(owner)) {
    if (number == 0)
      return;
    pushAt(loop.getInitArgs(), number - 1);
    pushAt(loop.getYieldedValues(), number - 1);
  } else if (auto loop = dyn_cast<scf::WhileOp>(owner)) {
    if (argument.getOwner() != loop.getBeforeBody())
      return pushAt(loop.getConditionOp().getArgs(), number);
    pushAt(loop.getInits(), number);
    pushAt(loop.getYieldOp().getOperands(), number);
  } else {
    visitOperands(owner);
  }
}

void Search::visitResult(const Place &place, OpResult result) {
  unsigned number = result.getResultNumber();
  Operation *op = result.getOwner();
  if (auto access = dyn_cast<warp::AccessOp>(op)) {
    visitAccess(place, access.getArray());
  } else if (auto access = dyn_cast<warp::TileAccessOp>(op)) {
    visitAccess(place, access.getArray());
  } else if (auto call = dyn_cast<func::CallOp>(op)) {
    visitCall(place, call, number);
  } else if (auto branch = dyn_cast<scf::IfOp>(op)) {
    push({branch.thenYield().getOperand(number), place.offset});
    push({branch.elseYield().getOperand(number), place.offset});
  } else if (auto loop = dyn_cast<scf::ForOp>(op)) {
    push({loop.getInitArgs()[number], place.offset});
    push({loop.getYieldedValues()[number], place.offset});
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    push({loop.getConditionOp().getArgs()[number], place.offset});
  } else if (auto call = dyn_cast<warp::LibraryCallOp>(op);
             !call || call.getCallee().starts_with(warp::nativeCodePrefix)) {
    visitOperands(op);
  }
}

void Search::visitCall(const Place &place, func::CallOp call, unsigned result) {
  auto module = call->getParentOfType<ModuleOp>();
  auto callee = module.lookupSymbol<func::FuncOp>(call.getCallee());
  if (!callee || callee.isExternal())
    return visitOperands(call);
  callee.walk([&](func::ReturnOp end) {
    push({end.getOperand(result), place.offset});
  });
}

/// Any word of what an operation gets, be it by its regions.
void Search::visitOperands(Operation *op) {
  auto pushOperands = [&](Operation *user) {
    for (Value operand : user->getOperands())
      pushAll(operand);
  };
  pushOperands(op);
  for (Region &region : op->getRegions())
    for (Block &block : region)
      if (block.mightHaveTerminator())
        pushOperands(block.getTerminator());
}

//===----------------------------------------------------------------------===//
// Flows
//===----------------------------------------------------------------------===//

/// Operands that are handles. Native code may take any number for one.
static void startAtHandles(Search &search, warp::LibraryCallOp call) {
  if (call.getCallee().starts_with(warp::nativeCodePrefix)) {
    for (Value operand : call.getArgs())
      search.pushAll(operand);
    return;
  }
  const warp::LibraryFunction *function =
      warp::findLibraryFunction(call.getCallee());
  for (auto [operand, letter] :
       llvm::zip_equal(call.getArgs(), function->operands))
    if (letter == 'h')
      search.pushAll(operand);
}

/// The words of memory that values may be written to, one by one.
static void addStores(Search &search, Value array, ValueRange written,
                      std::vector<warp::IdFlow> &flows) {
  for (Value value : written)
    for (int64_t offset : wordsOf(value.getType())) {
      std::vector<warp::IdWord> targets = search.elements(array, {offset});
      if (targets.empty())
        continue;
      search.push({value, offset});
      for (const warp::IdWord &from : search.run())
        for (const warp::IdWord &to : targets)
          flows.push_back({from, to});
    }
}

std::vector<warp::IdFlow> warp::idFlows(const Module &module) {
  ContextLock lock;
  ModuleOp op = *module.getImpl()->op;
  std::vector<IdFlow> flows;
  for (auto function : op.getOps<func::FuncOp>()) {
    if (!function->hasAttr(kernelAttrName))
      continue;
    Search search(op, function);
    op.walk([&](LibraryCallOp call) { startAtHandles(search, call); });
    for (const IdWord &from : search.run())
      flows.push_back({from, std::nullopt});
    op.walk([&](Operation *store) {
      if (auto access = dyn_cast<AccessOp>(store); access && access.mayWrite())
        addStores(search, access.getArray(), access.getWritten(), flows);
      if (auto access = dyn_cast<TileAccessOp>(store);
          access && access.mayWrite() && access.getWritten())
        addStores(search, access.getArray(), access.getWritten(), flows);
    });
    llvm::sort(flows);
    flows.erase(llvm::unique(flows), flows.end());
  }
  return flows;
}
