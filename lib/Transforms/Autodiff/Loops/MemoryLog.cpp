//===- MemoryLog.cpp - Values that a loop read from memory ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `for i in range(n): x[c[i]] = f(x[p[i]])` reads what earlier iterations wrote
// and overwrites what is there. What it read cannot be had again from what is
// left. So before the adjoint, the kernel runs again, on copies of what it
// writes, made before the launch, and keeps what the loads have read:
//
//   kernel     position = 0
//              loop:  v = load;  position += 1           (dead code there)
//   recording  loop:  v = load;  log[offset + position] = v;  position += 1
//              if it is the first run:  offset = atomic total += position
//   adjoint    loop:  v = log[offset + position]
//
// The position is a value that the loop carries: reversed loops know how to
// have it again. A run without room counts and reserves the thread's part, a
// second one with room fills the log.
//
// All of this is right if no thread touches what another one writes. Where
// indices do not tell, each element has an owner in the recording: a thread
// that writes it leaves its number, and whoever finds another one's counts a
// conflict, which is an error of the backward pass.
//
//===----------------------------------------------------------------------===//

#include "MemoryLog.h"

#include "CarryValue.h"

#include "Analysis/Effects.h"
#include "Autodiff/DeadValues.h"
#include "Autodiff/HiddenArguments.h"
#include "Autodiff/Recording.h"
#include "KernelFunction.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

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
// What to keep
//===----------------------------------------------------------------------===//

