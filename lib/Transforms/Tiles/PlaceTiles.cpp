//===- PlaceTiles.cpp - Materialisation of tiles, in-place updates --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Five decisions, in this order:
//
//   carried    on a GPU, tiles of one element per thread pass through loops and
//              branches as values of threads (CarryTiles.h)
//   inlined    views of other tiles; what has one use and reads nothing that is
//              overwritten before that use (TileInlining.h)
//   in place   an operation that replaces elements, if nobody reads what it
//              replaces afterwards
//   copies     where loops and branches carry tiles, each carried tile has one
//              piece of memory; what is not computed in it is copied there.
//              A tile that only one branch changes stays where it is, and so
//              does one that the condition of a loop passes on
//   registers  on a GPU, accumulators of products (PlanAccumulators.cpp) and
//              elements of their owners (DistributeTiles.h)
//
// A copy into memory that exists is a `tile_map` with the target as its second
// operand, in place of that.
//
//===----------------------------------------------------------------------===//

#include "CarryTiles.h"
#include "DistributeTiles.h"
#include "EarlyLoads.h"
#include "KernelFunction.h"
#include "TileForms.h"
#include "TileInlining.h"
#include "TileProducts.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

namespace warp {
#define GEN_PASS_DEF_PLACETILES
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

//===----------------------------------------------------------------------===//
// In place
//===----------------------------------------------------------------------===//

/// True if an operand is, or is computed from, the memory of a tile.
static bool readsMemoryOf(Value operand, Value tile) {
  if (operand == tile)
    return true;
  Operation *def = operand.getDefiningOp();
  return def && isTile(operand) && isInline(def) &&
         llvm::any_of(def->getOperands(),
                      [&](Value v) { return readsMemoryOf(v, tile); });
}

/// True if `op` is in the block of a tile, or in branches there: in a loop it
/// would be executed again.
static bool isInBranchesOf(Operation *op, Value tile) {
  while (op->getBlock() != tile.getParentBlock()) {
    op = op->getParentOp();
    if (!isa<scf::IfOp>(op))
      return false;
  }
  return true;
}

/// True if a reader of a tile that `op` is in the branches of is done before
/// `op`, or is in the other branch.
static bool isDoneBefore(Operation *reader, Operation *op) {
  while (true) {
    Block *block = op->getBlock();
    if (Operation *inBlock = block->findAncestorOpInBlock(*reader))
      return inBlock->isBeforeInBlock(op) &&
             !inBlock->hasTrait<OpTrait::IsTerminator>();
    op = block->getParentOp();
    if (op->isAncestor(reader))
      return true;
  }
}

static bool canReplace(Operation *op, unsigned number) {
  Value tile = op->getOperand(number);
  Operation *def = tile.getDefiningOp();
  if (!isInBranchesOf(op, tile) || (def && isInline(def)) ||
      (def && isa<RegionBranchOpInterface>(def) && !isa<scf::ForOp>(def)))
    return false;
  for (auto [i, operand] : llvm::enumerate(op->getOperands()))
    if (i != number && isTile(operand) && readsMemoryOf(operand, tile))
      return false;
  return llvm::all_of(getReaders(tile), [&](Operation *reader) {
    return reader == op || isDoneBefore(reader, op);
  });
}

//===----------------------------------------------------------------------===//
// Copies
//===----------------------------------------------------------------------===//

/// A tile with the elements of another one, in new memory or in that of `into`.
static Value copy(OpBuilder &b, Location loc, Value tile, Value into = {}) {
  Type element = tileType(tile).getElementType();
  SmallVector<Value> inputs{tile};
  if (into)
    inputs.push_back(into);
  auto map = TileMapOp::create(b, loc, tile.getType(), inputs);
  OpBuilder::InsertionGuard guard(b);
  SmallVector<Type> types(inputs.size(), element);
  SmallVector<Location> places(inputs.size(), loc);
  Block *body = b.createBlock(&map.getBody(), {}, types, places);
  TileYieldOp::create(b, loc, ValueRange(body->getArgument(0)));
  if (into)
    map->setAttr(tiles::attr::inPlace, b.getI64IntegerAttr(1));
  return map.getResult(0);
}

static Value sharedOrigin(scf::IfOp branch, unsigned result);

/// The number of the initial value that the condition of a loop passes on,
/// once, as one of its operands; none if that is something else.
static std::optional<unsigned> findPassedOn(scf::WhileOp loop,
                                            unsigned operand) {
  ValueRange passed = loop.getConditionOp().getArgs();
  auto argument = dyn_cast<BlockArgument>(passed[operand]);
  if (!argument || argument.getOwner() != loop.getBeforeBody() ||
      llvm::count(passed, argument) != 1)
    return std::nullopt;
  return argument.getArgNumber();
}

/// The tile whose memory a chain of changes in place began with, through loops
/// and branches that have been placed.
static Value originOf(Value tile, Block *block) {
  while (Operation *def = tile.getDefiningOp()) {
    if (def->getBlock() != block)
      return tile;
    Value before;
    if (auto branch = dyn_cast<scf::IfOp>(def))
      before = sharedOrigin(branch, cast<OpResult>(tile).getResultNumber());
    else if (auto loop = dyn_cast<scf::ForOp>(def))
      before = loop.getInitArgs()[cast<OpResult>(tile).getResultNumber()];
    else if (auto loop = dyn_cast<scf::WhileOp>(def))
      if (auto passed =
              findPassedOn(loop, cast<OpResult>(tile).getResultNumber()))
        before = loop.getInits()[*passed];
      else
        return tile;
    else if (auto operand =
                 def->getAttrOfType<IntegerAttr>(tiles::attr::inPlace))
      before = def->getOperand(operand.getInt());
    if (!before)
      return tile;
    tile = before;
  }
  return tile;
}

/// The tile of the surrounding block whose memory both branches give; null if
/// there is none.
static Value sharedOrigin(scf::IfOp branch, unsigned result) {
  Value shared;
  for (Block *block : {branch.thenBlock(), branch.elseBlock()}) {
    Value origin = originOf(block->getTerminator()->getOperand(result), block);
    if (origin.getParentBlock() != branch->getBlock() ||
        (shared && origin != shared))
      return Value();
    shared = origin;
  }
  return shared;
}

static void copyInits(OpBuilder &b, Operation *loop,
                      MutableOperandRange inits) {
  b.setInsertionPoint(loop);
  for (OpOperand &init : inits)
    if (isTile(init.get()) && (!init.get().hasOneUse() ||
                               init.get().getParentBlock() != loop->getBlock()))
      init.set(copy(b, loop->getLoc(), init.get()));
}

/// Has a loop's body end with each carried tile in the memory of the argument
/// that it is carried by, null for one that is not carried.
static void placeYields(OpBuilder &b, Operation *yield,
                        ArrayRef<Value> arguments) {
  Location loc = yield->getParentOp()->getLoc();
  b.setInsertionPoint(yield);
  SmallVector<std::pair<OpOperand *, Value>> moved;
  bool cross = false;
  for (auto [operand, argument] :
       llvm::zip_equal(yield->getOpOperands(), arguments)) {
    if (!argument || !isTile(argument))
      continue;
    Value origin = originOf(operand.get(), yield->getBlock());
    if (origin == argument && operand.get().hasOneUse())
      continue;
    if (operand.get() == argument)
      continue;
    cross |= isa<BlockArgument>(origin);
    moved.emplace_back(&operand, argument);
  }
  if (cross)
    for (auto &[operand, argument] : moved)
      operand->set(copy(b, loc, operand->get()));
  for (auto &[operand, argument] : moved)
    operand->set(copy(b, loc, operand->get(), argument));
}

static void placeFor(OpBuilder &b, scf::ForOp loop) {
  copyInits(b, loop, loop.getInitArgsMutable());
  SmallVector<Value> arguments(loop.getRegionIterArgs());
  placeYields(b, loop.getBody()->getTerminator(), arguments);
}

/// True if a result can stay in the memory that both branches give: nobody
/// reads the tile that began there afterwards.
static bool staysInPlace(scf::IfOp branch, unsigned result) {
  Value origin = sharedOrigin(branch, result);
  Operation *def = origin ? origin.getDefiningOp() : nullptr;
  if (!origin || (def && isInline(def)))
    return false;
  for (unsigned other = 0; other < branch.getNumResults(); ++other)
    for (Block *block : {branch.thenBlock(), branch.elseBlock()})
      if (Value end = block->getTerminator()->getOperand(other);
          other != result && isTile(end) && originOf(end, block) == origin)
        return false;
  return llvm::all_of(getReaders(origin), [&](Operation *reader) {
    return branch->isAncestor(reader) || isDoneBefore(reader, branch);
  });
}

static void placeIf(OpBuilder &b, scf::IfOp branch) {
  Operation *ends[2] = {branch.thenBlock()->getTerminator(),
                        branch.elseBlock()->getTerminator()};
  for (auto [i, result] : llvm::enumerate(branch.getResults())) {
    if (!isTile(result) || staysInPlace(branch, i))
      continue;
    b.setInsertionPoint(branch);
    Value into = TileEmptyOp::create(b, branch.getLoc(), result.getType());
    for (Operation *end : ends) {
      b.setInsertionPoint(end);
      OpOperand &operand = end->getOpOperand(i);
      operand.set(copy(b, branch.getLoc(), operand.get(), into));
    }
  }
}

static void placeWhile(OpBuilder &b, scf::WhileOp loop) {
  Location loc = loop.getLoc();
  copyInits(b, loop, loop.getInitsMutable());
  Operation *yield = loop.getYieldOp();
  auto condition = loop.getConditionOp();
  // The argument of the body with the memory of each initial value.
  SmallVector<Value> arguments(loop.getInits().size());
  for (unsigned i = 0; i < condition.getArgs().size(); ++i)
    if (auto passed = findPassedOn(loop, i))
      arguments[*passed] = loop.getAfterArguments()[i];
  placeYields(b, yield, arguments);
  for (auto [operand, init, argument] :
       llvm::zip_equal(yield->getOpOperands(), loop.getInits(), arguments))
    if (isTile(init) && !argument) {
      b.setInsertionPoint(yield);
      operand.set(copy(b, loc, operand.get(), init));
    }
  for (OpOperand &operand : condition.getArgsMutable())
    if (isTile(operand.get()) &&
        !findPassedOn(loop, operand.getOperandNumber() - 1)) {
      b.setInsertionPoint(loop);
      Value into = TileEmptyOp::create(b, loc, operand.get().getType());
      b.setInsertionPoint(condition);
      operand.set(copy(b, loc, operand.get(), into));
    }
}

//===----------------------------------------------------------------------===//
// The pass
//===----------------------------------------------------------------------===//

static void placeTiles(FunctionOpInterface kernel, int64_t threads) {
  carryTiles(kernel, threads);
  OpBuilder b(kernel.getContext());
  SmallVector<Operation *> ops, carriers;
  kernel->walk([&](Operation *op) {
    if (op->getName().getDialectNamespace() == "scf")
      carriers.push_back(op);
    else if (computesTiles(op))
      ops.push_back(op);
  });
  TileInlining inlining(kernel, threads);
  for (Operation *op : ops)
    if (inlining.shouldInline(op))
      setLayout(op, getLayout(op).withStorage(TileStorage::inlined));
  for (Operation *op : ops)
    if (!isInline(op))
      for (unsigned operand :
           cast<TileOpInterface>(op).getReplaceableOperands())
        if (canReplace(op, operand)) {
          op->setAttr(tiles::attr::inPlace, b.getI64IntegerAttr(operand));
          break;
        }
  for (Operation *op : carriers) {
    if (auto loop = dyn_cast<scf::ForOp>(op))
      placeFor(b, loop);
    else if (auto loop = dyn_cast<scf::WhileOp>(op))
      placeWhile(b, loop);
    else if (auto branch = dyn_cast<scf::IfOp>(op);
             branch && branch.getNumResults() != 0)
      placeIf(b, branch);
  }
  chooseFunctions(kernel, threads);
  planAccumulators(kernel, threads);
  distributeTiles(kernel, threads);
  replicateElements(kernel, threads);
  hoistLoads(kernel, threads);
  sinkConstants(kernel);
}

namespace {

struct PlaceTiles : warp::impl::PlaceTilesBase<PlaceTiles> {
  void runOnOperation() override {
    auto work = [](FunctionOpInterface kernel, int64_t threads) {
      placeTiles(kernel, threads);
      return success();
    };
    if (failed(forTileKernel(getOperation(), work)))
      signalPassFailure();
  }
};

} // namespace
