//===- GeometryMemory.cpp - Alias analysis of memory behind handles -------===//
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
  return call && warp::findsSlot(call) ? call : nullptr;
}

/// True if only the runtime writes what a word of a slot leads to.
static bool isReadOnly(int64_t kind, int64_t word) {
#define WARP_HANDLE_KIND(KIND, NUMBER)                                         \
  constexpr int64_t KIND [[maybe_unused]] = NUMBER;
#define WARP_SLOT_FIELD(KIND, FORM, NAME, WORD, SIZE, IS_READ_ONLY)            \
  if (IS_READ_ONLY && kind == KIND && word == WORD)                            \
    return true;
#include "warp/HandleKinds.inc"
  return false;
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
  auto memory = rootOf(array).getDefiningOp<ArrayAtOp>();
  if (!memory)
    return false;
  if (slotAt(memory.getAddress()))
    return true;
  LoadComponentsOp word = wordOfSlot(memory);
  // Values of a volume's grid, which kernels write, are in rows.
  if (!word || memory.getExtents().size() != 1)
    return false;
  auto slot = cast<ArrayAtOp>(rootOf(word.getArray()).getDefiningOp());
  APInt kind, place;
  return matchPattern(slotAt(slot.getAddress()).getArgs()[1],
                      m_ConstantInt(&kind)) &&
         matchPattern(word.getIndices().front(), m_ConstantInt(&place)) &&
         isReadOnly(kind.getSExtValue(), place.getSExtValue());
}
