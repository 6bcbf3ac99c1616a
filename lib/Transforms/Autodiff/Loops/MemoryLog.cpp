//===- MemoryLog.cpp - Log of loaded values -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `for i in range(n): x[c[i]] = f(x[p[i]])` reads what earlier iterations wrote
// and overwrites it. The values that it read cannot be recovered from the
// remaining left. So before the adjoint, the kernel runs again, on copies of
// what it writes, made before the launch, and keeps what the loads have read:
//
//   kernel     position = 0
//              loop:  v = load;  position += 1           (dead code there)
//   sizing     loop:  position += 1
//              trips[thread] = position
//   recording  loop:  v = load;  log[offset + position] = v;  position += 1
//   adjoint    loop:  v = log[offset + position]
//
// The position is a value that the loop carries: reversed loops know how to
// have it again. The runtime makes offsets of trips. RecordLoads.cpp makes the
// recording, and what is left of it to count.
//
// All of this is right if no thread touches what another one writes. Where
// indices do not tell, the recording finds out. It also does if there is no
// copy from before the launch: what the launch has left is as good if elements
// are written before they are read.
//
//===----------------------------------------------------------------------===//

#include "MemoryLog.h"

#include "CarryValue.h"
#include "RecordLoads.h"

#include "Analysis/Effects.h"
#include "Autodiff/Recording.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

static constexpr int64_t rowBits = 16;

SmallVector<Value> getTapeIndices(OpBuilder &b, Location loc, Value at) {
  auto constant = [&](int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(value));
  };
  Value row = arith::ShRUIOp::create(b, loc, at, constant(rowBits));
  Value column =
      arith::AndIOp::create(b, loc, at, constant((1 << rowBits) - 1));
  for (Value index : {row, column})
    index.getDefiningOp()->setAttr(warp::attr::nonNegative, b.getUnitAttr());
  return {row, column};
}

//===----------------------------------------------------------------------===//
// Values to keep
//===----------------------------------------------------------------------===//

/// True if the kernel uses what an atomic returns.
static bool isReturned(Operation *op) {
  auto access = dyn_cast<AccessOp>(op);
  return access && access.isUpdate() && !op->use_empty();
}

/// True if running the kernel again, thread by thread, does the same again.
static bool mayRunAgain(func::FuncOp kernel, const ArrayLeaves &leaves) {
  auto result = kernel.walk([&](Operation *op) {
    bool isOpaque =
        isa<BarrierOp, GradOp>(op) || isTileOp(op) || isCallWithArrays(op);
    if (auto access = dyn_cast<AccessOp>(op); access && access.mayWrite())
      isOpaque |=
          leaves.of(access.getArray()).size() != 1 ||
          (isReturned(op) && op->getParentOfType<LoopLikeOpInterface>());
    return isOpaque ? WalkResult::interrupt() : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

/// The body, or condition, of the innermost loop around an operation.
static Block *getIteration(Operation *op) {
  Block *block = op->getBlock();
  while (block && !isa<scf::ForOp, scf::WhileOp>(block->getParentOp()))
    block = block->getParentOp()->getBlock();
  return block;
}

/// Arrays that are both read and written.
static llvm::SmallDenseSet<unsigned> findUpdated(func::FuncOp kernel,
                                                 const ArrayLeaves &leaves) {
  llvm::SmallDenseSet<unsigned> read, written, both;
  kernel.walk([&](AccessOp op) {
    for (unsigned leaf : leaves.of(op.getArray())) {
      if (op.mayWrite())
        written.insert(leaf);
      if (!op.mayWrite())
        read.insert(leaf);
    }
  });
  for (unsigned leaf : read)
    if (written.contains(leaf))
      both.insert(leaf);
  return both;
}

namespace {

/// Counts how often a block has run.
class PassCounter : public ValueCarrier {
public:
  explicit PassCounter(Operation *marker) : marker(marker) {}
  Value position;

private:
  bool changes(Operation *op) const override { return op == marker; }
  Value pass(Operation *op, Value current) override {
    if (op != marker)
      return current;
    OpBuilder b(op);
    Type type = current.getType();
    SmallVector<Value> sum{
        current,
        ConstantOp::create(b, op->getLoc(), b.getIntegerAttr(type, 1))};
    Value next =
        AddOp::create(b, op->getLoc(), TypeRange(type), sum)->getResult(0);
    position = current;
    op->erase();
    return next;
  }

  Operation *marker;
};

} // namespace

/// Counts the passes of a block; returns an operation at the end of the kernel
/// whose operand is the count.
static Operation *countPasses(func::FuncOp kernel, Block *block,
                              Value &position) {
  Location loc = block->getParentOp()->getLoc();
  Type type = IntegerType::get(kernel.getContext(), 64, IntegerType::Signed);
  OpBuilder b = OpBuilder::atBlockBegin(block);
  auto marker =
      UnrealizedConversionCastOp::create(b, loc, TypeRange(type), ValueRange());
  Block &body = kernel.getBody().front();
  b.setInsertionPointToStart(&body);
  Value zero = ConstantOp::create(b, loc, b.getIntegerAttr(type, 0));
  PassCounter counter(marker);
  Value count = counter.carry(body, zero);
  position = counter.position;
  b.setInsertionPoint(body.getTerminator());
  return UnrealizedConversionCastOp::create(b, loc, TypeRange(type),
                                            ValueRange(count));
}

//===----------------------------------------------------------------------===//
// The log
//===----------------------------------------------------------------------===//

bool makeMemoryLog(func::FuncOp kernel, const MemoryClasses &memory,
                   ArrayRef<unsigned> shared, const OrderedReads &ordered,
                   MemoryLog &log) {
  ArrayLeaves leaves(kernel);
  if (!mayRunAgain(kernel, leaves))
    return false;
  llvm::MapVector<Block *, SmallVector<Operation *>> sites;
  kernel.walk([&](LoadOp load) {
    std::string why;
    bool needsOneThread;
    Block *block = getIteration(load);
    if (block && !ordered.contains(load) &&
        memory.getRecovery(load, why, needsOneThread) == Recovery::Impossible)
      sites[block].push_back(load);
  });
  if (sites.empty() && shared.empty())
    return false;
  SmallVector<Operation *> counts;
  for (auto &[block, loads] : sites) {
    Value position;
    counts.push_back(countPasses(kernel, block, position));
    for (auto [ordinal, load] : llvm::enumerate(loads))
      log.loads[load] = {log.sites, int64_t(ordinal), position};
    ++log.sites;
  }
  kernel.walk([&](AccessOp op) {
    if (isReturned(op))
      log.returned[op] = memory.getNumber(op);
  });
  auto updated = findUpdated(kernel, leaves);
  log.isUnrecorded = kernel->hasAttr(attr::unrecorded);
  for (unsigned leaf : updated)
    if (log.isUnrecorded || !memory.isPrivate(leaf))
      log.checked.insert(leaf);
  recordLoads(kernel, log, updated, counts);
  for (Operation *count : counts)
    count->erase();
  return true;
}

} // namespace warp::autodiff
