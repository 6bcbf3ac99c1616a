//===- BlockRows.cpp - Privatised sums of a block -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loop over a list that all threads share adds to gradients of the list:
// element j in iteration j, by one lane for its warp. All warps of the launch
// make these updates at the same few addresses, one after the other. So each
// warp of a block adds to a row of its own in shared memory, which has the
// first elements of the array; at the end the block adds its rows, and makes
// one update for each element that is not zero:
//
//   rows = 0; barrier
//   for j: if j < width: rows[warp][j] += sum     (the lane that updates)
//          else:         atomic_add(w, j, sum)
//   barrier
//   for j = thread to width step blockDim:
//     s = rows[0][j] + rows[1][j] + ...
//     if s != 0: atomic_add(w, j, s)
//
// A row belongs to a warp, of which one lane adds to an element, so rows need
// no atomic instructions; a ring reduction (RingReduction.cpp) has another lane
// do so in another tile, and waits for the warp in between. The entry has to
// come to its end with all threads: its branches are structured by then.
//
//===----------------------------------------------------------------------===//

#include "BlockRows.h"

#include "Analysis/CostModel.h"
#include "Atomics.h"
#include "Choices.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/LoopLikeInterface.h"
#include "llvm/ADT/MapVector.h"

using namespace mlir;
using warp::AtomicComponentsOp;
using warp::WarpUpdate;

/// Bytes of a row, and of all rows of an entry: with these a multiprocessor has
/// as many blocks as without.
static constexpr int64_t rowBytes = 1 << 10, mostBytes = 16 << 10;
/// Iterations below which a loop makes too few updates, and elements of a row.
static constexpr int64_t leastTrips = 8, leastElements = 8;

//===----------------------------------------------------------------------===//
// Updates
//===----------------------------------------------------------------------===//

/// True if a value is computed without memory; `counts` becomes true if it
/// depends on a loop.
static bool isComputed(Value value, bool &counts, int depth) {
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    counts |= isa_and_present<LoopLikeOpInterface>(
        argument.getOwner()->getParentOp());
    return true;
  }
  Operation *op = value.getDefiningOp();
  if (warp::getGridRead(value))
    return true;
  if (isa<LoopLikeOpInterface>(op)) {
    counts = true;
    return true;
  }
  return depth > 0 && op->getNumRegions() == 0 && isMemoryEffectFree(op) &&
         !warp::isShuffle(op) &&
         llvm::all_of(op->getOperands(), [&](Value operand) {
           return isComputed(operand, counts, depth - 1);
         });
}

bool warp::isCounted(AtomicComponentsOp op) {
  AtomicKind kind = op.getKind();
  if (op.getIndices().size() != 1 || combiningKind(kind) != AtomicKind::add)
    return false;
  bool isLong = false;
  for (Operation *at = op->getParentOp(); at; at = at->getParentOp())
    if (auto loop = dyn_cast<LoopLikeOpInterface>(at)) {
      std::optional<APInt> trips = loop.getStaticTripCount();
      isLong |= !trips || trips->uge(leastTrips);
    }
  bool counts = false;
  return isLong && isComputed(op.getIndices()[0], counts, /*depth=*/12) &&
         counts;
}

//===----------------------------------------------------------------------===//
// Rows
//===----------------------------------------------------------------------===//

namespace {

/// The rows of one array.
class Rows {
public:
  Rows(LLVM::LLVMFuncOp entry, ArrayRef<WarpUpdate> updates, int64_t blockDim)
      : entry(entry), module(entry->getParentOfType<ModuleOp>()),
        updates(updates), first(updates.front()),
        leaf(warp::leavesOf(first.op).front()),
        type(first.op->getResult(0).getType()), b(entry.getContext()),
        loc(entry.getLoc()) {
    warps = blockDim / warp::getTarget(entry).getSubgroupSize();
    elements = rowBytes / (type.getIntOrFloatBitWidth() / 8) / first.components;
    slots = elements * first.components;
    changesLanes = llvm::any_of(
        updates, [](const WarpUpdate &one) { return one.changesLanes; });
  }

