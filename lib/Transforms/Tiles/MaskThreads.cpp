//===- MaskThreads.cpp - Predication of inactive threads ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The threads of a block do together what they do with tiles, so those that
// have returned from the kernel, and on a GPU those that the launch does not
// have, go on for that alone: what a thread does by itself gets a condition,
// and what it would give to a tile is zero. Where threads say, each for its own
// elements, where these are loaded from or stored to, it is nowhere.
//
//   if (x[i] > 0) return;         stays = !(x[i] > 0)
//   t = tile(z[i])                if (any of the block stays) {
//   tile_store(y, t)        =>      t = tile(stays ? z[i] : 0)
//                                   tile_store(y, t)
//                                 }
//
// Without a thread that stays the block does nothing more. Uniform
// loads are made by all threads, so that they agree on the value.
//
//===----------------------------------------------------------------------===//

#include "AbsentThreads.h"
#include "BlockVariance.h"
#include "KernelFunction.h"
#include "LoweredOps.h"
#include "WarpDialect/Registry.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_MASKTHREADS
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

static bool hasCollective(Operation *op) {
  auto result = op->walk([](Operation *inner) {
    return isCollective(inner) ? WalkResult::interrupt()
                               : WalkResult::advance();
  });
  return result.wasInterrupted();
}

namespace {

class ThreadMask {
public:
  ThreadMask(FunctionOpInterface kernel, int64_t threads)
      : kernel(kernel), threads(threads), varying(kernel),
        b(kernel.getContext()), loc(kernel.getLoc()),
        index(b.getIntegerType(32, /*isSigned=*/true)) {}

  LogicalResult run();

private:
  bool differs(Value value) const {
    return varying.contains(value) || masked.contains(value);
  }
  Value constant(int64_t value);
  Value builtin(StringRef name, ValueRange operands);
  Value isPresent();
  Value anyOf(Value condition);
  /// A value where a thread is there, and otherwise zero.
  Value orZero(Value condition, Value value) {
    return orElse(b, loc, condition, value,
                  [&] { return makeZero(b, loc, value.getType()); });
  }
  LogicalResult visit(Block::iterator begin, Block::iterator end, Value alive);
  LogicalResult visit(Block &block, Value alive);
  bool needsGuard(Operation *op) const;
  void guard(Operation *op, Value alive);
  LogicalResult mask(Operation *op, Value alive);
  /// True if a branch is one that threads return by; null if it fails.
  FailureOr<bool> leave(scf::IfOp op, Value alive);
  void hoistTiles(Block &block);
  SmallVector<Value> leftBehind(scf::IfOp op, Block *block, Value goes);

  FunctionOpInterface kernel;
  int64_t threads;
  BlockVariance varying;
  OpBuilder b;
  Location loc;
  Type index;
  /// Values that diverge because some threads do not compute them.
  llvm::DenseSet<Value> masked;
};

} // namespace

//===----------------------------------------------------------------------===//
// Conditions
//===----------------------------------------------------------------------===//

Value ThreadMask::constant(int64_t value) {
  return ConstantOp::create(b, loc, b.getIntegerAttr(index, value));
}

Value ThreadMask::builtin(StringRef name, ValueRange operands) {
  return createBuiltin(b, loc, name, operands)->getResult(0);
}

/// A thread that the launch does not have gets the index of the last one: its
/// number within the block is not that of its index.
Value ThreadMask::isPresent() {
  int64_t rank = warp::getVariant(kernel).getRank();
  auto tid = TidOp::create(b, loc, SmallVector<Type>(rank, index));
  Value size = constant(threads), place = constant(0);
  for (int64_t d = 0; d < rank; ++d) {
    Value extent = LaunchExtentOp::create(b, loc, index, d);
    Value rows = builtin("mul", {place, builtin("mod", {extent, size})});
    Value own = builtin("mod", {tid.getResult(d), size});
    place = builtin("mod", {builtin("add", {rows, own}), size});
  }
  Value number = ThreadNumberOp::create(b, loc, b.getI32Type());
  return builtin("eq", {place, CastOp::create(b, loc, index, number)});
}

/// True if a condition holds for a thread of the block.
Value ThreadMask::anyOf(Value condition) {
  Value number = builtin("where", {condition, constant(1), constant(0)});
  auto type = TileType::get(b.getContext(), {threads}, index);
  auto one = TileType::get(b.getContext(), {1}, index);
  Value tile = TileFromThreadsOp::create(b, loc, type, number);
  Value most = TileReduceOp::create(b, loc, one, TileReduction::max, tile,
                                    IntegerAttr());
  Value found = TileGetOp::create(b, loc, index, most, ValueRange(constant(0)));
  return builtin("gt", {found, constant(0)});
}

//===----------------------------------------------------------------------===//
// Operations of single threads
//===----------------------------------------------------------------------===//

