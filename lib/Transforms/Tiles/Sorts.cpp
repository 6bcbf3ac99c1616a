//===- Sorts.cpp - Model of sorting ---------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Keys become unsigned numbers in the order that is wanted. A CPU merges them
// (lib/DeviceLib/cpu/TileSorts.cpp); the threads of a block make a bitonic
// network over them, with positions to tell equal ones apart: K. Batcher,
// Sorting networks and their applications, 1968.
//
//===----------------------------------------------------------------------===//

#include "Models.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::tiles {

/// Elements of the sorting network.
static int64_t getPaddedElements(TileSortOp op) {
  return llvm::PowerOf2Ceil(tileType(op.getKeys()).getNumElements());
}

namespace {

struct SortLowering : TileLowering {
  using TileLowering::TileLowering;
  void sort(TileSortOp op);

private:
  Value toOrdered(Value key);
  void sortNetwork(Value keys, Value places, int64_t count);
  void orderPair(Value keys, Value places, Value i, Value j, int64_t run);
};

} // namespace

/// A key as an unsigned number of 64 bits in the same order: NaN last, zeros
/// equal.
Value SortLowering::toOrdered(Value key) {
  Type type = key.getType(), i64 = b.getI64Type();
  unsigned width = type.getIntOrFloatBitWidth();
  Type bits = b.getIntegerType(width);
  auto constantOf = [&](APInt value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(bits, value));
  };
  auto widen = [&](Value value) -> Value {
    return width == 64 ? value
                       : Value(arith::ExtUIOp::create(b, loc, i64, value));
  };
  Value sign = constantOf(APInt::getSignMask(width));
  if (auto integer = dyn_cast<IntegerType>(type)) {
    Value value = cast(key, bits);
    if (!integer.isUnsigned())
      value = arith::XOrIOp::create(b, loc, value, sign);
    return widen(value);
  }
  Value isZero = builtin("eq", {key, zero(type)});
  Value isNone = builtin("ne", {key, key});
  Value value = arith::BitcastOp::create(b, loc, bits, key);
  Value isNegative =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, value,
                            constantOf(APInt::getZero(width)));
  Value all = constantOf(APInt::getAllOnes(width));
  Value flipped = arith::XOrIOp::create(
      b, loc, value, arith::SelectOp::create(b, loc, isNegative, all, sign));
  flipped = arith::SelectOp::create(b, loc, isZero, sign, flipped);
  return widen(arith::SelectOp::create(b, loc, isNone, all, flipped));
}

void SortLowering::sort(TileSortOp op) {
  TileType type = tileType(op.getKeys());
  ArrayRef<int64_t> shape = type.getShape();
  int64_t count = type.getNumElements();
  Type ui64 = b.getIntegerType(64, false), si32 = b.getIntegerType(32, true);
  Value positions = memoryOf(op.getPositions());
  auto keyOf = [&](Value i) {
    return cast(toOrdered(element(op.getKeys(), unravel(i, shape))), ui64);
  };
  if (callsForTiles(kernel, threads)) {
    Value keys = arrayAt(scratchOf(op), count, ui64);
    loop(count, [&](Value i) { StoreOp::create(b, loc, keyOf(i), keys, i); });
    return callLibrary("warp_tile_sort", {},
                       {addressOf(keys), addressOf(positions), number(count)});
  }
  // Padding comes last.
  int64_t padded = getPaddedElements(op);
  Value keys = arrayAt(scratchOf(op), padded, ui64);
  Value places = arrayAt(scratchOf(op) + 8 * padded, padded, si32);
  Value last =
      ConstantOp::create(b, loc, IntegerAttr::get(ui64, APInt::getAllOnes(64)));
  share({padded}, [&](ValueRange at) {
    auto branch = scf::IfOp::create(b, loc, TypeRange(ui64),
                                    less(at[0], number(count)), true);
    {
      OpBuilder::InsertionGuard guard(b);
      b.setInsertionPointToStart(branch.thenBlock());
      scf::YieldOp::create(b, loc, keyOf(at[0]));
      b.setInsertionPointToStart(branch.elseBlock());
      scf::YieldOp::create(b, loc, last);
    }
    StoreOp::create(b, loc, branch.getResult(0), keys, at[0]);
    StoreOp::create(b, loc, cast(at[0], si32), places, at[0]);
  });
  barrier();
  sortNetwork(keys, places, padded);
  share({count}, [&](ValueRange at) {
    Value place = LoadOp::create(b, loc, si32, places, at[0]);
    StoreOp::create(b, loc, place, positions, at[0]);
  });
}

/// Runs of `run` elements go up and down in turn; each step orders pairs that
/// are `distance` apart.
void SortLowering::sortNetwork(Value keys, Value places, int64_t count) {
  for (int64_t run = 2; run <= count; run *= 2)
    for (int64_t distance = run / 2; distance > 0; distance /= 2) {
      share({count / (2 * distance), distance}, [&](ValueRange at) {
        Value i = add(mul(at[0], number(2 * distance)), at[1]);
        orderPair(keys, places, i, add(i, number(distance)), run);
      });
      barrier();
    }
}

void SortLowering::orderPair(Value keys, Value places, Value i, Value j,
                             int64_t run) {
  Type ui64 = b.getIntegerType(64, false), si32 = b.getIntegerType(32, true);
  Value a = LoadOp::create(b, loc, ui64, keys, i);
  Value c = LoadOp::create(b, loc, ui64, keys, j);
  Value p = LoadOp::create(b, loc, si32, places, i);
  Value q = LoadOp::create(b, loc, si32, places, j);
  Value isAfter = builtin("gt", {a, c});
  Value ties = both(builtin("eq", {a, c}), builtin("gt", {p, q}));
  isAfter = arith::OrIOp::create(b, loc, isAfter, ties);
  Value part = arith::AndIOp::create(b, loc, i, number(run));
  Value goesDown =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, part, number(0));
  ifHolds(arith::XOrIOp::create(b, loc, isAfter, goesDown), [&] {
    StoreOp::create(b, loc, c, keys, i);
    StoreOp::create(b, loc, a, keys, j);
    StoreOp::create(b, loc, q, places, i);
    StoreOp::create(b, loc, p, places, j);
  });
}

namespace {

struct SortModel : TileModel<SortModel, TileSortOp> {
  /// Keys of 8 bytes and positions of 4; merging needs a second memory.
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    auto sort = cast<TileSortOp>(op);
    return callsForTiles(op, threads)
               ? 20 * tileType(sort.getKeys()).getNumElements()
               : 12 * getPaddedElements(sort);
  }
  void lower(Operation *op, TileLowering &lowering) const {
    SortLowering(lowering.state).sort(cast<TileSortOp>(op));
  }
  /// Positions.
  LogicalResult adjoint(Operation *, autodiff::TileReverse &) const {
    return success();
  }
};

} // namespace

void attachSorts(MLIRContext &context) {
  TileSortOp::attachInterface<SortModel>(context);
}

} // namespace warp::tiles
