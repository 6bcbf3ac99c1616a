//===- OrderAccesses.cpp - Scheduling: loads first, stores last -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Neither LLVM nor a GPU's assembler moves a load over a store that may be to
// the same address, and pointers from a parameter block may be anything. So a
// thread that loads, computes, stores and loads again waits for memory twice.
// An adjoint does that all the time: it clears a gradient as soon as it has
// read it. Here the accesses are still to arrays, about which more is known:
//
//   load a; store 0 to a; compute; load b; store c to b
//   ==>
//   load a; load b; compute; store c to b; store 0 to a
//
// A constant is stored last, as what was loaded is there by then: a GPU takes
// twice as long, or more, where a store finds its line on the way from memory.
// A block is taken apart at fences: barriers, calls, updates whose old value
// is used, loops and branches that write. Between two fences
//
//   1. writes sink, in their order, until a load that may see one of them;
//   2. a load that equals an earlier one is that one;
//   3. loads rise, in their order, with the arithmetic of their indices, until
//      a write that stayed, or a loop: what it loads has its own order.
//
// Both moves keep values alive for longer, so they end at a number of
// registers. Two accesses alias only if their arrays may overlap: the launch
// says that no written array does (`disjoint`), and an array's gradient
// counts as an array of its own. Arrays that come from anywhere but the
// parameter block may be any.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "GpuBlock.h"
#include "KernelFunction.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/LoopLikeInterface.h"
#include "llvm/ADT/SetVector.h"

namespace warp {
#define GEN_PASS_DEF_ORDERACCESSES
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// Words that loads, or values on their way to memory, may occupy at once.
constexpr int64_t mostHeld = 96;
/// Operations between a load and the start of its stretch that move with it.
constexpr size_t mostMoved = 24;

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

/// The array that an operation does nothing but read; what lanes read under a
/// mask stays where it is.
static Value getLoaded(Operation *op) {
  auto access = dyn_cast<warp::AccessOp>(op);
  bool isLoad = access && !access.mayWrite() && !access.getMask();
  return isLoad ? access.getArray() : Value();
}

/// The array that an operation does nothing but write.
static Value getWritten(Operation *op) {
  auto access = dyn_cast<warp::AccessOp>(op);
  if (!access || !access.mayWrite() || access.getMask())
    return Value();
  bool isOnlyWritten = !access.isUpdate() ||
                       (access.getCombination() && op->use_empty());
  return isOnlyWritten ? access.getArray() : Value();
}

/// True if an operation can stand anywhere between the definitions of its
/// operands and its uses.
static bool isPureOp(Operation *op) {
  return isMemoryEffectFree(op) && !warp::isShuffle(op);
}

/// Memory of a thread's own, which no array is in.
static bool isScratchOp(Operation *op) {
  return isa<warp::ScratchOp, warp::ScratchLoadOp, warp::ScratchStoreOp>(op);
}

/// Appends the arrays that an operation with regions loads from; fails if it
/// does anything else to memory.
static LogicalResult collectLoaded(Operation *op,
                                   SmallVectorImpl<Value> &arrays) {
  if (op->getNumRegions() == 0)
    return failure();
  WalkResult result = op->walk([&](Operation *nested) {
    if (Value array = getLoaded(nested))
      arrays.push_back(array);
    else if (nested->getNumRegions() == 0 && !isPureOp(nested))
      return WalkResult::interrupt();
    return WalkResult::advance();
  });
  return failure(result.wasInterrupted());
}

/// Words of 32 bits that hold these values; constants need none.
static int64_t countWords(ValueRange values) {
  int64_t words = 0;
  for (Value value : values)
    if (value.getType().isIntOrFloat() && !matchPattern(value, m_Constant()))
      words += llvm::divideCeil(value.getType().getIntOrFloatBitWidth(), 32);
  return words;
}

//===----------------------------------------------------------------------===//
// Writes
//===----------------------------------------------------------------------===//

namespace {

class WriteOrder {
public:
  WriteOrder(FunctionOpInterface entry, bool disjoint)
      : origins(entry, disjoint) {}

  void sink(Block &block);

private:
  void flush(size_t count, Operation *place);
  bool reuse(Operation *load);
  void visit(Operation *op);
  void visitWrite(Operation *op, Value array);

