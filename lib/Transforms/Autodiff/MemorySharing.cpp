//===- MemorySharing.cpp - Element sharing among threads ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An index that is a multiple of a thread index, plus a remainder smaller than
// the multiple, belongs to one thread. Where indices come from memory, nothing
// is known: the launch may be asked to find out (Loops/MemoryLog.cpp).
//
//===----------------------------------------------------------------------===//

#include "MemoryClasses.h"

#include "Tiles/DisjointWindows.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

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
  auto tiles = dyn_cast<TileAccessOp>(access.op);
  if (!tiles || tiles.getPicked())
    return window;
  for (auto &index : access.indices)
    if (index)
      window.push_back({*index, 1});
  for (auto [offset, extent] :
       llvm::zip_equal(tiles.getOffsets(), tiles.getTileType().getShape()))
    window.push_back({Forms().of(offset), extent});
  return window;
}

/// True if blocks that differ in one of these dimensions of the launch access
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
      return tiles::getDisjointStep(window[axis].first, window[axis].second,
                                    dim);
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

/// True if the indices are made of more than thread indices and what all
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

bool MemoryClasses::isCommon(unsigned leaf) const {
  return getSharing(select(leaf, /*onlyActive=*/false)) == Sharing::Single;
}

bool MemoryClasses::isUnknown(unsigned leaf) const {
  SmallVector<const Access *> all = select(leaf, /*onlyActive=*/false);
  return getSharing(all) == Sharing::Trusted || mayMeetUnseen(all);
}

SmallVector<unsigned> MemoryClasses::findUnknownSharing() const {
  SmallVector<unsigned> found;
  for (unsigned leaf = 0; leaf < accesses.size(); ++leaf) {
    SmallVector<const Access *> active = select(leaf, /*onlyActive=*/true);
    auto isWrite = [](const Access *access) { return access->isWrite; };
    if (llvm::any_of(active, isWrite) && !llvm::all_of(active, isWrite) &&
        !isApart(leaf) && getSharing(active) == Sharing::Shared &&
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
  if (isApart(leaf)) {
    bool isWrite = cast<AccessOp>(op).mayWrite();
    llvm::erase_if(others, [&](const Access *access) {
      return access->isWrite != isWrite;
    });
  }
  return countOwnedDimensions(others, /*mayWrap=*/false);
}

/// True if a value comes out of a branch or is carried by a loop.
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
    if (write == active.end() || read == active.end() || isApart(leaf))
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

} // namespace warp::autodiff
