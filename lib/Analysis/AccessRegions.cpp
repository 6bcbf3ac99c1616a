//===- AccessRegions.cpp - Access regions of a kernel's arrays ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each access becomes one of the formula, or several if its indices leave a
// choice. RegionForms.cpp follows the indices.
//
//===----------------------------------------------------------------------===//

#include "Analysis/AccessRegions.h"

#include "RegionBuilder.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"
#include "warp/NativeCode.h"

#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;
using warp::IndexForm;
using warp::IndexForms;
using warp::RegionBuilder;

RegionBuilder::RegionBuilder(func::FuncOp kernel)
    : kernel(kernel), origins(kernel),
      layout(warp::layOutParameters(kernel.getArgumentTypes())) {
  for (auto [type, offset] :
       llvm::zip_equal(kernel.getArgumentTypes(), layout.offsets)) {
    SmallVector<warp::Leaf> leaves;
    warp::collectLeaves(type, offset, leaves);
    for (warp::Leaf leaf : leaves)
      if (isa<warp::ArrayType>(leaf.type))
        offsets.push_back(leaf.offset);
  }
  formula.unknown.assign(origins.getLeaves().size(), false);
}

/// The forms of an access's indices along the dimensions of the array that its
/// views were taken of; false if a view has another origin.
bool RegionBuilder::collectIndices(Value array,
                                   SmallVectorImpl<const IndexForms *> &indices,
                                   Value &root) {
  while (auto view = array.getDefiningOp<warp::ArrayViewOp>()) {
    if (auto part = dyn_cast<warp::ViewOp>(view.getOperation())) {
      SmallVector<const IndexForms *> leading;
      for (Value index : part.getIndices())
        leading.push_back(&formsOf(index));
      indices.insert(indices.begin(), leading.begin(), leading.end());
    } else if (auto slice = dyn_cast<warp::SliceOp>(view.getOperation())) {
      if (slice.getDim() < indices.size())
        indices[slice.getDim()] = &unknown;
    } else if (!isa<warp::ComponentViewOp>(view)) {
      return false;
    }
    array = view.getArray();
  }
  root = array;
  return true;
}

void RegionBuilder::markUnknown(Value array) {
  warp::ArrayOrigin origin = origins.of(array);
  for (warp::ArrayMemory memory : origin.memories)
    if (!memory.isGradient && memory.leaf < int64_t(formula.unknown.size()))
      formula.unknown[memory.leaf] = true;
  if (!origin.isComplete) {
    formula.unknown.assign(formula.unknown.size(), true);
    formula.isOpen = true;
  }
}

/// True if an operation may reach memory that no array of the kernel names.
/// Nested operations are looked at for themselves.
static bool isOpen(Operation *op) {
  if (auto call = dyn_cast<warp::LibraryCallOp>(op)) {
    // Searches and texture reads get a handle, others numbers alone.
    return call.getNumResults() == 0 ||
           call.getCallee().starts_with(warp::nativeCodePrefix) ||
           llvm::any_of(call.getOperandTypes(), [](Type type) {
             return !type.isIntOrFloat() || type.isInteger(64);
           });
  }
  if (auto call = dyn_cast<func::CallOp>(op)) {
    auto callee = SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(
        op, call.getCalleeAttr());
    return !callee || callee.isExternal();
  }
  if (isa<ModuleOp, func::FuncOp>(op) ||
      op->hasTrait<OpTrait::HasRecursiveMemoryEffects>())
    return false;
  // At address 0 there is no array: a field of a struct before it is given one.
  if (auto at = dyn_cast<warp::ArrayAtOp>(op))
    return !matchPattern(at.getAddress(), m_Zero());
  if (isa<warp::PointerOp>(op))
    return true;
  if (isa<warp::PrintfOp, warp::AssertOp, warp::CheckIndexOp,
          warp::BarrierOp>(op))
    return false;
  auto effects = dyn_cast<MemoryEffectOpInterface>(op);
  if (!effects)
    return true;
  SmallVector<MemoryEffects::EffectInstance> all;
  effects.getEffects(all);
  return llvm::any_of(all, [](const MemoryEffects::EffectInstance &effect) {
    Value value = effect.getValue();
    return !value || !isa<warp::ArrayType, warp::ScratchType>(value.getType());
  });
}