  bool isWorthIt() const { return warps > 1 && elements >= leastElements; }
  int64_t bytes() const {
    return warps * slots * (type.getIntOrFloatBitWidth() / 8);
  }
  /// Sets them to zero, at the start of the entry.
  void clear(OpBuilder &at);
  /// Has updates add to them.
  void collect();
  /// Adds them to the array, at the end of the entry.
  void publish(OpBuilder &at);

private:
  Value constant(OpBuilder &at, int64_t value) {
    return arith::ConstantOp::create(at, loc, at.getI32IntegerAttr(value));
  }
  Value zero(OpBuilder &at) {
    return warp::identity(at, loc, warp::AtomicKind::add, leaf.type);
  }
  Value slot(OpBuilder &at, Value number) {
    return LLVM::GEPOp::create(at, loc, memory.getType(), type, memory,
                               ArrayRef<LLVM::GEPArg>(number));
  }
  void forSlots(OpBuilder &at, int64_t count, function_ref<void(Value)> body);
  void add(const WarpUpdate &update);
  Value total(OpBuilder &at, Value number);

  LLVM::LLVMFuncOp entry;
  ModuleOp module;
  ArrayRef<WarpUpdate> updates;
  WarpUpdate first;
  int64_t warps = 0, elements = 0, slots = 0;
  warp::Leaf leaf;
  Type type;
  OpBuilder b;
  Location loc;
  Value memory, row;
  bool changesLanes = false;
};

} // namespace

/// A loop of the threads of the block over so many slots.
void Rows::forSlots(OpBuilder &at, int64_t count,
                    function_ref<void(Value)> body) {
  // A launch may have blocks of half the threads.
  Value threads;
  for (warp::Axis axis : {warp::Axis::x, warp::Axis::y, warp::Axis::z}) {
    Value extent = warp::readGrid(at, loc, warp::GridValue::blockDim, axis);
    threads =
        threads ? arith::MulIOp::create(at, loc, threads, extent) : extent;
  }
  auto loop = scf::ForOp::create(at, loc, warp::threadInBlock(at, loc),
                                 constant(at, count), threads);
  OpBuilder::InsertionGuard guard(at);
  at.setInsertionPointToStart(loop.getBody());
  body(loop.getInductionVar());
}

void Rows::clear(OpBuilder &at) {
  memory = warp::makeShared(at, loc, module,
                            LLVM::LLVMArrayType::get(type, warps * slots),
                            "block_rows");
  Value number = warp::subgroupOf(at, loc, warp::threadInBlock(at, loc));
  row = arith::MulIOp::create(at, loc, number, constant(at, slots));
  Value none = zero(at);
  forSlots(at, warps * slots, [&](Value number) {
    LLVM::StoreOp::create(at, loc, none, slot(at, number));
  });
}

void Rows::add(const WarpUpdate &update) {
  AtomicComponentsOp op = update.op;
  OpBuilder at(op);
  // The branch of the lane that makes the update.
  if (changesLanes) {
    if (auto own = dyn_cast<scf::IfOp>(op->getParentOp()))
      at.setInsertionPoint(own);
    warp::synchronizeWarp(at, loc);
    at.setInsertionPoint(op);
  }
  Value index = op.getIndices()[0];
  Value limit = arith::ConstantOp::create(
      at, loc, at.getIntegerAttr(index.getType(), elements));
  // An index below zero counts from the end.
  Value isInRow =
      arith::CmpIOp::create(at, loc, arith::CmpIPredicate::ult, index, limit);
  auto branch = scf::IfOp::create(at, loc, isInRow, /*withElseRegion=*/true);
  op->moveBefore(branch.elseBlock()->getTerminator());
  at.setInsertionPointToStart(branch.thenBlock());
  if (!index.getType().isInteger(32))
    index = arith::TruncIOp::create(at, loc, at.getI32Type(), index);
  Value start = arith::AddIOp::create(
      at, loc, row,
      arith::MulIOp::create(at, loc, index, constant(at, update.components)));
  for (auto [number, value] : llvm::enumerate(op.getComponents())) {
    Value component =
        update.component ? update.component : constant(at, number);
    Value place = slot(at, arith::AddIOp::create(at, loc, start, component));
    Value old = LLVM::LoadOp::create(at, loc, type, place);
    Value sum = warp::combine(at, loc, op.getKind(), old, value, leaf.type,
                              /*anyOrder=*/true);
    LLVM::StoreOp::create(at, loc, sum, place);
  }
}