/// Effects, but for what all threads read at one place; elements of tiles; and
/// loops that may not end without values that were not computed.
bool ThreadMask::needsGuard(Operation *op) const {
  bool hasEffects = false, writes = false, varies = false;
  op->walk([&](Operation *inner) {
    varies |= llvm::any_of(inner->getOperands(),
                           [&](Value operand) { return differs(operand); });
    if (isa<scf::WhileOp, TileGetOp>(inner))
      hasEffects = true;
    if (isMemoryEffectFree(inner) ||
        inner->hasTrait<OpTrait::HasRecursiveMemoryEffects>())
      return;
    auto effects = dyn_cast<MemoryEffectOpInterface>(inner);
    hasEffects = true;
    writes |= !effects || !effects.onlyHasEffect<MemoryEffects::Read>();
  });
  // A thread's own memory.
  if (isa<ScratchOp>(op))
    return false;
  return writes || (hasEffects && varies);
}

void ThreadMask::guard(Operation *op, Value alive) {
  b.setInsertionPoint(op);
  loc = op->getLoc();
  auto branch = scf::IfOp::create(b, loc, op->getResultTypes(), alive,
                                  /*withElseRegion=*/op->getNumResults() != 0);
  op->replaceAllUsesWith(branch);
  masked.insert(branch.result_begin(), branch.result_end());
  OpBuilder::InsertionGuard guard(b);
  if (op->getNumResults() == 0) {
    op->moveBefore(branch.thenBlock()->getTerminator());
    return;
  }
  op->moveBefore(branch.thenBlock(), branch.thenBlock()->end());
  b.setInsertionPointToEnd(branch.thenBlock());
  scf::YieldOp::create(b, loc, op->getResults());
  b.setInsertionPointToStart(branch.elseBlock());
  SmallVector<Value> zeros;
  for (Type type : op->getResultTypes())
    zeros.push_back(makeZero(b, loc, type));
  scf::YieldOp::create(b, loc, zeros);
}

/// Masks the elements that threads give to tiles.
LogicalResult ThreadMask::mask(Operation *op, Value alive) {
  b.setInsertionPoint(op);
  loc = op->getLoc();
  auto isOwn = [&](Value v) { return differs(v); };
  if (auto from = dyn_cast<TileFromThreadsOp>(op)) {
    from.getValueMutable().assign(orZero(alive, from.getValue()));
  } else if (auto set = dyn_cast<TileSetOp>(op)) {
    Value where = alive;
    if (set.getWhere())
      where = arith::AndIOp::create(b, loc, alive, set.getWhere());
    set.getWhereMutable().assign(where);
  } else if (auto access = dyn_cast<TileAccessOp>(op)) {
    maskAccess(access, alive, isOwn);
  } else if (isa<TileMapOp, TileSplatOp>(op)) {
    for (OpOperand &operand : op->getOpOperands())
      if (Value value = operand.get();
          !isTile(value) && isOwn(value) && isArrayElement(value.getType()))
        operand.set(orZero(alive, value));
  } else if (isa<TileSliceOp, TileInsertOp>(op) &&
             llvm::any_of(op->getOperands(), isOwn)) {
    return op->emitError("the place of a part differs between the threads of a "
                         "block, of which some are not there; let all of them "
                         "say the same, or use blocks that the launch fills");
  }
  return success();
}

LogicalResult ThreadMask::visit(Block &block, Value alive) {
  return visit(block.begin(), std::prev(block.end()), alive);
}

LogicalResult ThreadMask::visit(Block::iterator begin, Block::iterator end,
                                Value alive) {
  while (begin != end) {
    Operation *op = &*begin++;
    auto branch = dyn_cast<scf::IfOp>(op);
    if (branch && op->hasAttr(warp::attr::stays)) {
      FailureOr<bool> left = leave(branch, alive);
      if (failed(left))
        return failure();
      if (*left)
        continue;
    }
    bool isShared = hasCollective(op);
    if (isShared && !isCollective(op)) {
      for (Region &region : op->getRegions())
        if (!region.empty() && failed(visit(region.front(), alive)))
          return failure();
    } else if (!alive) {
      continue;
    } else if (isShared) {
      if (failed(mask(op, alive)))
        return failure();
    } else if (needsGuard(op)) {
      guard(op, alive);
    } else if (llvm::any_of(op->getOperands(), [&](Value operand) {
                 return masked.contains(operand);
               })) {
      masked.insert(op->result_begin(), op->result_end());
    }
  }
  return success();
}

//===----------------------------------------------------------------------===//
// Returns
//===----------------------------------------------------------------------===//

/// Tiles that a side makes of nothing, as those that it yields may be.
void ThreadMask::hoistTiles(Block &block) {
  for (Operation &op : llvm::make_early_inc_range(block.without_terminator())) {
    bool isFree = llvm::all_of(op.getOperands(), [&](Value operand) {
      return operand.getParentBlock() != &block;
    });
    if (isFree && isMemoryEffectFree(&op))
      op.moveBefore(block.getParentOp());
  }
}

