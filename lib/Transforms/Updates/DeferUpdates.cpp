//===- DeferUpdates.cpp - Lanes first, then updates in order --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An entry with an exclusive recipe runs alone and updates elements plainly.
// But threads may meet at one, `f[idx[t]] += v`, so the loop over threads can't
// be vectorised, and all of the arithmetic that leads to `v` is scalar. Here
// the loop becomes two, in stretches of a few hundred threads: the first
// computes values and indices and leaves them in buffers, and LLVM makes lanes
// of its threads; the second performs the updates, thread by thread, in the
// order in which they were.
//
//     for t:                         for t in stretch:
//       v, i = compute(t)      =>      buffer[t], place[t] = compute(t)
//       f[i] += v                    for t in stretch:
//                                      f[place[t]] += buffer[t]
//
// It pays where much is computed for each update. Nothing else in the kernel
// may look at the arrays that are updated, and a body with loops, or branches
// that access memory, is left as it is, because LLVM would not vectorise it.
//
// Runs between warp-privatize-atomics, which finds out that the entry runs
// alone, and warp-lower-arrays.
//
//===----------------------------------------------------------------------===//

#include "Emit/AccessOrder.h"
#include "Atomics.h"
#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

namespace warp {
#define GEN_PASS_DEF_DEFERUPDATES
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// Buffers stay in the first level of cache.
constexpr int64_t bufferBytes = 16 * 1024;
constexpr int64_t longestStretch = 512;
/// Scalar operations for each number that goes through memory.
constexpr int64_t leastWork = 4;

namespace {

/// Moves the updates of one loop over threads out of it.
class Deferral {
public:
  Deferral(LLVM::LLVMFuncOp entry, LLVM::CondBrOp latch)
      : latch(latch), loop(latch->getBlock()),
        first(&entry.getBody().front()), b(entry.getContext()) {}

  bool isWorthwhile();
  void run();

private:
  bool isBefore(Value value);
  Value defer(Value value, OpBuilder &inUpdates);
  void buildUpdates(OpBuilder &inUpdates);

  LLVM::CondBrOp latch;
  Block *loop, *first;
  OpBuilder b;
  SmallVector<warp::AtomicComponentsOp> updates;
  int64_t length = 0;
  /// Numbers of the thread in its stretch, in each of the loops.
  Value slot, slotOfUpdates;
  /// What is known in the second loop of values of the first.
  IRMapping deferred;
};

} // namespace

/// Whether a value is there before the loop begins.
bool Deferral::isBefore(Value value) {
  return value.getParentBlock() != loop;
}

bool Deferral::isWorthwhile() {
  int64_t work = 0, numbers = 0, bytes = 0;
  for (Operation &op : loop->without_terminator()) {
    // Branches of pure operations become selects.
    if (op.getNumRegions() != 0 &&
        (!isa<scf::IfOp>(op) || !isMemoryEffectFree(&op)))
      return false;
    auto update = dyn_cast<warp::AtomicComponentsOp>(op);
    if (!update) {
      work += isMemoryEffectFree(&op) && op.getNumResults() == 1 &&
              isa<FloatType>(op.getResult(0).getType());
      continue;
    }
    if (!warp::commutes(update))
      return false;
    updates.push_back(update);
    SmallVector<Value> values(update.getComponents());
    llvm::append_range(values, update.getIndices());
    for (Value value : values)
      if (!isBefore(value))
        bytes += warp::getByteSize(value.getType()), ++numbers;
  }
  if (numbers == 0 || work < leastWork * numbers)
    return false;
  length = std::min(longestStretch,
                    int64_t(llvm::bit_floor(uint64_t(bufferBytes / bytes))));
  return true;
}

/// The value of a thread as its update finds it: in a buffer, unless it is
/// cheap to have again.
Value Deferral::defer(Value value, OpBuilder &inUpdates) {
  if (isBefore(value))
    return value;
  if (Value known = deferred.lookupOrNull(value))
    return known;
  Operation *op = value.getDefiningOp();
  if (isa_and_nonnull<warp::GradOp>(op)) {
    // Of an argument, as `commutes` has made sure.
    inUpdates.clone(*op, deferred);
    return deferred.lookup(value);
  }
  Location loc = value.getLoc();
  OpBuilder atStart = OpBuilder::atBlockTerminator(first);
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  Type type = value.getType();
  Value count = LLVM::ConstantOp::create(atStart, loc,
                                         atStart.getI64IntegerAttr(length));
  Value buffer = LLVM::AllocaOp::create(atStart, loc, pointer, type, count,
                                        /*alignment=*/64);
  auto at = [&](OpBuilder &builder, Value number) -> Value {
    return LLVM::GEPOp::create(builder, loc, pointer, type, buffer,
                               ValueRange(number));
  };
  b.setInsertionPoint(latch);
  auto store = LLVM::StoreOp::create(b, loc, value, at(b, slot));
  if (auto annotation = latch.getLoopAnnotationAttr()) {
    SmallVector<Attribute> groups(annotation.getParallelAccesses());
    store.setAccessGroupsAttr(b.getArrayAttr(groups));
  }
  Value known = LLVM::LoadOp::create(inUpdates, loc, type,
                                     at(inUpdates, slotOfUpdates));
  deferred.map(value, known);
  return known;
}

/// The body of the second loop.
void Deferral::buildUpdates(OpBuilder &inUpdates) {
  for (warp::AtomicComponentsOp update : updates) {
    SmallVector<Value> components, indices;
    for (Value component : update.getComponents())
      components.push_back(defer(component, inUpdates));
    for (Value index : update.getIndices())
      indices.push_back(defer(index, inUpdates));
    Value array = defer(update.getArray(), inUpdates);
    warp::AtomicComponentsOp::create(
        inUpdates, update.getLoc(), update.getResultTypes(), update.getKind(),
        components, array, indices);
  }
  for (warp::AtomicComponentsOp update : updates)
    update.erase();
}

void Deferral::run() {
  Location loc = latch.getLoc();
  Type i64 = b.getI64Type();
  Block *after = latch.getFalseDest();
  Block *before = *llvm::find_if(
      loop->getPredecessors(), [&](Block *block) { return block != loop; });
  auto enter = cast<LLVM::BrOp>(before->getTerminator());
  auto test = latch.getCondition().getDefiningOp<arith::CmpIOp>();
  Value next = test.getLhs(), end = test.getRhs();

  // A stretch begins and ends.
  Block *stretch = b.createBlock(loop, {i64}, {loc});
  Value begin = stretch->getArgument(0);
  Value size = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(length));
  Value reach = arith::AddIOp::create(b, loc, begin, size);
  Value limit = arith::MinSIOp::create(b, loc, reach, end);
  LLVM::BrOp::create(b, loc, ValueRange(begin), loop);
  enter.setSuccessor(stretch);