/// Whether running the kernel again, thread by thread, does the same again.
static bool mayRunAgain(func::FuncOp kernel, const ArrayLeaves &leaves) {
  auto result = kernel.walk([&](Operation *op) {
    bool isOpaque = isa<BarrierOp, GradOp>(op) || isTileOp(op);
    if (isa<func::CallOp>(op))
      isOpaque |= llvm::any_of(op->getOperandTypes(), [](Type type) {
        return countArrays(type) != 0;
      });
    if (auto access = dyn_cast<AccessOp>(op); access && access.mayWrite())
      isOpaque |= leaves.of(access.getArray()).size() != 1 ||
                  (access.isUpdate() && !op->use_empty());
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
// The function that fills the log
//===----------------------------------------------------------------------===//

namespace {

class Recording {
public:
  Recording(func::FuncOp kernel, const MemoryLog &log,
            const llvm::SmallDenseSet<unsigned> &updated)
      : kernel(kernel), leaves(kernel), log(log), updated(updated),
        b(kernel.getContext()), loc(kernel.getLoc()),
        wide(b.getIntegerType(64, true)), small(b.getIntegerType(32, true)) {}

  void build(ArrayRef<Operation *> counts);

private:
  /// The part of a thread in the tapes of one site.
  struct Part {
    BlockArgument trips, offsets;
    Value room, offset;
  };

  Value constant(Type type, int64_t value) {
    return ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  }
  Value compare(StringRef how, Value x, Value y) {
    return createBuiltin(b, loc, how, {x, y})->getResult(0);
  }
  BlockArgument add(HiddenKind kind, int64_t leaf, Type type,
                    int64_t direction = 0) {
    auto hidden = HiddenAttr::get(b.getContext(), kind, leaf, direction);
    return addHidden(recording, hidden, type);
  }
  void dropEffects();
  void start();
  void reserve(int64_t site, Value count);
  void keep(Operation *load, const LoggedLoad &logged);
  void checkOwner(AccessOp op, unsigned leaf);
  Value claimsOf(Value array, unsigned leaf);
  void useCopies();

  func::FuncOp kernel, recording;
  ArrayLeaves leaves;
  const MemoryLog &log;
  const llvm::SmallDenseSet<unsigned> &updated;
  IRMapping map;
  OpBuilder b;
  Location loc;
  Type wide, small;
  SmallVector<Part> parts;
  SmallVector<Value> thread;
  BlockArgument totals, conflicts;
  llvm::SmallDenseMap<unsigned, BlockArgument> claims;
  /// Differs from that of any other thread, and is not 0.
  Value owner;
  SmallVector<Location> places;
};

} // namespace

/// What the kernel does to arrays that it does not read is of no use.
void Recording::dropEffects() {
  SmallVector<Operation *> dropped;
  kernel.walk([&](Operation *op) {
    auto access = dyn_cast<AccessOp>(op);
    bool isWrite = access && access.mayWrite();
    if (isa<PrintfOp, AssertOp>(op) ||
        (isWrite && !updated.contains(leaves.of(access.getArray()).front())))
      dropped.push_back(map.lookup(op));
  });
  for (Operation *op : dropped)
    op->erase();
}

void Recording::start() {
  b.setInsertionPointToStart(&recording.getBody().front());
  auto tid = TidOp::create(b, loc, SmallVector<Type>(4, small));
  llvm::append_range(thread, tid.getResults());
  Type perThread = ArrayType::get(b.getContext(), 4, wide);
  totals = add(HiddenKind::Totals, -1, ArrayType::get(b.getContext(), 1, wide));
  // The last one numbers the threads.
  for (int64_t site = 0; site <= log.sites; ++site) {
    Part part{add(HiddenKind::Trips, site, perThread),
              add(HiddenKind::Offsets, site, perThread), nullptr, nullptr};
    part.room = LoadOp::create(b, loc, wide, part.trips, thread);
    parts.push_back(part);
    if (site == log.sites)
      reserve(site, constant(wide, 1));
    parts.back().offset = LoadOp::create(b, loc, wide, part.offsets, thread);
  }
  SmallVector<Value> sum{
      CastOp::create(b, loc, small, parts.back().offset).getResult(),
      constant(small, 1)};
  owner = AddOp::create(b, loc, TypeRange(small), sum)->getResult(0);
}

/// In the run without room, takes room for as many values.
void Recording::reserve(int64_t site, Value count) {
  Part &part = parts[site];
  auto branch = scf::IfOp::create(
      b, loc, compare("eq", part.room, constant(wide, 0)), false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  StoreOp::create(b, loc, count, part.trips, thread);
  Value offset = AtomicOp::create(b, loc, wide, AtomicKind::add, count, totals,
                                  ValueRange(constant(small, site)));
  StoreOp::create(b, loc, offset, part.offsets, thread);
}

void Recording::keep(Operation *load, const LoggedLoad &logged) {
  Value value = map.lookup(load->getResult(0));
  Value position = map.lookup(logged.position);
  const Part &part = parts[logged.site];
  Type type = ArrayType::get(b.getContext(), 2, value.getType());
  Value tape = add(HiddenKind::Tape, logged.site, type, logged.ordinal);
  b.setInsertionPointAfterValue(value);
  auto branch =
      scf::IfOp::create(b, loc, compare("lt", position, part.room), false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  SmallVector<Value> sum{part.offset, position};
  Value at = AddOp::create(b, loc, TypeRange(wide), sum)->getResult(0);
  at = CastOp::create(b, loc, b.getI64Type(), at);
  StoreOp::create(b, loc, value, tape, getTapeIndices(b, loc, at));
}

/// The owners, seen through the views that the array was made by.
Value Recording::claimsOf(Value array, unsigned leaf) {
  auto op = array.getDefiningOp<ArrayViewOp>();
  if (!op) {
    BlockArgument &claim = claims[leaf];
    int64_t rank = cast<ArrayType>(array.getType()).getRank();
    if (!claim)
      claim = add(HiddenKind::Claims, leaf,
                  ArrayType::get(b.getContext(), rank, small));
    return claim;
  }
  Value base = claimsOf(op.getArray(), leaf);
  // An element belongs to one thread as a whole.
  if (isa<ComponentViewOp>(op.getOperation()))
    return base;
  Operation *view = b.clone(*op.getOperation());
  view->setOperand(0, base);
  int64_t rank = cast<ArrayType>(array.getType()).getRank();
  view->getResult(0).setType(ArrayType::get(b.getContext(), rank, small));
  return view->getResult(0);
}

void Recording::checkOwner(AccessOp op, unsigned leaf) {
  b.setInsertionPoint(op);
  Location place = op.getLoc();
  Value claim = claimsOf(op.getArray(), leaf);
  Value found;
  if (op.mayWrite())
    found = AtomicOp::create(b, place, small, AtomicKind::exch, owner, claim,
                             op.getIndices());
  else
    found = LoadOp::create(b, place, small, claim, op.getIndices());
  Value isOwned = compare("ne", found, constant(small, 0));
  Value isForeign = compare("ne", found, owner);
  Value isConflict = arith::AndIOp::create(b, place, isOwned, isForeign);
  if (!conflicts)
    conflicts =
        add(HiddenKind::Counters, -1, ArrayType::get(b.getContext(), 1, small));
  countOne(b, place, isConflict, conflicts, places);
}

/// Reads and writes copies of what the kernel updates.
void Recording::useCopies() {
  ArrayLeaves own(recording);
  llvm::MapVector<Value, unsigned> roots;
  recording.walk([&](AccessOp op) {
    Value root = rootOf(op.getArray());
    auto leaf = own.of(root);
    if (leaf.size() == 1 && updated.contains(leaf.front()))
      roots.insert({root, leaf.front()});
  });
  llvm::SmallDenseMap<unsigned, BlockArgument> copies;
  for (auto [root, leaf] : roots) {
    BlockArgument &copy = copies[leaf];
    if (!copy)
      copy = add(HiddenKind::Preserved, leaf, root.getType());
    root.replaceAllUsesWith(copy);
  }
}

void Recording::build(ArrayRef<Operation *> counts) {
  recording = cast<func::FuncOp>(kernel->clone(map));
  OpBuilder(kernel).insert(recording);
  recording->moveAfter(kernel);
  recording.setName((kernel.getName() + "_record").str());
  recording->removeAttr(kernelAttrName);
  recording->setAttr(attr::recording, b.getUnitAttr());
  dropEffects();
  start();
  for (auto &[load, logged] : log.loads)
    keep(load, logged);
  kernel.walk([&](AccessOp op) {
    auto leaf = leaves.of(op.getArray());
    if (leaf.size() == 1 && log.checked.contains(leaf.front()))
      checkOwner(cast<AccessOp>(map.lookup(op.getOperation())), leaf.front());
  });
  for (auto [site, count] : llvm::enumerate(counts)) {
    Operation *sink = map.lookup(count);
    b.setInsertionPoint(sink);
    reserve(site, sink->getOperand(0));
    sink->erase();
  }
  useCopies();
  attachPlaces(recording, places);
  eraseDead(recording.getBody());
}

//===----------------------------------------------------------------------===//
// The log
//===----------------------------------------------------------------------===//

bool makeMemoryLog(func::FuncOp kernel, const MemoryClasses &memory,
                   ArrayRef<unsigned> shared, MemoryLog &log) {
  ArrayLeaves leaves(kernel);
  if (!mayRunAgain(kernel, leaves))
    return false;
  llvm::MapVector<Block *, SmallVector<Operation *>> sites;
  kernel.walk([&](LoadOp load) {
    std::string why;
    bool needsOneThread;
    Block *block = getIteration(load);
    if (block &&
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
  auto updated = findUpdated(kernel, leaves);
  for (unsigned leaf : updated)
    if (!memory.isPrivate(leaf))
      log.checked.insert(leaf);
  Recording(kernel, log, updated).build(counts);
  for (Operation *count : counts)
    count->erase();
  return true;
}

} // namespace warp::autodiff
