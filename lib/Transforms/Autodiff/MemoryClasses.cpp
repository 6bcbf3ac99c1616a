//===- MemoryClasses.cpp - What a kernel does to each array ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An adjoint runs after its launch, when arrays hold what the launch left. For
// every load of an array that the kernel also writes, this file answers whether
// its value can be had again, from the array or from a copy made before the
// launch; for every access of a gradient, whether threads can meet there.
//
// Both questions are about indices. An index that is a multiple of a thread
// index, plus a remainder smaller than the multiple, belongs to one thread.
// Within a thread, two accesses are apart if their indices differ by a constant
// other than zero, taking the iterations of common loops into account; see
// MemoryOrder.cpp.
//
//===----------------------------------------------------------------------===//

#include "MemoryClasses.h"

#include "Analysis/Effects.h"
#include "Autodiff/ApartArrays.h"
#include "Tiles/OwnWindows.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

#include "llvm/ADT/TypeSwitch.h"

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
  } else if (auto view = dyn_cast<IndexDimOp>(op.getOperation())) {
    access.indices.insert(access.indices.begin() + view.getDim(),
                          Forms().of(view.getIndex()));
  } else if (auto slice = dyn_cast<SliceOp>(op.getOperation())) {
    access.indices[slice.getDim()] = std::nullopt;
  } else if (auto part = dyn_cast<ComponentViewOp>(op.getOperation())) {
    SmallVector<Attribute, 2> component;
    if (StringAttr field = part.getFieldAttr())
      component.push_back(field);
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
  if (isa<TileLoadOp, TileStoreOp, TileAtomicOp>(op)) {
    // Many elements: nothing is known of their indices.
    access.isWrite = !isa<TileLoadOp>(op);
    access.array = op->getOperand(access.isWrite);
    auto type = cast<ArrayType>(access.array.getType());
    access.indices.resize(type.getRank());
    followViews(access.array, access);
    return access;
  }
  auto accessOp = dyn_cast<AccessOp>(op);
  if (!accessOp)
    return std::nullopt;
  access.array = accessOp.getArray();
  access.isWrite = accessOp.mayWrite();
  for (Value index : accessOp.getIndices())
    access.indices.push_back(Forms().of(index));
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
  // What is added to gradients is no element that a derivative is by.
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

/// Whether no element of a leaf is both read and written by the launch that the
/// derivative is for.
static bool isApart(const ArrayLeaves &leaves, unsigned leaf) {
  auto flags =
      leaves.getFunction()->getAttrOfType<DenseBoolArrayAttr>(apartAttrName);
  return flags && leaf < flags.size() && flags[leaf];
}

//===----------------------------------------------------------------------===//
// Threads
//===----------------------------------------------------------------------===//

bool MemoryClasses::isOwnedAlong(ArrayRef<const Access *> accesses,
                                 unsigned axis, unsigned dim,
                                 bool mayWrap) const {
  SmallVector<const Form *> indices;
  for (const Access *access : accesses) {
    if (axis >= access->indices.size() || !access->indices[axis])
      return false;
    indices.push_back(&*access->indices[axis]);
  }
  return variance.tellThreadsApart(indices, dim, mayWrap);
}

unsigned MemoryClasses::countOwnedDimensions(ArrayRef<const Access *> accesses,
                                             bool mayWrap) const {
  for (unsigned dim = 0; dim < 4; ++dim) {
    unsigned axis = 0;
    while (axis < 4 && !isOwnedAlong(accesses, axis, dim, mayWrap))
      ++axis;
    if (axis == 4)
      return dim;
  }
  return 4;
}

/// First indices and extents of what an operation on tiles accesses.
static SmallVector<std::pair<Form, int64_t>> windowOf(const Access &access) {
  SmallVector<std::pair<Form, int64_t>> window;
  auto add = [&](auto op, TileType tile) {
    if (op.getPicked())
      return;
    for (auto &index : access.indices)
      if (index)
        window.push_back({*index, 1});
    for (auto [offset, extent] :
         llvm::zip_equal(op.getOffsets(), tile.getShape()))
      window.push_back({Forms().of(offset), extent});
  };
  llvm::TypeSwitch<Operation *>(access.op)
      .Case([&](TileLoadOp op) {
        add(op, cast<TileType>(op.getResult().getType()));
      })
      .Case<TileStoreOp, TileAtomicOp>(
          [&](auto op) { add(op, cast<TileType>(op.getTile().getType())); });
  return window;
}

/// Whether blocks that differ in one of these dimensions of the launch access
/// windows side by side.
static bool areSideBySide(ArrayRef<const Access *> accesses, unsigned dims) {
  SmallVector<SmallVector<std::pair<Form, int64_t>>> windows;
  for (const Access *access : accesses)
    windows.push_back(windowOf(*access));
  size_t rank = windows.front().size();
  if (dims == 0 || llvm::any_of(windows, [&](auto &window) {
        return window.size() != rank;
      }))
    return false;
  auto isApart = [&](unsigned dim, size_t axis) {
    auto stepOf = [&](auto &window) {
      return tiles::getOwnStep(window[axis].first, window[axis].second, dim);
    };
    int64_t step = stepOf(windows.front());
    return step > 0 && llvm::all_of(windows, [&](auto &window) {
             return stepOf(window) == step;
           });
  };
  return llvm::all_of(llvm::seq(dims), [&](unsigned dim) {
    return llvm::any_of(llvm::seq(rank),
                        [&](size_t axis) { return isApart(dim, axis); });
  });
}

Sharing MemoryClasses::getSharing(ArrayRef<const Access *> accesses) const {
  if (areSideBySide(accesses, threadDimensions))
    return Sharing::Private;
  unsigned owned = countOwnedDimensions(accesses, /*mayWrap=*/true);
  if (owned > 0 && owned >= threadDimensions)
    return Sharing::Private;
  bool isSame = true, isSingle = true, isComputed = false;
  llvm::SmallDenseSet<unsigned> dims;
  for (const Access *access : accesses)
    for (auto [index, other] :
         llvm::zip_equal(access->indices, accesses.front()->indices)) {
      isSame &= index && other && index->equals(*other);
      isSingle &= index.has_value();
      if (!index)
        continue;
      for (const Term &term : index->terms)
        for (Symbol symbol : term.product) {
          bool isThread = symbol.kind == Symbol::Kind::Thread;
          bool isKnown =
              variance.agreement(symbol, Scope::Launch) != Agreement::No;
          isSingle &= isKnown;
          isComputed |= !isKnown && !isThread;
          if (isThread)
            dims.insert(symbol.number);
        }
    }
  if (isSingle)
    return Sharing::Single;
  bool isTrusted = isSame && (isComputed || dims.size() >= threadDimensions);
  return isTrusted ? Sharing::Trusted : Sharing::Shared;
}

Sharing MemoryClasses::getSharing(unsigned leaf, bool onlyActive) const {
  return trusted.contains(leaf) ? Sharing::Trusted
                                : getSharing(select(leaf, onlyActive));
}

bool MemoryClasses::isPrivate(unsigned leaf) const {
  return getSharing(select(leaf, /*onlyActive=*/false)) == Sharing::Private;
}

/// Whether the indices are made of more than thread indices and what all
/// threads know.
bool MemoryClasses::mayMeetUnseen(ArrayRef<const Access *> accesses) const {
  auto isSeen = [&](Symbol symbol) {
    return symbol.kind == Symbol::Kind::Thread ||
           variance.agreement(symbol, Scope::Launch) != Agreement::No;
  };
  return !llvm::all_of(accesses, [&](const Access *access) {
    return llvm::all_of(access->indices, [&](auto &index) {
      return index && llvm::all_of(index->terms, [&](const Term &term) {
               return llvm::all_of(term.product, isSeen);
             });
    });
  });
}

SmallVector<unsigned> MemoryClasses::findUnknownSharing() const {
  SmallVector<unsigned> found;
  for (unsigned leaf = 0; leaf < accesses.size(); ++leaf) {
    SmallVector<const Access *> active = select(leaf, /*onlyActive=*/true);
    auto isWrite = [](const Access *access) { return access->isWrite; };
    if (llvm::any_of(active, isWrite) && !llvm::all_of(active, isWrite) &&
        !isApart(leaves, leaf) && getSharing(active) == Sharing::Shared &&
        mayMeetUnseen(active))
      found.push_back(leaf);
  }
  return found;
}

int64_t MemoryClasses::getUniqueRank(Operation *op) const {
  unsigned leaf;
  if (!unique || !lookup(op, leaf))
    return 0;
  if (!oneThread.empty())
    return 4;
  SmallVector<const Access *> others = select(leaf, /*onlyActive=*/true);
  if (isApart(leaves, leaf)) {
    bool isWrite = cast<AccessOp>(op).mayWrite();
    llvm::erase_if(others, [&](const Access *access) {
      return access->isWrite != isWrite;
    });
  }
  return countOwnedDimensions(others, /*mayWrap=*/false);
}

/// Whether a value comes out of a branch or is carried by a loop.
static bool isCarried(Value value) {
  Operation *op = value.getDefiningOp();
  if (!op)
    op = cast<BlockArgument>(value).getOwner()->getParentOp();
  return isa<scf::IfOp, scf::ForOp, scf::WhileOp>(op);
}

LogicalResult MemoryClasses::verify() {
  for (Operation *op : unknown)
    if (auto access = dyn_cast<AccessOp>(op);
        access && access.mayWrite() && failed(checkAddress(access)))
      return failure();
  for (Operation *op : unknown)
    if (hasDerivative(op->getOperand(0).getType()) ||
        (op->getNumResults() == 1 && hasDerivative(op->getResult(0).getType())))
      return op->emitError(
          isCarried(rootOf(getAccess(op)->array))
              ? "the array that is accessed here depends on control flow; "
                "write one access per array instead, each in its branch"
              : "the array that is accessed here is read from an array of "
                "structs, and its gradient is not known; pass the array to "
                "the kernel");
  for (unsigned leaf = 0; leaf < accesses.size(); ++leaf) {
    SmallVector<const Access *> active = select(leaf, /*onlyActive=*/true);
    auto isWrite = [](const Access *access) { return access->isWrite; };
    const auto *write = llvm::find_if(active, isWrite);
    const auto *read = llvm::find_if_not(active, isWrite);
    if (write == active.end() || read == active.end() || isApart(leaves, leaf))
      continue;
    Sharing sharing = getSharing(leaf, /*onlyActive=*/true);
    std::string name = leaves.getName(leaf);
    if (sharing == Sharing::Single)
      oneThread =
          "all threads read and write the same elements of '" + name + "'";
    if (sharing != Sharing::Shared)
      continue;
    // Name a pair whose indices differ.
    for (const Access *access : active)
      if (isWrite(access) && getSharing({*read, access}) == Sharing::Shared)
        write = llvm::find(active, access);
    auto diagnostic =
        (*read)->op->emitError("'")
        << name << "' is read here, and other threads of the launch may write "
        << "what is read, so that its gradient depends on their order; split "
        << "the kernel in two, write to another array, or move the reads into "
        << "a function with a derivative of its own";
    diagnostic.attachNote((*write)->op->getLoc())
        << "'" << name << "' is written here";
    return failure();
  }
  return success();
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
  if (!read || !isWritten(leaf) || isApart(leaves, leaf))
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

} // namespace warp::autodiff
