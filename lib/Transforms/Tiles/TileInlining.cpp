//===- TileInlining.cpp - Tiles that are computed where used --------------===//
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

/// Whether all threads compute the same element at the same index.
bool TileInlining::isThreadIndependent(Operation *op) const {
  return threads == 1 || llvm::all_of(op->getOperands(), [&](Value operand) {
           if (!isTile(operand))
             return isConstantLike(operand);
           Operation *def = operand.getDefiningOp();
           return !def || !isInline(def) || isThreadIndependent(def);
         });
}

/// Whether no element is computed twice.
bool TileInlining::readsOnce(Operation *user) const {
  return readsOwnElements(user) || isView(user) ||
         isa<TileReduceOp, TileArgReduceOp, TileInsertOp, TileGetOp>(user) ||
         (threads == 1 && isa<TileScanOp>(user));
}

//===----------------------------------------------------------------------===//
// Arrays
//===----------------------------------------------------------------------===//

/// Loads of what is computed in the loop of a use.
static void collectLoads(Operation *op, bool isOwn,
                         SmallVector<std::pair<TileLoadOp, bool>> &loads) {
  if (auto load = dyn_cast<TileLoadOp>(op))
    loads.emplace_back(load, isOwn);
  for (Value operand : op->getOperands()) {
    Operation *def = operand.getDefiningOp();
    if (def && isTile(operand) && isInline(def))
      collectLoads(def, isOwn && isa<TileMapOp>(op), loads);
  }
}

bool TileInlining::mayWrite(Operation *op, Value array) const {
  auto result = op->walk([&](Operation *nested) {
    bool meets;
    if (auto access = dyn_cast<AccessOp>(nested))
      meets = access.mayWrite() && origins.mayAlias(access.getArray(), array);
    else if (isa<TileStoreOp, TileAtomicOp>(nested))
      meets = origins.mayAlias(nested->getOperand(1), array);
    else if (isa<TileLoadOp>(nested) ||
             nested->hasTrait<OpTrait::HasRecursiveMemoryEffects>())
      meets = false;
    else
      meets = !isMemoryEffectFree(nested);
    return meets ? WalkResult::interrupt() : WalkResult::advance();
  });
  return result.wasInterrupted();
}

/// Whether each thread computes the elements that it treats, where `op` is
/// used.
static bool isOwn(Operation *op, Operation *user) {
  return llvm::all_of(user->getOpOperands(), [&](OpOperand &use) {
    return use.get().getDefiningOp() != op || readsOwnElements(use);
  });
}

/// Whether nothing that `op` loads changes until it is used.
bool TileInlining::isUnchangedUntil(Operation *op, Operation *user) const {
  SmallVector<std::pair<TileLoadOp, bool>> loads;
  collectLoads(op, isOwn(op, user), loads);
  for (auto [load, loadsOwn] : loads) {
    for (Operation *next = op->getNextNode(); next && next != user;
         next = next->getNextNode())
      if (mayWrite(next, load.getArray()))
        return false;
    // The use writes elements that are yet to be loaded, but for the same ones.
    bool isSame = loadsOwn && isa<TileStoreOp>(user) &&
                  user->getOperand(1) == load.getArray() && !load.getPicked() &&
                  llvm::equal(llvm::drop_begin(user->getOperands(), 2),
                              llvm::drop_begin(load->getOperands(), 1));
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
      (!isCheap && !readsOnce(user)))
    return false;
  // A part that is inserted is read with the indices of the part.
  if (!isOwn(op, user) && !isThreadIndependent(op))
    return false;
  if (isa<TileInsertOp>(user) && user->getOperand(0) != op->getResult(0))
    return isCheap;
  return isUnchangedUntil(op, user);
}

bool TileInlining::shouldInline(Operation *op) const {
  if (isView(op)) {
    // Of memory; what is not kept follows the rule for others.
    Operation *source = op;
    while (source && isView(source))
      source = source->getOperand(0).getDefiningOp();
    if (!source || !isInline(source))
      return llvm::all_of(op->getUsers(), computesTiles);
  }
  if (!isView(op) && !isa<TileSplatOp, TileIotaOp, TileMapOp, TileLoadOp>(op))
    return false;
  if (op->getNumResults() != 1 ||
      (isa<TileMapOp>(op) && !isMemoryEffectFree(op)))
    return false;
  bool isCheap = isa<TileSplatOp, TileIotaOp>(op) && isThreadIndependent(op);
  if (!isCheap && !op->hasOneUse())
    return false;
  return llvm::all_of(op->getUsers(),
                      [&](Operation *user) { return fits(op, user, isCheap); });
}

} // namespace warp::tiles
