//===- MemoryClasses.cpp - Effects of a kernel on each array --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An adjoint runs after its launch, when arrays hold what the launch left. For
// every load of an array that the kernel also writes, this file answers whether
// its value can be recovered, from the array or from a copy made before the
// launch; for every access of a gradient, whether threads can conflict there.
//
// Both questions are about indices: MemorySharing.cpp asks them about threads.
// Within a thread, two accesses are apart if their indices differ by a constant
// other than zero, taking the iterations of common loops into account; see
// MemoryOrder.cpp.
//
//===----------------------------------------------------------------------===//

#include "MemoryClasses.h"

#include "Analysis/Effects.h"
#include "Autodiff/ApartArrays.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

using namespace mlir;

namespace warp::autodiff {

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

/// Adds what views say about an access, from its array up to the leaf.
static void followViews(Value array, Access &access) {
  auto op = array.getDefiningOp<ArrayViewOp>();
  if (!op)
    return;
  if (auto view = dyn_cast<ViewOp>(op.getOperation())) {
    SmallVector<std::optional<Form>, 2> leading;
    for (Value index : view.getIndices())
      leading.push_back(Forms().of(index));
    access.indices.insert(access.indices.begin(), leading.begin(),
                          leading.end());
    access.values.insert(access.values.begin(), view.getIndices().begin(),
                         view.getIndices().end());
  } else if (auto view = dyn_cast<IndexDimOp>(op.getOperation())) {
    access.indices.insert(access.indices.begin() + view.getDim(),
                          Forms().of(view.getIndex()));
    access.values.insert(access.values.begin() + view.getDim(),
                         view.getIndex());
  } else if (auto slice = dyn_cast<SliceOp>(op.getOperation())) {
    access.indices[slice.getDim()] = std::nullopt;
    access.values[slice.getDim()] = nullptr;
  } else if (auto part = dyn_cast<ComponentViewOp>(op.getOperation())) {
    SmallVector<Attribute, 2> component;
    auto parts = cast<ArrayType>(part.getArray().getType());
    if (isa<TransformType>(parts.getElementType()) && part.getField()) {
      // Numbers that have indices, too.
      access.component.clear();
      access.hasUnknownComponent = true;
    } else if (StringAttr field = part.getFieldAttr()) {
      component.push_back(field);
    }
    for (Value index : part.getIndices()) {
      auto constant = getConstantInteger(index);
      if (!constant || *constant < 0) {
        // Anywhere within the part that views further out select.
        access.component.clear();
        access.hasUnknownComponent = true;
        break;
      }
      component.push_back(
          IntegerAttr::get(IndexType::get(op->getContext()), *constant));
    }
    access.component.insert(access.component.begin(), component.begin(),
                            component.end());
  }
  followViews(op.getArray(), access);
}

std::optional<Access> getAccess(Operation *op) {
  Access access;
  access.op = op;
  if (auto tiles = dyn_cast<TileAccessOp>(op)) {
    // Many elements: nothing is known of their indices.
    access.isWrite = tiles.mayWrite();
    access.array = tiles.getArray();
    auto type = cast<ArrayType>(access.array.getType());
    access.indices.resize(type.getRank());
    access.values.resize(type.getRank());
    followViews(access.array, access);
    return access;
  }
  auto accessOp = dyn_cast<AccessOp>(op);
  if (!accessOp)
    return std::nullopt;
  access.array = accessOp.getArray();
  access.isWrite = accessOp.mayWrite();
  for (Value index : accessOp.getIndices()) {
    access.indices.push_back(Forms().of(index));
    access.values.push_back(index);
  }
  followViews(access.array, access);
  return access;
}

bool areSame(const Access &a, const Access &b) {
  if (a.component != b.component || a.indices.size() != b.indices.size() ||
      a.hasUnknownComponent || b.hasUnknownComponent)
    return false;
  return llvm::all_of(llvm::zip(a.indices, b.indices), [](auto pair) {
    auto &[x, y] = pair;
    return x && y && x->equals(*y);
  });
}

void MemoryClasses::collect(Operation *op) {
  ++position;
  if (auto tid = dyn_cast<TidOp>(op))
    threadDimensions = std::max(threadDimensions, tid.getNumResults());
  std::optional<Access> access = getAccess(op);
  if (!access)
    return;
  numbers.try_emplace(op, numbers.size());
  access->position = position;
  access->isActive = access->isWrite ? activity.isActiveArray(access->array)
                                     : activity.isActive(op->getResult(0));
  SmallVector<unsigned, 1> known = leaves.of(access->array);
  // A term that is added to gradients is no element that a derivative is by.
  // Nothing writes what is at an address while a kernel runs.
  if (!access->isWrite && rootOf(access->array).getDefiningOp<ArrayAtOp>())
    return;
  if (known.empty() && !(isSum(op) && gradientOwner(access->array)))
    unknown.push_back(op);
  for (unsigned leaf : known) {
    places[op] = {leaf, accesses[leaf].size()};
    accesses[leaf].push_back(*access);
  }
}

MemoryClasses::MemoryClasses(FunctionOpInterface function,
                             const ArrayLeaves &leaves,
                             const Activity &activity, bool unique)
    : leaves(leaves), activity(activity), variance(function, /*disjoint=*/true),
      unique(unique), accesses(leaves.size()) {
  function->walk<WalkOrder::PreOrder>([&](Operation *op) { collect(op); });
}

const Access *MemoryClasses::lookup(Operation *op, unsigned &leaf) const {
  auto found = places.find(op);
  if (found == places.end())
    return nullptr;
  leaf = found->second.first;
  return &accesses[leaf][found->second.second];
}

SmallVector<const Access *> MemoryClasses::select(unsigned leaf,
                                                  bool onlyActive) const {
  SmallVector<const Access *> selected;
  for (const Access &access : accesses[leaf])
    if (access.isActive || !onlyActive)
      selected.push_back(&access);
  return selected;
}

bool MemoryClasses::isWritten(unsigned leaf) const {
  return llvm::any_of(accesses[leaf],
                      [](const Access &access) { return access.isWrite; });
}

bool MemoryClasses::isApart(unsigned leaf) const {
  auto flags =
      leaves.getFunction()->getAttrOfType<DenseBoolArrayAttr>(apartAttrName);
  return flags && leaf < flags.size() && flags[leaf];
}

//===----------------------------------------------------------------------===//
// Contents
//===----------------------------------------------------------------------===//

static std::string describe(Operation *op) {
  std::string text;
  llvm::raw_string_ostream stream(text);
  if (auto place = op->getLoc()->findInstanceOf<FileLineColLoc>())
    stream << " (line " << place.getLine() << ")";
  return text;
}

Recovery MemoryClasses::getRecovery(Operation *load, std::string &why,
                                    bool &needsOneThread) const {
  unsigned leaf;
  const Access *read = lookup(load, leaf);
  needsOneThread = false;
  if (!read || !isWritten(leaf) || isApart(leaf))
    return Recovery::Reload;
  Sharing sharing = getSharing(leaf, /*onlyActive=*/false);
  const Access *before = nullptr, *after = nullptr;
  for (const Access &write : accesses[leaf]) {
    if (!write.isWrite)
      continue;
    if (sharing == Sharing::Shared)
      before = after = &write;
    if (mayWriteBefore(*read, write))
      before = &write;
    if (mayWriteAfter(*read, write))
      after = &write;
  }
  needsOneThread = sharing == Sharing::Single;
  if (!after)
    return Recovery::Reload;
  if (!before)
    return Recovery::Preserved;
  std::string name = leaves.getName(leaf);
  why = "the derivative needs what '" + name +
        "' holds here, but the launch overwrites it" + describe(after->op) +
        (sharing == Sharing::Shared ? ", in any order of threads" : "") +
        "; keep the value in a variable, or write to another array";
  return Recovery::Impossible;
}

std::optional<WriteOrder> MemoryClasses::getWriteOrder(Operation *load) const {
  unsigned leaf;
  const Access *read = lookup(load, leaf);
  if (!read || getSharing(leaf, /*onlyActive=*/false) != Sharing::Private)
    return std::nullopt;
  SmallVector<const Access *> writes = select(leaf, /*onlyActive=*/false);
  llvm::erase_if(writes, [](const Access *access) { return !access->isWrite; });
  return findWriteOrder(*read, writes);
}

} // namespace warp::autodiff
