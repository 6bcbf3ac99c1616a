//===- TileInlining.cpp - Recomputation of tiles at their uses ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A tile that is not kept moves to its use, and what it loads is loaded there:
// between the two, nothing may write that. The use itself may, as a store of
// what was loaded at the same place does, if each element is read before it is
// written, and by the same thread.
//
//===----------------------------------------------------------------------===//

#include "TileInlining.h"

#include "KernelFunction.h"

using namespace mlir;

namespace warp::tiles {

TileInlining::TileInlining(FunctionOpInterface kernel, int64_t threads)
    : threads(threads), origins(kernel, getVariant(kernel).getDisjoint()) {}

static bool isConstantLike(Value value) {
  Operation *op = value.getDefiningOp();
  return op && (isa<ConstantOp>(op) ||
                (op->getNumOperands() == 0 && isMemoryEffectFree(op)) ||
                (isa<ConstructOp>(op) &&
                 llvm::all_of(op->getOperands(), isConstantLike)));
}

/// True if all threads compute the same element at the same index.
bool TileInlining::isThreadIndependent(Operation *op) const {
  return threads == 1 || llvm::all_of(op->getOperands(), [&](Value operand) {
           if (!isTile(operand))
             return isConstantLike(operand);
           Operation *def = operand.getDefiningOp();
           return !def || !isInline(def) || isThreadIndependent(def);
         });
}

/// True if no element is computed twice.
static bool readsOnce(Operation *op, Operation *user) {
  return llvm::all_of(user->getOpOperands(), [&](OpOperand &use) {
    return use.get().getDefiningOp() != op || getRead(use) != TileRead::Any;
  });
}

//===----------------------------------------------------------------------===//
// Arrays
//===----------------------------------------------------------------------===//

/// Loads of what is computed in the loop of a use.
static void collectLoads(Operation *op, bool isOwn,
                         SmallVector<std::pair<TileAccessOp, bool>> &loads) {
  if (auto load = dyn_cast<TileAccessOp>(op))
    loads.emplace_back(load, isOwn);
  for (OpOperand &use : op->getOpOperands()) {
    Operation *def = use.get().getDefiningOp();
    if (def && isTile(use.get()) && isInline(def))
      collectLoads(def, isOwn && getRead(use) == TileRead::Own, loads);
  }
}

bool TileInlining::mayWrite(Operation *op, Value array) const {
  auto result = op->walk([&](Operation *nested) {
    bool meets;
    if (auto access = dyn_cast<AccessOp>(nested))
      meets = access.mayWrite() && origins.mayAlias(access.getArray(), array);
    else if (auto access = dyn_cast<TileAccessOp>(nested))
      meets = access.mayWrite() && origins.mayAlias(access.getArray(), array);
    else if (nested->hasTrait<OpTrait::HasRecursiveMemoryEffects>())
      meets = false;
    else
      meets = !isMemoryEffectFree(nested);
    return meets ? WalkResult::interrupt() : WalkResult::advance();
  });
  return result.wasInterrupted();
}

/// True if each thread computes the elements that it treats, where `op` is
/// used.
static bool isOwn(Operation *op, Operation *user) {
  return llvm::all_of(user->getOpOperands(), [&](OpOperand &use) {
    return use.get().getDefiningOp() != op || getRead(use) == TileRead::Own;
  });
}

/// True if nothing that `op` loads changes until it is used.
bool TileInlining::isUnchangedUntil(Operation *op, Operation *user) const {
  SmallVector<std::pair<TileAccessOp, bool>> loads;
  auto access = dyn_cast<TileAccessOp>(user);
  collectLoads(op, isOwn(op, user), loads);
  for (auto [load, loadsOwn] : loads) {
    for (Operation *next = op->getNextNode(); next && next != user;
         next = next->getNextNode())
      if (mayWrite(next, load.getArray()))
        return false;
    // The use writes elements that are yet to be loaded, but for the same ones.
    bool isSame = loadsOwn && access && !access.isUpdate() &&
                  access.getArray() == load.getArray() && !load.getPicked() &&
                  !access.getPicked() &&
                  access.getOffsets() == load.getOffsets();
    if (!isSame && mayWrite(user, load.getArray()))
      return false;
  }
  return true;
}

//===----------------------------------------------------------------------===//
// The decision
//===----------------------------------------------------------------------===//

bool TileInlining::fits(Operation *op, Operation *user, bool isCheap) const {
  if (user->getBlock() != op->getBlock() || !computesTiles(user) ||
      (!isCheap && !readsOnce(op, user)))
    return false;
  // A part that is inserted is read with the indices of the part.
  if (!isOwn(op, user) && !isThreadIndependent(op))
    return false;
  if (isa<TileInsertOp>(user) && user->getOperand(0) != op->getResult(0))
    return isCheap;
  return isUnchangedUntil(op, user);
}

bool TileInlining::shouldInline(Operation *op) const {
  auto isView = [](Operation *op) {
    auto tileOp = dyn_cast<TileOpInterface>(op);
    return tileOp && tileOp.isView();
  };
  if (isView(op)) {
    // Views of memory; those of inlined tiles follow the rule below.
    Operation *source = op;
    while (source && isView(source))
      source = source->getOperand(0).getDefiningOp();
    if (!source || !isInline(source))
      return llvm::all_of(op->getUsers(), computesTiles);
  }
  auto tileOp = cast<TileOpInterface>(op);
  bool isRead = isMemoryEffectFree(op) || isa<TileAccessOp>(op);
  if (!tileOp.isElementwise() || op->getNumResults() != 1 || !isRead)
    return false;
  bool isCheap = tileOp.isCheap() && isThreadIndependent(op);
  if (!isCheap && !op->hasOneUse())
    return false;
  return llvm::all_of(op->getUsers(),
                      [&](Operation *user) { return fits(op, user, isCheap); });
}

} // namespace warp::tiles
