//===- OwnUpdates.cpp - Atomics on thread-exclusive elements --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The result of an atomic depends on the order of threads, but not where the
// element belongs to one: there it is a load and a store,
//
//   old = atomic min v, a[i]        old = a[i];  a[i] = min(old, v)
//
// which the rest knows how to differentiate. Where indices come from memory,
// the launch shows whether threads conflict (Loops/MemoryLog.cpp).
//
//===----------------------------------------------------------------------===//

#include "OwnUpdates.h"

#include "ApartArrays.h"
#include "MemoryClasses.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/WarpOps.h"

using namespace mlir;

namespace warp::autodiff {

static bool isUsed(AtomicOp op) { return !op.getOld().use_empty(); }

/// True if there are operations that do the same one after the other.
static bool canSplit(AtomicOp op) {
  Type type = op.getValue().getType();
  switch (op.getKind()) {
  case AtomicKind::add:
  case AtomicKind::sub:
  case AtomicKind::exch:
    return true;
  case AtomicKind::min:
  case AtomicKind::max:
    return !isComposite(type) || isa<VecType>(type);
  case AtomicKind::bit_and:
  case AtomicKind::bit_or:
  case AtomicKind::bit_xor:
    return !isComposite(type);
  }
  llvm_unreachable("unknown kind");
}

static SplitUpdate split(AtomicOp op) {
  OpBuilder b(op);
  Location loc = op.getLoc();
  Type type = op.getValue().getType();
  Value old = LoadOp::create(b, loc, type, op.getArray(), op.getIndices());
  Value next = op.getValue();
  if (op.getKind() != AtomicKind::exch) {
    StringRef name = stringifyAtomicKind(op.getKind());
    bool isBitwise = name == "and" || name == "or" || name == "xor";
    next = createBuiltin(b, loc, isBitwise ? "bit_" + name.str() : name.str(),
                         {old, op.getValue()})
               ->getResult(0);
  }
  auto store = StoreOp::create(b, loc, next, op.getArray(), op.getIndices());
  SplitUpdate update{op.getKind(), old.getDefiningOp<LoadOp>(), store};
  op.getOld().replaceAllUsesWith(old);
  op->erase();
  return update;
}

void joinUpdates(ArrayRef<SplitUpdate> updates) {
  for (auto [kind, load, store] : updates) {
    Operation *next = nullptr;
    Value value = store.getValue();
    if (kind != AtomicKind::exch) {
      next = value.getDefiningOp();
      value = next->getOperand(1);
    }
    OpBuilder b(load);
    auto atomic =
        AtomicOp::create(b, load.getLoc(), load.getType(), kind, value,
                         load.getArray(), load.getIndices());
    store->erase();
    if (next && next->use_empty())
      next->erase();
    load.getResult().replaceAllUsesWith(atomic.getOld());
    load->erase();
  }
}

/// True if some access may be to any array: to one that control flow chooses,
/// or by a function that stays a call.
static bool hasUnknownAccess(FunctionOpInterface kernel,
                             const ArrayLeaves &leaves) {
  auto isUnknown = [&](Operation *op) {
    if (auto access = dyn_cast<AccessOp>(op))
      return leaves.of(access.getArray()).empty() &&
             !gradientOwner(access.getArray());
    return isCallWithArrays(op);
  };
  return kernel
      ->walk([&](Operation *op) {
        return isUnknown(op) ? WalkResult::interrupt() : WalkResult::advance();
      })
      .wasInterrupted();
}

/// All atomics of the arrays with one whose result `matters`, by leaf; none of
/// an array with an access that may be of another one, too.
static llvm::MapVector<unsigned, SmallVector<AtomicOp>>
collect(FunctionOpInterface kernel, const ArrayLeaves &leaves,
        function_ref<bool(AtomicOp)> matters) {
  llvm::MapVector<unsigned, SmallVector<AtomicOp>> found;
  llvm::SmallDenseSet<unsigned> wanted, refused;
  kernel->walk([&](AccessOp access) {
    auto leaf = leaves.of(access.getArray());
    auto op = dyn_cast<AtomicOp>(access.getOperation());
    bool isOther = access.isUpdate() && (!op || !canSplit(op));
    if (leaf.size() != 1 || isOther)
      refused.insert(leaf.begin(), leaf.end());
    else if (op)
      found[leaf.front()].push_back(op);
    if (op && leaf.size() == 1 && matters(op))
      wanted.insert(leaf.front());
  });
  found.remove_if([&](auto &entry) {
    return !wanted.contains(entry.first) || refused.contains(entry.first);
  });
  if (!found.empty() && hasUnknownAccess(kernel, leaves))
    found.clear();
  return found;
}

static void limitRank(FunctionOpInterface kernel, const MemoryClasses &memory) {
  Builder b(kernel.getContext());
  kernel->setAttr(attr::maxRank,
                  b.getI64IntegerAttr(memory.getThreadDimensions()));
}

static SmallVector<SplitUpdate> splitAll(FunctionOpInterface kernel,
                                         unsigned leaf,
                                         ArrayRef<AtomicOp> updates) {
  auto found = llvm::map_to_vector(updates, split);
  // Elements are read and written now.
  auto flags = kernel->getAttrOfType<DenseBoolArrayAttr>(apartAttrName);
  if (!flags || leaf >= flags.size())
    return found;
  SmallVector<bool> rest(flags.asArrayRef());
  rest[leaf] = false;
  kernel->setAttr(apartAttrName,
                  DenseBoolArrayAttr::get(kernel.getContext(), rest));
  return found;
}

void splitOwnUpdates(FunctionOpInterface kernel, const ArrayLeaves &leaves) {
  auto found = collect(kernel, leaves, isUsed);
  if (found.empty())
    return;
  Activity activity(kernel, leaves, {});
  MemoryClasses memory(kernel, leaves, activity, /*unique=*/true);
  for (auto &[leaf, updates] : found) {
    if (!memory.isPrivate(leaf))
      continue;
    limitRank(kernel, memory);
    splitAll(kernel, leaf, updates);
  }
}

TrustedUpdates splitTrustedUpdates(FunctionOpInterface kernel,
                                   const ArrayLeaves &leaves,
                                   ArrayRef<bool> active) {
  TrustedUpdates trusted;
  if (collect(kernel, leaves, isUsed).empty())
    return trusted;
  Activity activity(kernel, leaves, active);
  MemoryClasses memory(kernel, leaves, activity, /*unique=*/true);
  auto found = collect(kernel, leaves, [&](AtomicOp op) {
    return isUsed(op) && activity.isActive(op.getOld()) &&
           activity.isActiveArray(op.getArray());
  });
  for (auto &[leaf, updates] : found) {
    bool isKnown = memory.isPrivate(leaf) || memory.isCommon(leaf);
    if (!isKnown && !memory.isUnknown(leaf))
      continue;
    if (memory.isPrivate(leaf))
      limitRank(kernel, memory);
    if (!isKnown)
      trusted.arrays.insert({leaf, updates.front().getLoc()});
    llvm::append_range(trusted.updates, splitAll(kernel, leaf, updates));
  }
  return trusted;
}

} // namespace warp::autodiff
