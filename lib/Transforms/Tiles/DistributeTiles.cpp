//===- DistributeTiles.cpp - Tiles in the registers of their owners -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The rows of a softmax, for example, which are loaded, reduced, mapped and
// stored: without shared memory and its barriers.
//
//===----------------------------------------------------------------------===//

#include "DistributeTiles.h"

#include "KernelFunction.h"

using namespace mlir;

namespace warp::tiles {

/// Words of a thread for one tile.
constexpr int64_t mostWords = 32;

/// True if a use reads elements in the order of the loop of its operation.
static bool readsOwn(OpOperand &use) {
  Operation *op = use.getOwner();
  if (!computesTiles(op))
    return false;
  if (isa<TileAccessOp>(op))
    return use.getOperandNumber() == 0 && getRead(use) == TileRead::Own;
  if (getRead(use) != TileRead::Own)
    return false;
  return !isInline(op) || llvm::all_of(op->getResult(0).getUses(), readsOwn);
}

static bool fits(Value tile, int64_t threads) {
  Operation *def = tile.getDefiningOp();
  TileType type = tileType(tile);
  int64_t own = type.getNumElements() / threads;
  auto op = dyn_cast_or_null<TileOpInterface>(def);
  return op && op.canDistribute() &&
         getLayout(def) == TileLayoutAttr::getPacked(def->getContext()) &&
         type.getNumElements() % threads == 0 &&
         own * llvm::divideCeil(getByteSize(type.getElementType()), 4) <=
             mostWords &&
         llvm::all_of(tile.getUses(), readsOwn);
}

/// True if a store of its own elements is all that a tile is computed for.
static bool isForStore(Operation *op) {
  if (!op->hasOneUse())
    return false;
  OpOperand &use = *op->getUses().begin();
  Operation *user = use.getOwner();
  if (auto access = dyn_cast<TileAccessOp>(user))
    return !access.isUpdate() && use.getOperandNumber() == 0;
  return isa<TileMapOp>(user) && isInline(user) && isForStore(user);
}

/// Loads before the loop of a store what is computed in it: in the loop,
/// each load would wait for the store before it, as arrays may overlap.
static void loadBeforeStores(FunctionOpInterface kernel, int64_t threads) {
  constexpr int64_t mostLoaded = 8;
  kernel->walk([&](TileAccessOp load) {
    TileType type = load.getTileType();
    int64_t own = type.getNumElements() / threads;
    bool fits = !load.mayWrite() && isInline(load) &&
                type.getNumElements() % threads == 0 && own > 1 &&
                own * getByteSize(type.getElementType()) <= 4 * mostLoaded &&
                isForStore(load);
    if (fits)
      setLayout(load, getLayout(load).withStorage(TileStorage::memory));
  });
}

void distributeTiles(FunctionOpInterface kernel, int64_t threads) {
  if (!getTarget(kernel).isSimt() || threads == 1)
    return;
  loadBeforeStores(kernel, threads);
  TileBuffers buffers(kernel);
  llvm::MapVector<Value, SmallVector<Value>> byRoot;
  for (Value tile : buffers.getTiles())
    byRoot[buffers.rootOf(tile)].push_back(tile);
  llvm::MapVector<Value, SmallVector<Value>> distributed;
  for (auto &[root, members] : byRoot) {
    bool all =
        llvm::all_of(members, [&](Value tile) { return fits(tile, threads); });
    // Accumulators, which are copied, have another order of elements.
    auto isSum = [&](Value value) {
      return isTile(value) && buffers.isInRegisters(value);
    };
    all &= llvm::none_of(members, [&](Value tile) {
      Operation *def = tile.getDefiningOp();
      return (def && llvm::any_of(def->getOperands(), isSum)) ||
             llvm::any_of(getReaders(tile), [&](Operation *reader) {
               return llvm::any_of(reader->getResults(), isSum);
             });
    });
    if (all)
      distributed[root] = members;
  }
  // Results of one operation are in registers together, or not at all.
  auto isApart = [&](const auto &entry) {
    return llvm::any_of(entry.second, [&](Value tile) {
      return llvm::any_of(
          tile.getDefiningOp()->getResults(), [&](Value result) {
            return !distributed.contains(buffers.rootOf(result));
          });
    });
  };
  for (bool changes = true; changes;) {
    SmallVector<Value> apart;
    for (const auto &entry : distributed)
      if (isApart(entry))
        apart.push_back(entry.first);
    for (Value root : apart)
      distributed.erase(root);
    changes = !apart.empty();
  }
  for (auto &[root, members] : distributed)
    for (Value tile : members)
      setLayout(tile.getDefiningOp(),
                getLayout(tile).withStorage(TileStorage::distributed));
}

//===----------------------------------------------------------------------===//
// Numbers
//===----------------------------------------------------------------------===//

/// True if a use reads single elements, rather than the tile's memory.
static bool readsElements(OpOperand &use) {
  Operation *op = use.getOwner();
  if (!computesTiles(op))
    return false;
  auto inPlace = op->getAttrOfType<IntegerAttr>(attr::inPlace);
  if (inPlace && inPlace.getInt() == use.getOperandNumber())
    return false;
  if (isInline(op))
    return llvm::all_of(op->getResult(0).getUses(), readsElements);
  return cast<TileOpInterface>(op).readsElements(use);
}

void replicateElements(FunctionOpInterface kernel, int64_t threads) {
  if (!getTarget(kernel).isSimt() || threads == 1)
    return;
  TileBuffers buffers(kernel);
  llvm::DenseMap<Value, int64_t> sharers;
  for (Value tile : buffers.getTiles())
    ++sharers[buffers.rootOf(tile)];
  kernel->walk([&](TileOpInterface op) {
    if (!op.canReplicate())
      return;
    Value result = op->getResult(0);
    if (isInline(op) || sharers[buffers.rootOf(result)] != 1 ||
        !llvm::all_of(result.getUses(), readsElements))
      return;
    setLayout(op, getLayout(result).withStorage(TileStorage::replicated));
  });
}

} // namespace warp::tiles
