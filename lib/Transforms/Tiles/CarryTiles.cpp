//===- CarryTiles.cpp - Carried tiles as values of threads ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Loops and branches of a GPU kernel that carry a tile of one element per
// thread, of which each thread makes and uses its own alone, carry a value of
// each thread instead:
//
//   %t = scf.if %c -> tile<32xf32>      %v = scf.if %c -> f32
//     yield %a                     =>     yield tile_to_threads %a
//   else                                else
//     yield %b                            yield tile_to_threads %b
//                                       %t = tile_map(%v)
//
// So it needs neither memory nor a copy where branches meet.
//
//===----------------------------------------------------------------------===//

#include "CarryTiles.h"

#include "KernelFunction.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::tiles {

namespace {

class TileCarrier {
public:
  TileCarrier(FunctionOpInterface kernel, int64_t threads)
      : kernel(kernel), threads(threads), b(kernel.getContext()) {}

  void run();

private:
  bool fits(Value tile) const;
  void rebuild(Operation *op);
  Value toThreads(Value tile);
  Value fromThreads(Value value, Type tile);

  FunctionOpInterface kernel;
  int64_t threads;
  OpBuilder b;
  llvm::DenseSet<Value> carried;
  /// The values of threads that tiles were made from.
  llvm::DenseMap<Value, Value> sources;
  SmallVector<Operation *> made;
};

} // namespace

static bool isCarrier(Operation *op) { return isa<scf::ForOp, scf::IfOp>(op); }

/// True if each thread makes its own element, and uses read no other one's.
bool TileCarrier::fits(Value tile) const {
  TileType type = tileType(tile);
  Operation *def = tile.getDefiningOp();
  if (type.getRank() != 1 || type.getNumElements() != threads ||
      isa<ArrayType, StructType>(type.getElementType()))
    return false;
  auto maker = dyn_cast_or_null<TileOpInterface>(def);
  Operation *around = tile.getParentBlock()->getParentOp();
  if (def ? !(isCarrier(def) || (maker && maker.isElementwise()))
          : !isa<scf::ForOp>(around))
    return false;
  return llvm::all_of(tile.getUses(), [](OpOperand &use) {
    Operation *owner = use.getOwner();
    if (isCarrier(owner))
      return true;
    if (owner->hasTrait<OpTrait::IsTerminator>())
      return isCarrier(owner->getParentOp());
    if (isa<TileAccessOp>(owner) && use.getOperandNumber() != 0)
      return false;
    return computesTiles(owner) && getRead(use) == TileRead::Own;
  });
}

Value TileCarrier::toThreads(Value tile) {
  if (Value source = sources.lookup(tile))
    return source;
  return TileToThreadsOp::create(b, tile.getLoc(),
                                 tileType(tile).getElementType(), tile);
}

Value TileCarrier::fromThreads(Value value, Type tile) {
  Location loc = value.getLoc();
  auto map = TileMapOp::create(b, loc, TypeRange(tile), ValueRange(value));
  OpBuilder::InsertionGuard guard(b);
  Block *body = b.createBlock(&map.getBody(), {}, value.getType(), loc);
  TileYieldOp::create(b, loc, ValueRange(body->getArgument(0)));
  sources[map.getResult(0)] = value;
  made.push_back(map);
  return map.getResult(0);
}

/// The same control flow with elements in place of the tiles that fit.
void TileCarrier::rebuild(Operation *op) {
  SmallVector<unsigned> found;
  for (OpResult result : op->getResults())
    if (carried.contains(result))
      found.push_back(result.getResultNumber());
  if (found.empty())
    return;
  auto loop = dyn_cast<scf::ForOp>(op);
  SmallVector<Type> types(op->getResultTypes());
  for (unsigned i : found) {
    Type tile = types[i];
    types[i] = cast<TileType>(tile).getElementType();
    if (loop) {
      b.setInsertionPoint(op);
      OpOperand &init = loop.getInitArgsMutable()[i];
      init.set(toThreads(init.get()));
      BlockArgument argument = loop.getRegionIterArg(i);
      argument.setType(types[i]);
      b.setInsertionPointToStart(loop.getBody());
      Value inside = fromThreads(argument, tile);
      argument.replaceAllUsesExcept(inside, inside.getDefiningOp());
    }
    for (Region &region : op->getRegions()) {
      Operation *end = region.front().getTerminator();
      b.setInsertionPoint(end);
      end->setOperand(i, toThreads(end->getOperand(i)));
    }
  }
  OperationState state(op->getLoc(), op->getName(), op->getOperands(), types,
                       op->getAttrs());
  for (Region &region : op->getRegions())
    state.addRegion()->takeBody(region);
  b.setInsertionPoint(op);
  Operation *rebuilt = b.create(state);
  b.setInsertionPointAfter(rebuilt);
  for (auto [old, made] :
       llvm::zip_equal(op->getResults(), rebuilt->getResults()))
    old.replaceAllUsesWith(old.getType() == made.getType()
                               ? Value(made)
                               : fromThreads(made, old.getType()));
  op->erase();
}

void TileCarrier::run() {
  TileBuffers buffers(kernel);
  llvm::MapVector<Value, SmallVector<Value>> byRoot;
  for (Value tile : buffers.getTiles())
    byRoot[buffers.rootOf(tile)].push_back(tile);
  for (auto &[root, members] : byRoot)
    if (llvm::all_of(members, [&](Value tile) { return fits(tile); }))
      carried.insert(members.begin(), members.end());
  SmallVector<Operation *> carriers;
  kernel->walk([&](Operation *op) {
    if (isCarrier(op))
      carriers.push_back(op);
  });
  for (Operation *op : carriers)
    rebuild(op);
  for (Operation *map : made)
    if (map->use_empty())
      map->erase();
}

void carryTiles(FunctionOpInterface kernel, int64_t threads) {
  if (getTarget(kernel).isSimt() && threads > 1 &&
      !getVariant(kernel).getDebug())
    TileCarrier(kernel, threads).run();
}

} // namespace warp::tiles
