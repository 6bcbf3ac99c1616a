//===- FormLaneLoops.cpp - Loop fission over a block's threads ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// On a CPU the first thread of each block does what its threads do. Operations
// on tiles stay, as does control flow around them, which threads share. Code
// between becomes loops over the threads, as long as possible; values that
// are used in another loop, or by an operation on tiles, are kept in tiles.
// Uniform values are computed once.
//
//   x = a[tid]                   for t in threads: x[t] = a[first + t]
//   s = tile_sum(tile(x))   =>   s = tile_sum(x)
//   b[tid] = x - s[0]            for t in threads: b[first + t] = x[t] - s[0]
//
// A loop of bounds that threads share which reads elements of tiles is outside
// of the loop over threads, so that this one can be vectorised.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "LaneLoops.h"
#include "LoweredOps.h"
#include "WarpDialect/Registry.h"

#include "llvm/ADT/SetVector.h"

namespace warp {
#define GEN_PASS_DEF_FORMLANELOOPS
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

namespace {

class BlockLoops : LaneLoops {
public:
  using LaneLoops::LaneLoops;
  LogicalResult run();

private:
  LogicalResult emitBlock(Block &block);
  void emitRun();
  void addOutput(Value value, llvm::SetVector<Value> &outputs) const;
  llvm::SetVector<Value> findOutputs() const;
  LogicalResult emitCollective(Operation *op);
  void emitSet(TileSetOp op);
  LogicalResult emitShared(Operation *op);
  void emitTid(TidOp op);
  Value carry(Value value, Value as);
  void bind(Value old, Value made);
  LogicalResult emitRegion(Region &from, Region &to, ValueRange as);

