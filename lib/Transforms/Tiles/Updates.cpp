//===- Updates.cpp - Model of updates of arrays, atomic or plain ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Accumulators.h"
#include "DisjointUpdates.h"
#include "EarlyLoads.h"
#include "Models.h"

#include "KernelFunction.h"
#include "Transforms/Launch/UnrollLoop.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/Support/SaveAndRestore.h"

#include <numeric>

using namespace mlir;

namespace warp::tiles {

AtomicKind toAtomic(TileUpdate kind) {
  switch (kind) {
  case TileUpdate::assign:
    return AtomicKind::exch;
  case TileUpdate::add:
    return AtomicKind::add;
  case TileUpdate::sub:
    return AtomicKind::sub;
  case TileUpdate::and_:
    return AtomicKind::bit_and;
  case TileUpdate::or_:
    return AtomicKind::bit_or;
  case TileUpdate::xor_:
    return AtomicKind::bit_xor;
  case TileUpdate::min:
    return AtomicKind::min;
  case TileUpdate::max:
    return AtomicKind::max;
  }
  llvm_unreachable("no such update");
}

/// Structs are updated field by field; bits and numbers of less than 32 bits,
/// which no atomic operation sums, stay.
Value TileLowering::update(TileUpdate kind, Value value, Value array,
                           ValueRange at) {
  auto record = dyn_cast<StructType>(value.getType());
  if (!record)
    return AtomicOp::create(b, loc, value.getType(), toAtomic(kind), value,
                            array, at);
  Values old;
  for (auto [name, type] :
       llvm::zip_equal(record.getFieldNames(), record.getFieldTypes())) {
    Value field = StructGetOp::create(b, loc, type, value, name);
    if (type.isInteger() && type.getIntOrFloatBitWidth() < 32) {
      old.push_back(field);
      continue;
    }
    auto viewed = ArrayType::get(
        b.getContext(), cast<ArrayType>(array.getType()).getRank(), type);
    Value view =
        ComponentViewOp::create(b, loc, viewed, array, ValueRange(), name);
    old.push_back(update(kind, field, view, at));
  }
  return StructCreateOp::create(b, loc, record, old);
}

void findPlainUpdates(LoweringState &state, ArrayRef<Operation *> ops) {
  // Exact sums have memory of their own, and are not updated plainly.
  bool isExact = getVariant(state.kernel).hasExactSums();
  if (isExact || (state.threads > 1 && !getTarget(state.kernel).isSimt()))
    return;
  for (Operation *op : ops)
    if (auto update = dyn_cast<TileAtomicOp>(op))
      if (std::optional<DisjointSteps> steps =
              findDisjointSteps(state.kernel, update)) {
        state.disjointSteps[op] = *steps;
        state.earliest[op] = findEarliest(update);
      }
}

namespace {

struct UpdateLowering : TileLowering {
  using TileLowering::TileLowering;
  void lower(TileAtomicOp op);

private:
  Value isDisjoint(ArrayRef<int64_t> steps);
  Value updated(TileAtomicOp op, Value value, Value old);
  Values placeOfRound(TileAtomicOp op, Value number);
  Values loadEarly(TileAtomicOp op, Value &disjoint);
  void updateOwnElements(TileAtomicOp op, ValueRange early);
  void updateElements(TileAtomicOp op, bool plainly);
};

} // namespace

/// True if no other block of the launch touches the elements of an update:
/// those that differ along a dimension do not, unless products wrap around, and
/// along other dimensions there is one block.
Value UpdateLowering::isDisjoint(ArrayRef<int64_t> steps) {
  Value disjoint;
  for (auto [dim, step] : llvm::enumerate(steps)) {
    Value extent = LaunchExtentOp::create(b, loc, i32, dim);
    bool isOfThreads = getTarget(kernel).isSimt() && dim + 1 == steps.size();
    int64_t most = isOfThreads ? threads
                   : step == 0 ? 1
                               : std::numeric_limits<int32_t>::max() / step;
    auto predicate =
        isOfThreads ? arith::CmpIPredicate::eq : arith::CmpIPredicate::sle;
    disjoint = both(disjoint, arith::CmpIOp::create(b, loc, predicate, extent,
                                                    number(most)));
  }
  return disjoint;
}

void UpdateLowering::lower(TileAtomicOp op) {
  Type type = tileType(op.getTile()).getElementType();
  bool isSum =
      llvm::is_contained({TileUpdate::add, TileUpdate::sub}, op.getKind());
  bool mayBePlain = !state.debug && isSum && op.getOld().use_empty() &&
                    !isa<StructType>(type);
  if (mayBePlain && threads == 1 && op->hasAttr(warp::attr::disjoint))
    return updateElements(op, /*plainly=*/true);
  auto own =
      mayBePlain ? state.disjointSteps.find(op) : state.disjointSteps.end();
  if (own == state.disjointSteps.end())
    return updateElements(op, /*plainly=*/false);
  Value disjoint, inside;
  Values early;
  if (getTarget(kernel).isSimt() && threads > 1)
    early = loadEarly(op, disjoint);
  if (early.empty())
    disjoint = isDisjoint(own->second);
  // One loop of each kind is enough on a GPU: what crosses an edge is rare.
  if (getTarget(kernel).isSimt()) {
    collectTested(op, inside);
    disjoint = both(disjoint, inside);
  }
  auto branch = scf::IfOp::create(b, loc, disjoint, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  llvm::SaveAndRestore saved(state.isDecided, getTarget(kernel).isSimt());
  for (bool plainly : {true, false}) {
    llvm::SaveAndRestore savedTesting(state.testing, !plainly);
    Block *block = plainly ? branch.thenBlock() : branch.elseBlock();
    b.setInsertionPoint(block->getTerminator());
    if (plainly && threads > 1)
      updateOwnElements(op, early);
    else
      updateElements(op, plainly);
    if (!plainly && state.isDecided)
      block->walk([](scf::ForOp loop) { setPlain(loop); });
  }
}

Value UpdateLowering::updated(TileAtomicOp op, Value value, Value old) {
  return builtin(op.getKind() == TileUpdate::add ? "add" : "sub", {old, value});
}

/// Elements of a thread that are loaded at a time.
constexpr int64_t mostLoaded = 8;

/// The place in the array of the thread's element of that number.
Values UpdateLowering::placeOfRound(TileAtomicOp op, Value number) {
  state.round = number;
  Value e = add(mul(state.round, this->number(threads)), thread);
  Value inside;
  return arrayIndices(op, unravel(e, op.getTileType().getShape()), inside);
}

/// The old elements of a thread, if they can be loaded where the block has
/// computed little yet; then `disjoint` says whether they have been.
Values UpdateLowering::loadEarly(TileAtomicOp op, Value &disjoint) {
  TileType type = tileType(op.getTile());
  int64_t own = type.getNumElements() / threads;
  Operation *place = state.earliest.lookup(op);
  if (op.getPicked() || type.getNumElements() % threads != 0 ||
      own > mostLoaded || place == op)
    return {};
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(place);
  Value inside;
  disjoint = isDisjoint(state.disjointSteps.lookup(op));
  testWindow(op, inside);
  disjoint = both(disjoint, inside);
  llvm::SaveAndRestore savedTesting(state.testing, false);
  SmallVector<Type> types(own, type.getElementType());
  auto branch = scf::IfOp::create(b, loc, types, disjoint, /*withElse=*/true);
  b.setInsertionPointToStart(branch.thenBlock());
  Values loaded;
  for (int64_t t = 0; t < own; ++t)
    loaded.push_back(LoadOp::create(b, loc, type.getElementType(),
                                    op.getArray(),
                                    placeOfRound(op, number(t))));
  scf::YieldOp::create(b, loc, loaded);
  b.setInsertionPointToStart(branch.elseBlock());
  Values none(own, zero(type.getElementType()));
  scf::YieldOp::create(b, loc, none);
  return Values(branch.getResults());
}

/// Some elements of a thread at a time: all are loaded before the first one is
/// stored, which others would have to wait for.
void UpdateLowering::updateOwnElements(TileAtomicOp op, ValueRange early) {
  TileType type = tileType(op.getTile());
  int64_t own = type.getNumElements() / threads;
  if (type.getNumElements() % threads != 0)
    return updateElements(op, /*plainly=*/true);
  int64_t run = std::gcd(own, mostLoaded);
  auto updateRun = [&](llvm::function_ref<Value(int64_t)> numberOf) {
    SmallVector<Values> places;
    Values values;
    for (int64_t t = 0; t < run; ++t) {
      places.push_back(placeOfRound(op, numberOf(t)));
      Value e = add(mul(state.round, number(threads)), thread);
      Value value = element(op.getTile(), unravel(e, type.getShape()));
      Value old = early.empty() ? LoadOp::create(b, loc, value.getType(),
                                                 op.getArray(), places.back())
                                : early[t];
      values.push_back(updated(op, value, old));
    }
    for (auto [at, value] : llvm::zip_equal(places, values))
      StoreOp::create(b, loc, value, op.getArray(), at);
  };
  // Registers have no numbers.
  if (own == run || touchesDistributed(op)) {
    for (int64_t first = 0; first < own; first += run)
      updateRun([&](int64_t t) { return number(first + t); });
    return;
  }
  loop(own / run, [&](Value group) {
    Value first = mul(group, number(run));
    updateRun([&](int64_t t) { return add(first, number(t)); });
  });
}

void UpdateLowering::updateElements(TileAtomicOp op, bool plainly) {
  TileType type = tileType(op.getTile());
  bool keepsOld = !op.getOld().use_empty();
  elements(op, type.getShape(), [&](ValueRange indices) {
    Value inside;
    Values at = arrayIndices(op, indices, inside);
    Value value = element(op.getTile(), indices);
    auto make = [&]() -> Value {
      if (!plainly)
        return update(op.getKind(), value, op.getArray(), at);
      Value old = LoadOp::create(b, loc, value.getType(), op.getArray(), at);
      StoreOp::create(b, loc, updated(op, value, old), op.getArray(), at);
      return value;
    };
    if (keepsOld)
      store(op.getOld(), indices, ifHolds(inside, type.getElementType(), make));
    else
      ifHolds(inside, [&] { make(); });
  });
}

namespace {

struct AtomicModel : TileModel<AtomicModel, TileAtomicOp> {
  bool isByOwners(Operation *) const { return true; }
  TileRead getRead(Operation *op, OpOperand &use) const {
    return getAccessRead(cast<TileAtomicOp>(op), use);
  }
  bool readsElements(Operation *, OpOperand &use) const {
    return use.getOperandNumber() == 0;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto atomic = cast<TileAtomicOp>(op);
    if (lowering.buffers.isInRegisters(atomic.getTile()) &&
        !isDistributed(atomic.getTile()))
      AccumulatorLowering(lowering.state).addTile(atomic);
    else
      UpdateLowering(lowering.state).lower(atomic);
  }
  /// Reads the gradient.
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto atomic = cast<TileAtomicOp>(op);
    if (!reverse.reverse.getActivity().isActiveArray(atomic.getArray()) ||
        !reverse.wants(atomic.getTile()))
      return success();
    bool subtracts = atomic.getKind() == TileUpdate::sub;
    if (atomic.getKind() != TileUpdate::add && !subtracts)
      return op->emitError("an update other than a sum has no derivative");
    Value g = reverse.loadGradient(atomic);
    if (subtracts)
      g = reverse.map(g, [&](ValueRange x) { return reverse.apply("neg", x); });
    reverse.give(atomic.getTile(), g);
    return success();
  }
};

} // namespace

void attachUpdates(MLIRContext &context) {
  TileAtomicOp::attachInterface<AtomicModel>(context);
}

} // namespace warp::tiles
