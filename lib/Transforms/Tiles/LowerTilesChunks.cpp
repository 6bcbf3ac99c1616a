//===- LowerTilesChunks.cpp - Loops over neighbours -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A thread treats four elements next to each other in a turn, so that LLVM
// joins their accesses. That needs addresses which are multiples of 16 bytes; a
// test before the loop finds out.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"
#include "TileChunks.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

using namespace mlir;

namespace warp::tiles {

constexpr int64_t accessBytes = 16;

/// What has to be a multiple of some bytes for all accesses of an operation to
/// be aligned, and of tiles that are computed in its loop.
void TileLowering::collectAligned(Operation *op,
                                  SmallVectorImpl<Aligned> &found) {
  auto addAccess = [&](Value array, ValueRange offsets, TileType tile) {
    int64_t bytes = std::min<int64_t>(
        accessBytes, getByteSize(tile.getElementType()) *
                         getChunk(kernel, tile.getShape(), threads));
    int64_t size = getByteSize(tile.getElementType());
    Type address = b.getIntegerType(64, false);
    found.push_back(
        {cast(PointerOp::create(b, loc, address, array), b.getI64Type()),
         bytes});
    int64_t rank = tile.getRank();
    for (int64_t d = 0; d < rank - 1; ++d)
      found.push_back({cast(StrideOp::create(b, loc, b.getIntegerType(64, true),
                                             array, b.getI64IntegerAttr(d)),
                            b.getI64Type()),
                       bytes});
    Value last = offsets[rank - 1];
    found.push_back({cast(last, getSignless(last.getType())), bytes / size});
  };
  if (auto load = dyn_cast<TileLoadOp>(op))
    addAccess(load.getArray(), load.getOffsets(), tileType(load.getResult()));
  else if (auto store = dyn_cast<TileStoreOp>(op))
    addAccess(store.getArray(), store.getOffsets(), tileType(store.getTile()));
  for (Value operand : op->getOperands()) {
    Operation *def = operand.getDefiningOp();
    if (def && isTile(operand) && isInline(def))
      collectAligned(def, found);
  }
}

static Value isMultiple(OpBuilder &b, Location loc, Value value,
                        int64_t bytes) {
  auto constantOf = [&](int64_t number) -> Value {
    return arith::ConstantOp::create(b, loc,
                                     b.getIntegerAttr(value.getType(), number));
  };
  return arith::CmpIOp::create(
      b, loc, arith::CmpIPredicate::eq,
      arith::AndIOp::create(b, loc, value, constantOf(bytes - 1)),
      constantOf(0));
}

/// One test of all: what each test found out by itself, LLVM would not need to
/// be told again, and forgets where it infers alignment.
Value TileLowering::testAligned(ArrayRef<Aligned> found, Value condition) {
  Value bits;
  for (const Aligned &one : found) {
    if (one.bytes <= 1)
      continue;
    Value wide = cast(one.value, b.getI64Type());
    Value scale = arith::ConstantOp::create(
        b, loc, b.getI64IntegerAttr(accessBytes / one.bytes));
    Value scaled = arith::MulIOp::create(b, loc, wide, scale);
    bits = bits ? Value(arith::OrIOp::create(b, loc, bits, scaled)) : scaled;
  }
  return bits ? both(condition, isMultiple(b, loc, bits, accessBytes))
              : condition;
}

/// For LLVM, which joins accesses only then.
void TileLowering::assumeAligned(ArrayRef<Aligned> found) {
  for (const Aligned &one : found)
    if (one.bytes > 1)
      LLVM::CallIntrinsicOp::create(
          b, loc, b.getStringAttr("llvm.assume"),
          ValueRange(isMultiple(b, loc, one.value, one.bytes)));
}

Values TileLowering::shareChunks(ArrayRef<int64_t> shape, int64_t count,
                                 int64_t chunk, ValueRange sums, Body body) {
  Value first = mul(thread, number(chunk));
  auto group = [&](Value number, ValueRange sums) {
    Value start = add(mul(number, this->number(chunk * threads)), first);
    Value turns = mul(number, this->number(chunk));
    Values next(sums);
    for (int64_t i = 0; i < chunk; ++i) {
      this->turn = add(turns, this->number(i));
      next = body(unravel(add(start, this->number(i)), shape), next);
    }
    return next;
  };
  int64_t groups = count / (chunk * threads);
  if (groups > 1 && !isStriped)
    return loop(number(0), number(groups), number(1), sums, group);
  Values next(sums);
  for (int64_t g = 0; g < groups; ++g)
    next = group(number(g), next);
  return next;
}

} // namespace warp::tiles