  /// Operations that threads do by themselves, not yet written.
  SmallVector<Operation *> pending;
};

} // namespace

//===----------------------------------------------------------------------===//
// Threads by themselves
//===----------------------------------------------------------------------===//

/// Values that no tile can keep are rematerialized.
void BlockLoops::addOutput(Value value, llvm::SetVector<Value> &outputs) const {
  Operation *def = value.getDefiningOp();
  if (!def || !llvm::is_contained(pending, def) || outputs.contains(value))
    return;
  if (isStorable(value)) {
    outputs.insert(value);
    return;
  }
  for (Value operand : def->getOperands())
    addOutput(operand, outputs);
}

llvm::SetVector<Value> BlockLoops::findOutputs() const {
  llvm::SetVector<Value> outputs;
  for (Operation *op : pending)
    for (Value result : op->getResults())
      for (Operation *user : result.getUsers()) {
        Operation *inBlock = op->getBlock()->findAncestorOpInBlock(*user);
        if (!llvm::is_contained(pending, inBlock))
          addOutput(result, outputs);
      }
  return outputs;
}

void BlockLoops::emitRun() {
  if (pending.empty())
    return;
  loc = pending.front()->getLoc();
  llvm::SetVector<Value> outputs = findOutputs();
  Values empty;
  for (Value value : outputs)
    empty.push_back(TileEmptyOp::create(b, loc, laneType(value.getType())));
  Values kept = overLanes(threads, empty, [&](Lane &lane, ValueRange tiles) {
    for (Operation *op : pending) {
      op->walk([&](Operation *inner) {
        for (Value operand : inner->getOperands())
          if (operand.getParentBlock() == op->getBlock() ||
              !op->isAncestor(operand.getParentBlock()->getParentOp()))
            laneValue(operand, lane);
      });
      b.clone(*op, lane.values);
    }
    Values next;
    for (auto [value, tile] : llvm::zip_equal(outputs, tiles))
      next.push_back(write(lane.values.lookup(value), tile, lane.number));
    return next;
  });
  for (auto [value, tile] : llvm::zip_equal(outputs, kept))
    lanes[value] = tile;
  pending.clear();
}

void BlockLoops::emitTid(TidOp op) {
  b.clone(*op, shared);
  size_t last = warp::getVariant(kernel).getRank() - 1;
  for (auto [axis, index] : llvm::enumerate(op.getResults())) {
    if (axis != last && !isRagged())
      continue;
    firstIndices[index] = {shared.lookup(index), int64_t(axis)};
    shared.erase(index);
  }
}

//===----------------------------------------------------------------------===//
// Threads together
//===----------------------------------------------------------------------===//

void BlockLoops::emitSet(TileSetOp op) {
  Value tile = sharedValue(op.getTile());
  Value made = overLanes(threads, tile, [&](Lane &lane, ValueRange tiles) {
    auto ofLane = [&](ValueRange values) {
      return llvm::map_to_vector(values,
                                 [&](Value v) { return laneValue(v, lane); });
    };
    Values indices = ofLane(op.getIndices());
    Values components = ofLane(op.getComponents());
    Value value = laneValue(op.getValue(), lane);
    Value where = op.getWhere() ? laneValue(op.getWhere(), lane) : Value();
    return Values{TileSetOp::create(b, loc, tile.getType(), op.getKind(), value,
                                    tiles[0], indices, components, where,
                                    op.getPathAttr())};
  })[0];
  shared.map(op.getResult(), made);
}

LogicalResult BlockLoops::emitCollective(Operation *op) {
  loc = op->getLoc();
  if (auto from = dyn_cast<TileFromThreadsOp>(op)) {
    TileType type = tileType(from.getResult());
    Value value = from.getValue();
    shared.map(from.getResult(), !present && type == laneType(value.getType())
                                     ? laneTile(value)
                                     : fill(type, threads, value));
    return success();
  }
  if (auto to = dyn_cast<TileToThreadsOp>(op)) {
    if (tileType(to.getTile()).getShape().back() != threads)
      return op->emitOpError("expects an element for each of ")
             << threads << " threads";
    lanes[to.getResult()] = sharedValue(to.getTile());
    return success();
  }
  auto differs = [&](Value value) { return isLane(value); };
  auto access = dyn_cast<TileAccessOp>(op);
  if (access)
    pickThere(access);
  if (auto set = dyn_cast<TileSetOp>(op);
      set && (set.getKind() != TileUpdate::assign ||
              llvm::any_of(set->getOperands(), differs))) {
    emitSet(set);
    return success();
  }
  ArrayRef<int64_t> shape;
  if (isa<TileMapOp, TileSplatOp>(op))
    shape = tileType(op->getResult(0)).getShape();
  if (auto splat = dyn_cast<TileSplatOp>(op);
      splat && differs(splat.getValue())) {
    shared.map(splat.getResult(), spread(splat.getValue(), shape));
    return success();
  }
  if (access && llvm::any_of(op->getOperands(), differs) && emitAccess(access))
    return success();
  Values operands;
  for (Value operand : op->getOperands()) {
    if (!shape.empty() && differs(operand))
      operands.push_back(spread(operand, shape));
    else if (varying.contains(operand))
      return op->emitError(
          "an operand differs between the threads of a block, which blocks of "
          "a CPU (enable_cpu_blocks) allow for values of elements, and for "
          "where tiles are loaded from and stored to");
    else
      operands.push_back(sharedValue(operand));
  }
  return emitWithCaptures(op, operands, shape);
}

//===----------------------------------------------------------------------===//
// Control flow
//===----------------------------------------------------------------------===//

/// A value as control flow carries it: as a tile where threads differ.
Value BlockLoops::carry(Value value, Value as) {
  return varying.contains(as) ? laneTile(value) : sharedValue(value);
}

void BlockLoops::bind(Value old, Value made) {
  if (varying.contains(old))
    lanes[old] = made;
  else
    shared.map(old, made);
}

/// Writes a region that yields what `as` says.
LogicalResult BlockLoops::emitRegion(Region &from, Region &to, ValueRange as) {
  Block &old = from.front();
  OpBuilder::InsertionGuard guard(b);
  SmallVector<Type> types;
  SmallVector<Location> places;
  for (Value argument : old.getArguments()) {
    types.push_back(varying.contains(argument)
                        ? Type(laneType(argument.getType()))
                        : argument.getType());
    places.push_back(argument.getLoc());
  }
  Block *made = b.createBlock(&to, to.end(), types, places);
  for (auto [argument, mine] :
       llvm::zip_equal(old.getArguments(), made->getArguments()))
    bind(argument, mine);
  if (failed(emitBlock(old)))
    return failure();
  Operation *end = old.getTerminator();
  loc = end->getLoc();
  Values operands;
  // The condition of a loop comes before what it carries.
  unsigned first = end->getNumOperands() - as.size();
  for (auto [i, operand] : llvm::enumerate(end->getOperands()))
    operands.push_back(i < first ? sharedValue(operand)
                                 : carry(operand, as[i - first]));
  OperationState state(loc, end->getName(), operands, TypeRange(),
                       end->getAttrs());
  b.create(state);
  return success();
}

LogicalResult BlockLoops::emitShared(Operation *op) {
  loc = op->getLoc();
  auto isCarried = [&](Value value) {
    return !varying.contains(value) || isStorable(value);
  };
  SmallVector<ValueRange> yields;
  Values operands;
  if (auto loop = dyn_cast<scf::ForOp>(op)) {
    operands = {sharedValue(loop.getLowerBound()),
                sharedValue(loop.getUpperBound()), sharedValue(loop.getStep())};
    for (auto [init, argument] :
         llvm::zip_equal(loop.getInitArgs(), loop.getRegionIterArgs()))
      operands.push_back(carry(init, argument));
    yields = {loop.getRegionIterArgs()};
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    for (auto [init, argument] :
         llvm::zip_equal(loop.getInits(), loop.getBeforeArguments()))
      operands.push_back(carry(init, argument));
    yields = {loop.getAfterArguments(), loop.getBeforeArguments()};
  } else if (auto branch = dyn_cast<scf::IfOp>(op)) {
    operands = {sharedValue(branch.getCondition())};
    yields = {branch.getResults(), branch.getResults()};
  } else {
    return op->emitError(
        "tile operations are only supported directly in 'if', 'for' and "
        "'while' when 'enable_cpu_blocks' is set");
  }
  for (ValueRange values : yields)
    if (!llvm::all_of(values, isCarried))
      return op->emitError(
          "carries a value that differs between the threads of "
          "a block and is no number, vector, matrix or struct");
  SmallVector<Type> types;
  for (Value result : op->getResults())
    types.push_back(varying.contains(result) ? Type(laneType(result.getType()))
                                             : result.getType());
  OperationState state(loc, op->getName(), operands, types, op->getAttrs());
  for (unsigned i = 0; i < op->getNumRegions(); ++i)
    state.addRegion();
  Operation *made = b.create(state);
  for (auto [i, region] : llvm::enumerate(op->getRegions()))
    if (!region.empty() &&
        failed(emitRegion(region, made->getRegion(i), yields[i])))
      return failure();
  for (auto [old, result] :
       llvm::zip_equal(op->getResults(), made->getResults()))
    bind(old, result);
  return success();
}

/// All of a block but its terminator.
LogicalResult BlockLoops::emitBlock(Block &block) {
  for (Operation &op : block.without_terminator()) {
    if (auto tid = dyn_cast<TidOp>(op)) {
      emitTid(tid);
    } else if (isa<BarrierOp>(op)) {
      // The run before it ends with its loop.
      emitRun();
    } else if (isCollective(&op) || isShared(&op)) {
      emitRun();
      if (failed(isCollective(&op) ? emitCollective(&op) : emitShared(&op)))
        return failure();
    } else if (isLaneOp(&op)) {
      pending.push_back(&op);
    } else {
      // Before what threads do, if that cannot change it.
      if (!isMemoryEffectFree(&op))
        emitRun();
      Operation *made = b.clone(op, shared);
      for (auto [i, operand] : llvm::enumerate(op.getOperands()))
        made->setOperand(i, sharedValue(operand));
    }
  }
  emitRun();
  return success();
}

LogicalResult BlockLoops::run() {
  Block &body = kernel.getFunctionBody().front();
  Block *old = b.createBlock(&kernel.getFunctionBody());
  old->getOperations().splice(old->end(), body.getOperations(), body.begin(),
                              std::prev(body.end()));
  for (Value argument : kernel.getArguments())
    shared.map(argument, argument);
  b.setInsertionPoint(body.getTerminator());
  int64_t rank = warp::getVariant(kernel).getRank();
  auto tid = TidOp::create(b, loc, SmallVector<Type>(rank, index));
  Value own = tid.getResult(rank - 1);
  if (isRagged())
    own = firstThread = linearIndex(tid.getResults());
  Value size = constantOf(own.getType(), threads);
  Value place = builtin("mod", {own, size});
  auto first = scf::IfOp::create(
      b, loc, builtin("eq", {place, constantOf(own.getType(), 0)}),
      /*withElseRegion=*/false);
  b.setInsertionPoint(first.thenBlock()->getTerminator());
  if (rank == 1 || isRagged()) {
    Value total =
        isRagged() ? countThreads() : LaunchExtentOp::create(b, loc, index, 0);
    Value left = builtin("min", {builtin("sub", {total, own}), size});
    present = isRagged() ? CastOp::create(b, loc, index, left) : left;
  }
  // Without a terminator of its own, as emitBlock expects one.
  OpBuilder::atBlockEnd(old).clone(*body.getTerminator());
  LogicalResult result = emitBlock(*old);
  old->dropAllReferences();
  old->dropAllDefinedValueUses();
  old->erase();
  kernel->setAttr(warp::attr::blockThreads, b.getI64IntegerAttr(1));
  return result;
}

static LogicalResult formLoops(FunctionOpInterface kernel, int64_t threads) {
  if (threads == 1 || warp::getTarget(kernel).isSimt())
    return success();
  if (failed(refuseLowered(kernel, "make loops over the threads of a block")))
    return failure();
  return BlockLoops(kernel, threads).run();
}

namespace {

struct FormLaneLoops : warp::impl::FormLaneLoopsBase<FormLaneLoops> {
  void runOnOperation() override {
    if (failed(forTileKernel(getOperation(), formLoops)))
      signalPassFailure();
  }
};

} // namespace
