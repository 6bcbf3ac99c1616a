//===- LowerTilesUpdates.cpp - Updates of arrays by tiles -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "ApartUpdates.h"
#include "LowerTiles.h"

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

/// Of structs field by field; bits and numbers of less than 32 bits that no
/// atomic operation sums stay.
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

/// Whether no other block of the launch touches the elements of an update:
/// those that differ along a dimension do not, unless products wrap around, and
/// along other dimensions there is one block.
Value TileLowering::isAlone(ArrayRef<int64_t> steps) {
  Value alone;
  for (auto [dim, step] : llvm::enumerate(steps)) {
    Value extent = LaunchExtentOp::create(b, loc, i32, dim);
    bool isOfThreads = isGpu(kernel) && dim + 1 == steps.size();
    int64_t most = isOfThreads ? threads
                   : step == 0 ? 1
                               : std::numeric_limits<int32_t>::max() / step;
    auto predicate =
        isOfThreads ? arith::CmpIPredicate::eq : arith::CmpIPredicate::sle;
    alone = both(
        alone, arith::CmpIOp::create(b, loc, predicate, extent, number(most)));
  }
  return alone;
}

void TileLowering::lowerAtomic(TileAtomicOp op) {
  Type type = tileType(op.getTile()).getElementType();
  bool isSum =
      llvm::is_contained({TileUpdate::add, TileUpdate::sub}, op.getKind());
  bool mayBePlain =
      !debug && isSum && op.getOld().use_empty() && !isa<StructType>(type);
  if (mayBePlain && threads == 1 && op->hasAttr(warp::attr::apart))
    return updateElements(op, /*plainly=*/true);
  auto own = mayBePlain ? ownSteps.find(op) : ownSteps.end();
  if (own == ownSteps.end())
    return updateElements(op, /*plainly=*/false);
  Value alone, inside;
  Values early;
  if (isGpu(kernel) && threads > 1)
    early = loadEarly(op, alone);
  if (early.empty())
    alone = isAlone(own->second);
  // One loop of each kind is enough on a GPU: what crosses an edge is rare.
  if (isGpu(kernel)) {
    collectTested(op, inside);
    alone = both(alone, inside);
  }
  auto branch = scf::IfOp::create(b, loc, alone, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  llvm::SaveAndRestore saved(isDecided, isGpu(kernel));
  for (bool plainly : {true, false}) {
    llvm::SaveAndRestore savedTesting(testing, !plainly);
    Block *block = plainly ? branch.thenBlock() : branch.elseBlock();
    b.setInsertionPoint(block->getTerminator());
    if (plainly && threads > 1)
      updateOwnElements(op, early);
    else
      updateElements(op, plainly);
    if (!plainly && isDecided)
      block->walk([](scf::ForOp loop) { setPlain(loop); });
  }
}

Value TileLowering::updated(TileAtomicOp op, Value value, Value old) {
  return builtin(op.getKind() == TileUpdate::add ? "add" : "sub", {old, value});
}

/// Elements of a thread that are loaded at a time.
constexpr int64_t mostLoaded = 8;

/// Where the thread's element of that number lies in the array.
Values TileLowering::placeOfTurn(TileAtomicOp op, Value number) {
  TileType type = tileType(op.getTile());
  turn = number;
  Value e = add(mul(turn, this->number(threads)), thread);
  Value inside;
  return arrayIndices(op, type, unravel(e, type.getShape()), inside);
}

/// The old elements of a thread, if they can be loaded where the block has
/// computed little yet; then `alone` says whether they have been.
Values TileLowering::loadEarly(TileAtomicOp op, Value &alone) {
  TileType type = tileType(op.getTile());
  int64_t own = type.getNumElements() / threads;
  Operation *place = earliest.lookup(op);
  if (op.getPicked() || type.getNumElements() % threads != 0 ||
      own > mostLoaded || place == op)
    return {};
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(place);
  Value inside;
  alone = isAlone(ownSteps.lookup(op));
  testWindow(op, inside);
  alone = both(alone, inside);
  llvm::SaveAndRestore savedTesting(testing, false);
  SmallVector<Type> types(own, type.getElementType());
  auto branch = scf::IfOp::create(b, loc, types, alone, /*withElse=*/true);
  b.setInsertionPointToStart(branch.thenBlock());
  Values loaded;
  for (int64_t t = 0; t < own; ++t)
    loaded.push_back(LoadOp::create(b, loc, type.getElementType(),
                                    op.getArray(), placeOfTurn(op, number(t))));
  scf::YieldOp::create(b, loc, loaded);
  b.setInsertionPointToStart(branch.elseBlock());
  Values none(own, zero(type.getElementType()));
  scf::YieldOp::create(b, loc, none);
  return Values(branch.getResults());
}

/// Some elements of a thread at a time: all are loaded before the first one is
/// stored, which others would have to wait for.
void TileLowering::updateOwnElements(TileAtomicOp op, ValueRange early) {
  TileType type = tileType(op.getTile());
  int64_t own = type.getNumElements() / threads;
  if (type.getNumElements() % threads != 0)
    return updateElements(op, /*plainly=*/true);
  int64_t run = std::gcd(own, mostLoaded);
  auto updateRun = [&](llvm::function_ref<Value(int64_t)> numberOf) {
    SmallVector<Values> places;
    Values values;
    for (int64_t t = 0; t < run; ++t) {
      places.push_back(placeOfTurn(op, numberOf(t)));
      Value e = add(mul(turn, number(threads)), thread);
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
  if (own == run || touchesStripes(op)) {
    for (int64_t first = 0; first < own; first += run)
      updateRun([&](int64_t t) { return number(first + t); });
    return;
  }
  loop(own / run, [&](Value group) {
    Value first = mul(group, number(run));
    updateRun([&](int64_t t) { return add(first, number(t)); });
  });
}

void TileLowering::updateElements(TileAtomicOp op, bool plainly) {
  TileType type = tileType(op.getTile());
  bool keepsOld = !op.getOld().use_empty();
  elements(op, type.getShape(), [&](ValueRange indices) {
    Value inside;
    Values at = arrayIndices(op, type, indices, inside);
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

} // namespace warp::tiles
