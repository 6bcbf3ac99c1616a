//===- RecordLoads.cpp - Replay that records loads of loops ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The kernel on copies of the arrays that it updates, without any other effect.
// A first function only counts the iterations of each loop; values that do not
// change how long loops are have no part in it, for most kernels none. The
// runtime adds up where each thread's part of the log begins, and a second
// function fills it:
//
//   sizing     trips[thread] = position
//   recording  room, offset = trips[thread], offsets[thread]
//              loop:  v = load;  if position < room:  log[offset + position] =
//              v
//
// In arrays whose indices do not show whether threads conflict, an element has
// an owner: a thread that writes it leaves its number, and whoever finds
// another one's counts a conflict, which is an error of the backward pass. The
// second run sees what any thread has written in the first. It leaves the
// negative number, so that it also knows what has not been written yet: that
// must not be read if there is no copy from before the launch.
//
//===----------------------------------------------------------------------===//

#include "RecordLoads.h"

#include "Analysis/Effects.h"
#include "Autodiff/DeadValues.h"
#include "Autodiff/HiddenArguments.h"
#include "Autodiff/Recording.h"
#include "KernelFunction.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;

namespace warp::autodiff {

namespace {

class Recording {
public:
  /// For the function that fills the log, or for the one that counts.
  Recording(func::FuncOp kernel, const MemoryLog &log,
            const llvm::SmallDenseSet<unsigned> &updated, bool fills)
      : kernel(kernel), leaves(kernel), log(log), updated(updated),
        fills(fills), b(kernel.getContext()), loc(kernel.getLoc()),
        wide(b.getIntegerType(64, true)), small(b.getIntegerType(32, true)) {}

  void build(ArrayRef<Operation *> counts);

private:
  /// The part of a thread in the tapes of one site.
  struct Part {
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
  void useReturned();
  void dropEffects();
  void start();
  void reserve(int64_t site, Value count);
  void dropValues();
  void keep(Operation *load, const LoggedLoad &logged);
  void checkOwner(AccessOp op, unsigned leaf);
  Value claimsOf(Value array, unsigned leaf);
  void useCopies();

  func::FuncOp kernel, recording;
  ArrayLeaves leaves;
  const MemoryLog &log;
  const llvm::SmallDenseSet<unsigned> &updated;
  bool fills;
  IRMapping map;
  OpBuilder b;
  Location loc;
  Type wide, small;
  SmallVector<Part> parts;
  SmallVector<Value> thread;
  BlockArgument conflicts;
  llvm::SmallDenseMap<unsigned, BlockArgument> claims;
  /// Reads of elements before they are written, by array.
  llvm::SmallDenseMap<unsigned, BlockArgument> early;
  /// Differs from that of any other thread, and is positive; its negative.
  Value owner, again;
  SmallVector<Location> places;
};

} // namespace

/// Atomics return the values that they returned in the launch.
void Recording::useReturned() {
  for (auto &[op, number] : log.returned) {
    Operation *again = map.lookup(op);
    Type type = again->getResult(0).getType();
    Value saved =
        add(HiddenKind::Saved, number, ArrayType::get(b.getContext(), 4, type));
    b.setInsertionPoint(again);
    again->getResult(0).replaceAllUsesWith(
        LoadOp::create(b, again->getLoc(), type, saved, thread));
  }
}

/// Writes to arrays that the kernel does not read are of no use.
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
  auto load = [&](HiddenKind kind, int64_t site) -> Value {
    return LoadOp::create(b, loc, wide, add(kind, site, perThread), thread);
  };
  for (int64_t site = 0; fills && site < log.sites; ++site)
    parts.push_back(
        {load(HiddenKind::Trips, site), load(HiddenKind::Offsets, site)});
  if (log.checked.empty())
    return;
  // The last one numbers the threads.
  Value number = load(HiddenKind::Offsets, log.sites);
  SmallVector<Value> sum{CastOp::create(b, loc, small, number).getResult(),
                         constant(small, 1)};
  owner = AddOp::create(b, loc, TypeRange(small), sum)->getResult(0);
  SmallVector<Value> difference{constant(small, 0), owner};
  again = SubOp::create(b, loc, TypeRange(small), difference)->getResult(0);
}

/// Takes room for as many values.
void Recording::reserve(int64_t site, Value count) {
  BlockArgument trips =
      add(HiddenKind::Trips, site, ArrayType::get(b.getContext(), 4, wide));
  StoreOp::create(b, loc, count, trips, thread);
}

/// Leaves out what is written, if nothing that is left reads it.
void Recording::dropValues() {
  func::FuncOp shorter = cast<func::FuncOp>(recording->clone());
  ArrayLeaves own(shorter);
  SmallVector<Operation *> writes;
  auto isUpdated = [&](AccessOp op) {
    auto leaf = own.of(op.getArray());
    return leaf.size() == 1 && updated.contains(leaf.front());
  };
  shorter.walk([&](AccessOp op) {
    if (op.mayWrite() && isUpdated(op))
      writes.push_back(op.getOperation());
  });
  for (Operation *op : writes)
    op->erase();
  eraseDead(shorter.getBody());
  bool isRead = shorter
                    .walk([&](AccessOp op) {
                      return isUpdated(op) ? WalkResult::interrupt()
                                           : WalkResult::advance();
                    })
                    .wasInterrupted();
  if (!isRead)
    recording.getBody().takeBody(shorter.getBody());
  shorter.erase();
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
  if (!fills && !op.mayWrite())
    return;
  Value claim = claimsOf(op.getArray(), leaf);
  Value found;
  if (op.mayWrite())
    found = AtomicOp::create(b, place, small, AtomicKind::exch,
                             fills ? again : owner, claim, op.getIndices());
  else
    found = LoadOp::create(b, place, small, claim, op.getIndices());
  if (!fills)
    return;
  Value isOwned = compare("ne", found, constant(small, 0));
  Value isForeign = arith::AndIOp::create(b, place, compare("ne", found, owner),
                                          compare("ne", found, again));
  Value isConflict = arith::AndIOp::create(b, place, isOwned, isForeign);
  auto count = [&](Value condition, BlockArgument &counters, int64_t leaf) {
    if (!counters)
      counters = add(HiddenKind::Counters, leaf,
                     ArrayType::get(b.getContext(), 1, small));
    countOne(b, place, condition, counters, places);
  };
  count(isConflict, conflicts, -1);
  if (log.isUnrecorded && op.mayRead())
    count(compare("eq", found, owner), early[leaf], leaf);
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
  recording.setName((kernel.getName() + (fills ? "_record" : "_size")).str());
  recording->removeAttr(kernelAttrName);
  recording->removeAttr(attr::unrecorded);
  recording->setAttr(fills ? attr::recording : attr::sizing, b.getUnitAttr());
  start();
  useReturned();
  dropEffects();
  if (fills)
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
    if (!fills)
      reserve(site, sink->getOperand(0));
    sink->erase();
  }
  if (!fills)
    dropValues();
  useCopies();
  attachPlaces(recording, places);
  eraseDead(recording.getBody());
}

void recordLoads(func::FuncOp kernel, const MemoryLog &log,
                 const llvm::SmallDenseSet<unsigned> &updated,
                 ArrayRef<Operation *> counts) {
  for (bool fills : {true, false})
    Recording(kernel, log, updated, fills).build(counts);
}

} // namespace warp::autodiff
