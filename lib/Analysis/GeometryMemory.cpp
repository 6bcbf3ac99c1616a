//===- GeometryMemory.cpp - Geometry memory of the runtime ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GeometryMemory.h"

#include "ArrayOrigins.h"
#include "WarpDialect/LibraryOps.h"

#include "mlir/IR/Matchers.h"

using namespace mlir;

/// The call that gave the address of a handle's slot, or null.
static warp::LibraryCallOp slotAt(Value address) {
  auto call = address.getDefiningOp<warp::LibraryCallOp>();
  return call && call.getCallee() == "warp_slot" ? call : nullptr;
}

static bool isConstant(Value value, llvm::ArrayRef<int64_t> numbers) {
  APInt number;
  return matchPattern(value, m_ConstantInt(&number)) &&
         llvm::is_contained(numbers, number.getSExtValue());
}

/// The load of the address that memory lies at from a handle's slot, or null.
static warp::LoadComponentsOp wordOfSlot(warp::ArrayAtOp memory) {
  auto word = memory.getAddress().getDefiningOp<warp::LoadComponentsOp>();
  if (!word || word.getIndices().size() != 1)
    return nullptr;
  auto slot = warp::rootOf(word.getArray()).getDefiningOp<warp::ArrayAtOp>();
  return slot && slotAt(slot.getAddress()) ? word : nullptr;
}

bool warp::isBehindHandle(Value array) {
  auto memory = rootOf(array).getDefiningOp<ArrayAtOp>();
  return memory && (slotAt(memory.getAddress()) || wordOfSlot(memory));
}

bool warp::isGeometryMemory(Value array) {
  // python/warp/_src/geometry: handles.py, grid_queries.py, volumes/places.py.
  constexpr int64_t kindOfGrid = 1, startsOfCells = 4, order = 11;
  constexpr int64_t kindOfVolume = 4, headerOfGrid = 1;
  auto memory = rootOf(array).getDefiningOp<ArrayAtOp>();
  if (!memory)
    return false;
  if (slotAt(memory.getAddress()))
    return true;
  LoadComponentsOp word = wordOfSlot(memory);
  if (!word)
    return false;
  auto slot = cast<ArrayAtOp>(rootOf(word.getArray()).getDefiningOp());
  Value kind = slotAt(slot.getAddress()).getArgs()[1];
  Value place = word.getIndices().front();
  // Values of a grid are in rows.
  bool isHeader = memory.getExtents().size() == 1;
  return (isConstant(kind, {kindOfGrid}) &&
          isConstant(place, {startsOfCells, order})) ||
         (isHeader && isConstant(kind, {kindOfVolume}) &&
          isConstant(place, {headerOfGrid}));
}
