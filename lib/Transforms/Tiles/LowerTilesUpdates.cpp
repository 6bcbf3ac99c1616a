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
  Value alone = isAlone(own->second), inside;
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
      updateOwnElements(op);
    else
      updateElements(op, plainly);
    if (!plainly && isDecided)
      block->walk([](scf::ForOp loop) { setPlain(loop); });
  }
}

Value TileLowering::updated(TileAtomicOp op, Value value, ValueRange at) {
  Value old = LoadOp::create(b, loc, value.getType(), op.getArray(), at);
  return builtin(op.getKind() == TileUpdate::add ? "add" : "sub", {old, value});
}

/// Some elements of a thread at a time: all are loaded before the first one is
/// stored, which others would have to wait for.
void TileLowering::updateOwnElements(TileAtomicOp op) {
  TileType type = tileType(op.getTile());
  int64_t own = type.getNumElements() / threads, most = 8;
  if (type.getNumElements() % threads != 0)
    return updateElements(op, /*plainly=*/true);
  int64_t run = std::gcd(own, most);
  auto updateRun = [&](llvm::function_ref<Value(int64_t)> numberOf) {
    SmallVector<Values> places;
    Values values;
    for (int64_t t = 0; t < run; ++t) {
      turn = numberOf(t);
      Value e = add(mul(turn, number(threads)), thread);
      Values indices = unravel(e, type.getShape());
      Value inside;
      places.push_back(arrayIndices(op, type, indices, inside));
      Value value = element(op.getTile(), indices);
      values.push_back(updated(op, value, places.back()));
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
      StoreOp::create(b, loc, updated(op, value, at), op.getArray(), at);
      return value;
    };
    if (keepsOld)
      store(op.getOld(), indices, ifHolds(inside, type.getElementType(), make));
    else
      ifHolds(inside, [&] { make(); });
  });
}

} // namespace warp::tiles