  warp::ArrayOrigins origins;
  /// Writes that have not found their place.
  SmallVector<Operation *> pending;
  int64_t held = 0;
  /// Loads whose elements nobody has written since.
  SmallVector<warp::AccessOp> known;
};

} // namespace

/// True if an operation writes constants, which wait for no load.
static bool writesConstants(Operation *op) {
  return countWords(cast<warp::AccessOp>(op).getWritten()) == 0;
}

/// Puts the first writes that are pending in front of an operation, constants
/// behind others that are to other arrays.
void WriteOrder::flush(size_t count, Operation *place) {
  SmallVector<Operation *> constants;
  for (Operation *write : ArrayRef(pending).take_front(count)) {
    if (writesConstants(write)) {
      constants.push_back(write);
      continue;
    }
    size_t before = 0;
    for (auto [i, other] : llvm::enumerate(constants))
      if (origins.mayAlias(getWritten(other), getWritten(write)))
        before = i + 1;
    for (Operation *other : ArrayRef(constants).take_front(before))
      other->moveBefore(place);
    constants.erase(constants.begin(), constants.begin() + before);
    write->moveBefore(place);
  }
  for (Operation *write : constants)
    write->moveBefore(place);
  pending.erase(pending.begin(), pending.begin() + count);
  if (pending.empty())
    held = 0;
}

/// Takes what is known of an element instead of loading it.
bool WriteOrder::reuse(Operation *load) {
  for (warp::AccessOp other : known)
    if (other->getName() == load->getName() &&
        llvm::equal(other->getOperands(), load->getOperands())) {
      load->replaceAllUsesWith(other->getResults());
      load->erase();
      return true;
    }
  known.push_back(cast<warp::AccessOp>(load));
  return false;
}

void WriteOrder::visitWrite(Operation *op, Value array) {
  llvm::erase_if(known, [&](warp::AccessOp load) {
    return origins.mayAlias(load.getArray(), array);
  });
  int64_t words = countWords(cast<warp::AccessOp>(op).getWritten());
  if (held + words > mostHeld)
    flush(pending.size(), op);
  pending.push_back(op);
  held += words;
}

void WriteOrder::visit(Operation *op) {
  if (Value array = getWritten(op))
    return visitWrite(op, array);
  SmallVector<Value> loaded;
  if (Value array = getLoaded(op)) {
    if (reuse(op))
      return;
    loaded.push_back(array);
  } else if (isPureOp(op) || isScratchOp(op)) {
    return;
  } else if (failed(collectLoaded(op, loaded))) {
    known.clear();
    return flush(pending.size(), op);
  }
  for (size_t i = pending.size(); i-- > 0;)
    if (llvm::any_of(loaded, [&](Value array) {
          return origins.mayAlias(array, getWritten(pending[i]));
        }))
      return flush(i + 1, op);
}

void WriteOrder::sink(Block &block) {
  known.clear();
  for (Operation &op : llvm::make_early_inc_range(block.without_terminator()))
    visit(&op);
  flush(pending.size(), block.getTerminator());
}

//===----------------------------------------------------------------------===//
// Loads
//===----------------------------------------------------------------------===//

namespace {

/// A stretch of a block without writes and loops: loads go to its start.
class LoadOrder {
public:
  void raise(Block &block);

private:
  bool isAbove(Operation *op) const;
  bool collectNeeded(Operation *op, SetVector<Operation *> &needed) const;
  void raise(Operation *load);
  void restart(Operation *next);

  DenseMap<Operation *, unsigned> positions;
  /// The place of the next load; what was in front of it at the beginning has
  /// lower positions than `first`.
  Operation *place = nullptr;
  unsigned first = 0;
  DenseSet<Operation *> raised;
  int64_t held = 0;
};

} // namespace

bool LoadOrder::isAbove(Operation *op) const {
  auto position = positions.find(op);
  return position == positions.end() || position->second < first ||
         raised.contains(op);
}

/// Collects what has to move for an operation to move, itself last.
bool LoadOrder::collectNeeded(Operation *op,
                              SetVector<Operation *> &needed) const {
  for (Value operand : op->getOperands()) {
    Operation *from = operand.getDefiningOp();
    if (!from || isAbove(from) || needed.contains(from))
      continue;
    bool isCheap = isPureOp(from) && from->getNumRegions() == 0 &&
                   isa<arith::ArithDialect, warp::WarpDialect>(
                       from->getDialect());
    if (!isCheap || needed.size() > mostMoved ||
        !collectNeeded(from, needed))
      return false;
  }
  needed.insert(op);
  return true;
}

void LoadOrder::raise(Operation *load) {
  int64_t words = countWords(load->getResults());
  SetVector<Operation *> needed;
  if (held + words > mostHeld || !collectNeeded(load, needed))
    return;
  held += words;
  for (Operation *op : needed) {
    raised.insert(op);
    if (op == place)
      place = place->getNextNode();
    else
      op->moveBefore(place);
  }
}

void LoadOrder::restart(Operation *next) {
  place = next;
  first = positions.lookup(next);
  raised.clear();
  held = 0;
}

void LoadOrder::raise(Block &block) {
  positions.clear();
  for (Operation &op : block)
    positions[&op] = positions.size();
  restart(&block.front());
  for (Operation &op : llvm::make_early_inc_range(block.without_terminator())) {
    SmallVector<Value> loaded;
    if (getLoaded(&op))
      raise(&op);
    else if (!isPureOp(&op) && !isScratchOp(&op) &&
             (isa<LoopLikeOpInterface>(op) ||
              failed(collectLoaded(&op, loaded))))
      restart(op.getNextNode());
  }
}

namespace {

struct OrderAccesses : warp::impl::OrderAccessesBase<OrderAccesses> {
  void runOnOperation() override {
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    // A debugging launch reports the first access that fails; a function that
    // is called may access what the entry does.
    if (warp::getVariant(entry).getDebug() ||
        entry->hasAttr(warp::attr::keepsCalls))
      return;
    WriteOrder writes(entry, warp::getVariant(entry).getDisjoint());
    LoadOrder loads;
    entry->walk([&](Block *block) {
      writes.sink(*block);
      loads.raise(*block);
    });
  }
};

} // namespace