/// Guards the code of threads before they leave; gives their last values.
SmallVector<Value> ThreadMask::leftBehind(scf::IfOp op, Block *block,
                                          Value goes) {
  if (!block)
    return {};
  SmallVector<Value> values(block->getTerminator()->getOperands());
  if (llvm::hasSingleElement(*block))
    return values;
  SmallVector<unsigned> made;
  SmallVector<Type> types;
  for (auto [i, value] : llvm::enumerate(values))
    if (value.getParentBlock() == block) {
      made.push_back(i);
      types.push_back(value.getType());
    }
  auto branch = scf::IfOp::create(b, loc, types, goes, !types.empty());
  Block *to = branch.thenBlock();
  to->getOperations().splice(types.empty() ? std::prev(to->end()) : to->end(),
                             block->getOperations(), block->begin(),
                             std::prev(block->end()));
  OpBuilder::InsertionGuard guard(b);
  if (types.empty())
    return values;
  SmallVector<Value> inner, zeros;
  b.setInsertionPointToStart(branch.elseBlock());
  for (unsigned i : made) {
    inner.push_back(values[i]);
    zeros.push_back(makeZero(b, loc, values[i].getType()));
  }
  scf::YieldOp::create(b, loc, zeros);
  b.setInsertionPointToEnd(to);
  scf::YieldOp::create(b, loc, inner);
  for (auto [i, result] : llvm::zip_equal(made, branch.getResults()))
    values[i] = result;
  return values;
}

/// A branch of which one side is what threads do that have not returned.
FailureOr<bool> ThreadMask::leave(scf::IfOp op, Value alive) {
  bool isThen =
      op->getAttrOfType<StringAttr>(warp::attr::stays).getValue() == "then";
  Block *rest = isThen ? op.thenBlock() : op.elseBlock();
  Block *other = isThen ? op.elseBlock() : op.thenBlock();
  if (!differs(op.getCondition()) || !rest ||
      llvm::none_of(*rest, [](Operation &op) { return hasCollective(&op); }))
    return false;
  if (other) {
    hoistTiles(*other);
    if (llvm::any_of(*other, [](Operation &op) { return hasCollective(&op); }))
      return false;
  }
  b.setInsertionPoint(op);
  loc = op.getLoc();
  Value holds = op.getCondition();
  Value fails = arith::XOrIOp::create(
      b, loc, holds, arith::ConstantOp::create(b, loc, b.getBoolAttr(true)));
  Value stays = isThen ? holds : fails, goes = isThen ? fails : holds;
  if (alive) {
    stays = arith::AndIOp::create(b, loc, alive, stays);
    goes = arith::AndIOp::create(b, loc, alive, goes);
  }
  masked.insert(stays);
  SmallVector<Value> left = leftBehind(op, other, goes);
  bool hasResults = op.getNumResults() != 0;
  auto together =
      scf::IfOp::create(b, loc, op.getResultTypes(), anyOf(stays), hasResults);
  Block *to = together.thenBlock();
  if (!hasResults)
    to->getTerminator()->erase();
  to->getOperations().splice(to->end(), rest->getOperations());
  if (hasResults) {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(together.elseBlock());
    scf::YieldOp::create(b, loc, left);
  }
  for (auto [i, result] : llvm::enumerate(op.getResults())) {
    Value value = together.getResult(i);
    if (!isTile(value)) {
      auto choice = scf::IfOp::create(b, loc, TypeRange(value.getType()), stays,
                                      /*withElseRegion=*/true);
      OpBuilder::InsertionGuard guard(b);
      b.setInsertionPointToStart(choice.thenBlock());
      scf::YieldOp::create(b, loc, value);
      b.setInsertionPointToStart(choice.elseBlock());
      scf::YieldOp::create(b, loc, left[i]);
      value = choice.getResult(0);
      masked.insert(value);
    }
    result.replaceAllUsesWith(value);
  }
  op.erase();
  if (failed(visit(*to, stays)))
    return failure();
  return true;
}

//===----------------------------------------------------------------------===//
// The pass
//===----------------------------------------------------------------------===//

LogicalResult ThreadMask::run() {
  Block &body = kernel.getFunctionBody().front();
  Block::iterator begin = body.begin(), end = std::prev(body.end());
  Value alive;
  if (kernel->hasAttr(warp::attr::ragged) && warp::getTarget(kernel).isSimt()) {
    b.setInsertionPoint(&*begin);
    alive = isPresent();
    masked.insert(alive);
  }
  return visit(begin, end, alive);
}

namespace {

struct MaskThreads : warp::impl::MaskThreadsBase<MaskThreads> {
  void runOnOperation() override {
    auto work = [](FunctionOpInterface kernel,
                   int64_t threads) -> LogicalResult {
      if (threads > 1 && kernel->hasAttr(warp::attr::ragged) &&
          failed(refuseLowered(kernel, "mask threads of a block")))
        return failure();
      return threads > 1 ? ThreadMask(kernel, threads).run() : success();
    };
    if (failed(forTileKernel(getOperation(), work)))
      signalPassFailure();
  }
};

} // namespace