void RegionBuilder::addChoices(warp::RegionFormula::Access access,
                               ArrayRef<const IndexForms *> indices) {
  size_t choices = 1;
  for (const IndexForms *forms : indices)
    choices *= std::max<size_t>(forms->size(), 1);
  // Too many: any index where there is a choice.
  bool isSimple = choices <= IndexForm::most;
  for (size_t number = 0; number < (isSimple ? choices : 1); ++number) {
    access.indices.clear();
    size_t rest = number;
    for (const IndexForms *forms : indices) {
      warp::RegionFormula::Index index;
      if (forms->size() == 1 || (isSimple && !forms->empty())) {
        const IndexForm &form = (*forms)[rest % forms->size()];
        rest /= forms->size();
        index.base = form.base;
        for (const IndexForm::Symbol &symbol : form.symbols)
          index.symbols.push_back({symbol.factor, symbol.count});
      }
      access.indices.push_back(index);
    }
    formula.accesses.push_back(access);
  }
}

/// The only array of the arguments that an access may be to; nothing if there
/// are others, and the whole array is marked.
std::optional<unsigned>
RegionBuilder::leafOf(Value array,
                      SmallVectorImpl<const IndexForms *> &indices) {
  Value root;
  SmallVector<unsigned, 1> leaf;
  if (collectIndices(array, indices, root))
    leaf = origins.getLeaves().of(root);
  if (leaf.size() == 1)
    return leaf.front();
  markUnknown(array);
  return std::nullopt;
}

void RegionBuilder::add(warp::AccessOp op) {
  SmallVector<const IndexForms *> indices;
  for (Value index : op.getIndices())
    indices.push_back(&formsOf(index));
  std::optional<unsigned> leaf = leafOf(op.getArray(), indices);
  if (!leaf)
    return;
  warp::RegionFormula::Access access;
  access.array = static_cast<int32_t>(*leaf);
  access.reads = !op.mayWrite() || (op.isUpdate() && !op->use_empty());
  access.writes = op.mayWrite();
  addChoices(access, indices);
}

/// Any elements along the dimensions of a tile, of the part of the array that a
/// view has.
void RegionBuilder::add(warp::TileAccessOp op) {
  SmallVector<const IndexForms *> indices(op.getOffsets().size(), &unknown);
  std::optional<unsigned> leaf = leafOf(op.getArray(), indices);
  if (!leaf)
    return;
  warp::RegionFormula::Access access;
  access.array = static_cast<int32_t>(*leaf);
  access.reads = !op.mayWrite() || op.isUpdate();
  access.writes = op.mayWrite();
  addChoices(access, indices);
}

void RegionBuilder::visit(Operation *op) {
  formula.isOpen |= isOpen(op);
  formula.prints |= isa<warp::PrintfOp>(op);
  if (auto access = dyn_cast<warp::AccessOp>(op)) {
    if (access->getParentOfType<func::FuncOp>() == kernel)
      add(access);
    else
      markUnknown(access.getArray());
    return;
  }
  if (auto access = dyn_cast<warp::TileAccessOp>(op);
      access && access->getParentOfType<func::FuncOp>() == kernel)
    return add(access);
  // An array that is passed on is followed to where it is accessed.
  if (isa<warp::ArrayViewOp, warp::DimOp, warp::GradOp, func::CallOp,
          func::ReturnOp, RegionBranchOpInterface,
          RegionBranchTerminatorOpInterface, warp::StructCreateOp,
          warp::StructSetOp, warp::StructGetOp>(op))
    return;
  for (Value operand : op->getOperands())
    if (isa<warp::ArrayType>(operand.getType()))
      markUnknown(operand);
}

warp::RegionFormula RegionBuilder::run() {
  kernel->getParentOfType<ModuleOp>().walk([&](Operation *op) { visit(op); });
  return std::move(formula);
}

warp::RegionFormula warp::findAccessRegions(func::FuncOp kernel) {
  return RegionBuilder(kernel).run();
}
