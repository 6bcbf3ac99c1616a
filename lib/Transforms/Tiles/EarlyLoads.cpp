//===- EarlyLoads.cpp - Hoisting of independent loads ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The adjoint of a softmax, for example, reduces a row of its argument before
// it needs one of the gradients. A block that loads both at first waits for
// memory once, and not once more behind each reduction. Tiles of a constant,
// as those that clear gradients, are stored last instead: a store that finds
// its line on the way from memory takes long (OrderAccesses.cpp).
//
//===----------------------------------------------------------------------===//

#include "EarlyLoads.h"

#include "Analysis/ArrayOrigins.h"
#include "KernelFunction.h"

#include "mlir/IR/Matchers.h"

using namespace mlir;

namespace warp::tiles {

/// Words of a thread that are loaded early, all in all.
constexpr int64_t mostWords = 32;

/// True if an operation may write elements of an array, or read them if `reads`
/// counts; functions of elements may do so, too.
static bool mayTouch(Operation *op, Value array, const ArrayOrigins &origins,
                     bool reads) {
  if (auto access = dyn_cast<TileAccessOp>(op))
    return (reads || access.mayWrite()) &&
           origins.mayAlias(access.getArray(), array);
  if (auto access = dyn_cast<AccessOp>(op))
    return (reads || access.mayWrite()) &&
           origins.mayAlias(access.getArray(), array);
  bool isFunction = isa<TileOpInterface>(op) && op->getNumRegions() != 0;
  if (isMemoryEffectFree(op))
    return !isFunction && op->getNumRegions() != 0;
  if (!isFunction)
    return true;
  return op
      ->walk([&](Operation *nested) {
        bool touches = nested->getNumRegions() == 0 &&
                       mayTouch(nested, array, origins, reads);
        return touches ? WalkResult::interrupt() : WalkResult::advance();
      })
      .wasInterrupted();
}

/// True if what is loaded from an array, or from elements that nobody else
/// changes, has to be loaded behind an operation.
static bool keepsBefore(Operation *op, Value array,
                        const ArrayOrigins &origins) {
  return !isInline(op) && mayTouch(op, array, origins, /*reads=*/false);
}

/// True if elements of an array have to be stored before an operation. The old
/// value of an update may tell other blocks that they are.
static bool needsStored(Operation *op, Value array,
                        const ArrayOrigins &origins) {
  auto access = dyn_cast<AccessOp>(op);
  auto tiles = dyn_cast<TileAccessOp>(op);
  bool isUpdate = (tiles && tiles.isUpdate()) || (access && access.isUpdate());
  return (isUpdate && !op->use_empty()) ||
         mayTouch(op, array, origins, /*reads=*/true);
}

namespace {

class LoadHoister {
public:
  LoadHoister(FunctionOpInterface kernel, int64_t threads)
      : origins(kernel, getVariant(kernel).getDisjoint()), threads(threads) {}

  /// Moves a load, or what an update needs but for its tile.
  void hoist(TileAccessOp op) {
    TileType type = op.getTileType();
    int64_t words = type.getNumElements() / threads *
                    llvm::divideCeil(getByteSize(type.getElementType()), 4);
    if (words > left)
      return;
    left -= words;
    Operation *target = op;
    while (Operation *before = target->getPrevNode()) {
      auto access = dyn_cast<TileAccessOp>(before);
      bool isLoad = access && !access.mayWrite() && !isInline(before);
      if (isLoad || keepsBefore(before, op.getArray(), origins))
        break;
      target = before;
    }
    move(op, target);
  }

private:
  /// Before another operation, with what it needs that can be moved.
  static void move(TileAccessOp op, Operation *target) {
    bool moves = !op.mayWrite();
    llvm::SetVector<Operation *> needed;
    auto isNeeded = [&](Operation *other) {
      ValueRange operands = op->getOperands();
      for (Value operand : moves ? operands : operands.drop_front())
        if (operand.getDefiningOp() == other)
          return true;
      return llvm::any_of(other->getUsers(), [&](Operation *user) {
        return needed.contains(user);
      });
    };
    Operation *end = target->getPrevNode();
    for (Operation *other = op->getPrevNode(); op != target && other != end;
         other = other->getPrevNode()) {
      if (!isNeeded(other))
        continue;
      if (computesTiles(other) || other->getNumRegions() != 0 ||
          !isMemoryEffectFree(other)) {
        target = other->getNextNode();
        break;
      }
      needed.insert(other);
    }
    auto place = [&](Operation *moved) {
      if (moved == target)
        target = moved->getNextNode();
      else
        moved->moveBefore(target);
    };
    for (Operation *other : llvm::reverse(needed))
      place(other);
    if (moves)
      place(op);
  }

  ArrayOrigins origins;
  int64_t threads, left = mostWords;
};

} // namespace

void hoistLoads(FunctionOpInterface kernel, int64_t threads) {
  if (!getTarget(kernel).isSimt() || threads == 1)
    return;
  SmallVector<TileAccessOp> ops;
  kernel->walk([&](TileAccessOp op) {
    bool isRead = op.getEffect() != AccessEffect::Write && !isInline(op);
    if (isRead && !op.getPicked() &&
        (op.isUpdate() || isDistributed(op->getResult(0))))
      ops.push_back(op);
  });
  LoadHoister hoister(kernel, threads);
  for (TileAccessOp op : ops)
    hoister.hoist(op);
}

void sinkConstants(FunctionOpInterface kernel) {
  if (!getTarget(kernel).isSimt())
    return;
  ArrayOrigins origins(kernel, getVariant(kernel).getDisjoint());
  SmallVector<TileAccessOp> stores;
  kernel->walk([&](TileAccessOp op) {
    if (op.getEffect() != AccessEffect::Write)
      return;
    auto splat = op.getWritten().getDefiningOp<TileSplatOp>();
    if (splat && matchPattern(splat.getValue(), m_Constant()))
      stores.push_back(op);
  });
  for (TileAccessOp store : llvm::reverse(stores)) {
    Operation *next = store->getNextNode();
    while (!next->hasTrait<OpTrait::IsTerminator>() &&
           !needsStored(next, store.getArray(), origins))
      next = next->getNextNode();
    store->moveBefore(next);
  }
}

Operation *findEarliest(TileAccessOp update) {
  auto kernel = update->getParentOfType<FunctionOpInterface>();
  ArrayOrigins origins(kernel, getVariant(kernel).getDisjoint());
  // Other threads may have written these elements before they waited.
  Operation *target = update.getOperation(), *barrier = nullptr;
  auto behindWrites = [&] { return barrier ? barrier->getNextNode() : target; };
  bool isFixed = false;
  for (Operation *before = update->getPrevNode(); before;
       before = before->getPrevNode()) {
    auto isOf = [&](Value operand) {
      return operand.getDefiningOp() == before;
    };
    if (isa<BarrierOp>(before)) {
      if (isFixed)
        return target;
      barrier = before;
    } else if (keepsBefore(before, update.getArray(), origins)) {
      return behindWrites();
    }
    isFixed |= llvm::any_of(update->getOperands().drop_front(), isOf);
    if (!isFixed)
      target = before;
  }
  bool isFirst = update->getBlock() == &kernel.getFunctionBody().front();
  return isFirst ? target : behindWrites();
}

} // namespace warp::tiles