  // Its second loop.
  Block *second = b.createBlock(after, {i64}, {loc});
  Block *done = b.createBlock(after);
  b.setInsertionPointToStart(second);
  Value index = second->getArgument(0);
  slotOfUpdates = arith::SubIOp::create(b, loc, index, begin);
  Value one = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
  Value following = arith::AddIOp::create(b, loc, index, one);
  Value more = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt,
                                     following, limit);
  auto repeat = LLVM::CondBrOp::create(b, loc, more, second,
                                       ValueRange(following), done,
                                       ValueRange());
  b.setInsertionPointToEnd(done);
  Value another = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt,
                                        limit, end);
  LLVM::CondBrOp::create(b, loc, another, stretch, ValueRange(limit), after,
                         ValueRange());

  // Its first loop.
  b.setInsertionPoint(latch);
  slot = arith::SubIOp::create(b, loc, loop->getArgument(0), begin);
  OpBuilder inUpdates(following.getDefiningOp());
  buildUpdates(inUpdates);
  b.setInsertionPoint(latch);
  latch.getConditionMutable().assign(arith::CmpIOp::create(
      b, loc, arith::CmpIPredicate::slt, next, limit));
  latch.setSuccessor(second, 1);
  latch.getFalseDestOperandsMutable().assign(ValueRange(begin));
  // Updates meet; to look for a way to vectorise them takes time.
  auto vectorize = LLVM::LoopVectorizeAttr::get(
      b.getContext(), b.getBoolAttr(true), {}, {}, {}, {}, {}, {});
  repeat.setLoopAnnotationAttr(LLVM::LoopAnnotationAttr::get(
      b.getContext(), {}, vectorize, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {},
      {}, {}));
}

namespace {

struct DeferUpdates : warp::impl::DeferUpdatesBase<DeferUpdates> {
  void runOnOperation() override {
    FunctionOpInterface found = warp::findEntry(getOperation());
    if (!found)
      return signalPassFailure();
    auto entry = dyn_cast<LLVM::LLVMFuncOp>(found.getOperation());
    if (!entry || warp::isGpu(entry) || warp::getVariant(entry).getDebug() ||
        !warp::getRecipe(entry).getExclusive() ||
        warp::updatesNeighbours(entry))
      return;
    for (auto latch :
         llvm::to_vector(entry.getBody().getOps<LLVM::CondBrOp>()))
      if (latch.getLoopAnnotationAttr()) {
        Deferral deferral(entry, latch);
        if (deferral.isWorthwhile())
          deferral.run();
      }
  }
};

} // namespace