void Rows::collect() {
  for (const WarpUpdate &update : updates)
    add(update);
}

/// The sum of a slot over all rows.
Value Rows::total(OpBuilder &at, Value number) {
  Value sum;
  for (int64_t i = 0; i < warps; ++i) {
    Value place =
        arith::AddIOp::create(at, loc, number, constant(at, i * slots));
    Value part = LLVM::LoadOp::create(at, loc, type, slot(at, place));
    sum = sum ? warp::combine(at, loc, warp::AtomicKind::add, sum, part,
                              leaf.type, /*anyOrder=*/true)
              : part;
  }
  return sum;
}

void Rows::publish(OpBuilder &at) {
  Block *begin = &entry.getBody().front();
  IRMapping clones;
  Value array = warp::cloneInvariant(at, first.array, begin, clones);
  forSlots(at, slots, [&](Value number) {
    Value sum = total(at, number);
    Value isThere;
    if (isa<FloatType>(type))
      isThere = arith::CmpFOp::create(at, loc, arith::CmpFPredicate::UNE, sum,
                                      zero(at));
    else
      isThere = arith::CmpIOp::create(at, loc, arith::CmpIPredicate::ne, sum,
                                      zero(at));
    auto branch = scf::IfOp::create(at, loc, isThere, /*withElseRegion=*/false);
    at.setInsertionPointToStart(branch.thenBlock());
    Value index = number, target = array;
    if (first.components > 1) {
      Value count = constant(at, first.components);
      index = arith::DivUIOp::create(at, loc, number, count);
      target = warp::viewComponent(
          at, loc, array, arith::RemUIOp::create(at, loc, number, count));
    }
    Type counter = first.op.getIndices()[0].getType();
    if (counter != index.getType())
      index = arith::ExtUIOp::create(at, loc, counter, index);
    AtomicComponentsOp::create(at, loc, type, warp::AtomicKind::add, sum,
                               target, index);
  });
}

/// The return of an entry whose blocks all threads go through; null if there
/// are branches.
static LLVM::ReturnOp findEnd(LLVM::LLVMFuncOp entry) {
  LLVM::ReturnOp end;
  for (Block &block : entry.getBody()) {
    Operation *last = block.getTerminator();
    if (auto found = dyn_cast<LLVM::ReturnOp>(last); found && !end)
      end = found;
    else if (!isa<LLVM::BrOp>(last))
      return {};
  }
  return end;
}

void warp::addInBlockRows(FunctionOpInterface function,
                          ArrayRef<WarpUpdate> updates) {
  auto entry = dyn_cast<LLVM::LLVMFuncOp>(*function);
  VariantAttr variant = getVariant(function);
  if (!entry || updates.empty() || variant.getDebug() ||
      variant.isDeterministic() || variant.getLanes() == 1 ||
      function->hasAttr(attr::blockThreads))
    return;
  LLVM::ReturnOp end = findEnd(entry);
  if (!end)
    return;
  Block *begin = &entry.getBody().front();
  llvm::MapVector<Value, SmallVector<WarpUpdate>> byArray;
  for (const WarpUpdate &update : updates)
    if (isInvariant(update.array, begin))
      byArray[update.array].push_back(update);
  int64_t left = std::min<int64_t>(
      mostBytes,
      staticBlockBytes - sharedBytes(entry->getParentOfType<ModuleOp>()));
  SmallVector<Rows> rows;
  for (auto &[array, some] : byArray) {
    Rows one(entry, some, variant.getBlockDim());
    if (!one.isWorthIt() || one.bytes() > left)
      continue;
    left -= one.bytes();
    rows.push_back(one);
  }
  if (rows.empty())
    return;
  OpBuilder b = OpBuilder::atBlockBegin(begin);
  for (Rows &one : rows)
    one.clear(b);
  synchronizeBlock(b, entry.getLoc());
  for (Rows &one : rows)
    one.collect();
  b.setInsertionPoint(end);
  synchronizeBlock(b, entry.getLoc());
  for (Rows &one : rows)
    one.publish(b);
  noteChoice(function, "sums of a block", "in shared memory",
             "all threads update the same few elements");
}
