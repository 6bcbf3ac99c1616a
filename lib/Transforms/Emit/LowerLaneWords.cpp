//===- LowerLaneWords.cpp - Small elements anywhere, lane by lane ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An element of two to four numbers that lies anywhere is a load of 64 to 256
// bits for its lane, which is less than a gather for each number. Four lanes'
// elements, one below the other, are transposed in registers:
//
//     x0 y0 z0 -      x0 x1 x2 x3
//     x1 y1 z1 -  =>  y0 y1 y2 y3
//     x2 y2 z2 -      z0 z1 z2 z3
//     x3 y3 z3 -
//
// Updates of elements go through memory the other way: values are transposed
// into rows, and a loop over the lanes adds row after row, in the order of the
// lanes, as they may meet.
//
//===----------------------------------------------------------------------===//

#include "LaneAccess.h"
#include "Lanes/Spread.h"
#include "Updates/Atomics.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using namespace warp;

/// Numbers of a lane's row in registers.
constexpr int64_t rowSize = 4;

static mlir::Value shuffle(OpBuilder &b, Location loc, mlir::Value x,
                           mlir::Value y,
                           function_ref<int32_t(int32_t)> place,
                           int64_t count) {
  SmallVector<int32_t> places;
  for (int32_t lane = 0; lane < count; ++lane)
    places.push_back(place(lane));
  return LLVM::ShuffleVectorOp::create(b, loc, x, y, places);
}

/// One vector after the other.
static mlir::Value concatenate(OpBuilder &b, Location loc,
                               ArrayRef<mlir::Value> parts) {
  if (parts.size() == 1)
    return parts[0];
  size_t half = parts.size() / 2;
  mlir::Value x = concatenate(b, loc, parts.take_front(half));
  mlir::Value y = concatenate(b, loc, parts.drop_front(half));
  int64_t size = cast<VectorType>(x.getType()).getNumElements();
  return shuffle(b, loc, x, y, [](int32_t lane) { return lane; }, 2 * size);
}

/// Exchanges rows and columns of the 4 x 4 squares that four vectors form.
static SmallVector<mlir::Value> transpose(OpBuilder &b, Location loc,
                                          ArrayRef<mlir::Value> rows) {
  int64_t lanes = cast<VectorType>(rows[0].getType()).getNumElements();
  // In each square: a0 b0 a1 b1, or a2 b2 a3 b3.
  auto interleave = [&](mlir::Value x, mlir::Value y, int32_t first) {
    return shuffle(
        b, loc, x, y,
        [&](int32_t lane) {
          int32_t inside = lane % rowSize;
          return lane - inside + first + inside / 2 +
                 (inside % 2 ? int32_t(lanes) : 0);
        },
        lanes);
  };
  // In each square: two of one and two of the other.
  auto join = [&](mlir::Value x, mlir::Value y, int32_t first) {
    return shuffle(
        b, loc, x, y,
        [&](int32_t lane) {
          int32_t inside = lane % rowSize;
          return lane - inside + first + inside % 2 +
                 (inside / 2 ? int32_t(lanes) : 0);
        },
        lanes);
  };
  SmallVector<mlir::Value> columns;
  for (int32_t first : {0, 2}) {
    mlir::Value upper = interleave(rows[0], rows[1], first);
    mlir::Value lower = interleave(rows[2], rows[3], first);
    columns.push_back(join(upper, lower, 0));
    columns.push_back(join(upper, lower, 2));
  }
  return columns;
}

/// Reads the numbers of one element as a row.
static mlir::Value loadRow(OpBuilder &b, Location loc, mlir::Type type,
                           mlir::Value from, int64_t count) {
  auto row = VectorType::get(rowSize, type);
  int64_t size = getByteSize(type);
  if (count == rowSize)
    return LLVM::LoadOp::create(b, loc, row, from, size);
  if (count == 2) {
    auto pair = VectorType::get(2, type);
    mlir::Value loaded = LLVM::LoadOp::create(b, loc, pair, from, size);
    return shuffle(b, loc, loaded, loaded,
                   [](int32_t lane) { return lane % 2; }, rowSize);
  }
  auto mask = VectorType::get(rowSize, b.getI1Type());
  mlir::Value taken = arith::ConstantOp::create(
      b, loc,
      DenseElementsAttr::get(mask, ArrayRef<bool>{true, true, true, false}));
  mlir::Value none = arith::ConstantOp::create(b, loc, b.getZeroAttr(row));
  return LLVM::MaskedLoadOp::create(b, loc, row, from, taken, none,
                                    b.getI32IntegerAttr(size),
                                    /*nontemporal=*/UnitAttr());
}

/// Combines the numbers of one element with a row, in pieces of one or two: a
/// masked store keeps a load of the next lane's waiting.
static void updateRow(OpBuilder &b, Location loc, warp::AtomicKind kind,
                      mlir::Value row, mlir::Type type, mlir::Value element,
                      int64_t count) {
  int64_t size = getByteSize(type);
  for (int32_t first = 0; first < count; first += 2) {
    mlir::Value at = LLVM::GEPOp::create(
        b, loc, element.getType(), b.getI8Type(), element,
        ArrayRef<LLVM::GEPArg>(int32_t(first * size)));
    mlir::Value term =
        first + 1 < count
            ? shuffle(b, loc, row, row,
                      [&](int32_t lane) { return first + lane; }, 2)
            : LLVM::ExtractElementOp::create(
                  b, loc, row,
                  arith::ConstantOp::create(b, loc,
                                            b.getI32IntegerAttr(first)))
                  .getResult();
    mlir::Value old = LLVM::LoadOp::create(b, loc, term.getType(), at, size);
    LLVM::StoreOp::create(b, loc, combine(b, loc, kind, old, term, type), at,
                          size);
  }
}

/// Lanes that are not live read what the first live one does.
SmallVector<mlir::Value> ArrayLowering::loadWords(const LaneAccess &access) {
  int64_t lanes = access.lanes, count = access.leaves.size();
  mlir::Type type = getSignless(access.leaves[0].type);
  mlir::Value pointers = access.pointer;
  auto extract = [&](mlir::Value number) -> mlir::Value {
    return LLVM::ExtractElementOp::create(b, loc, pointers, number);
  };
  if (!access.isFull) {
    mlir::Type bitsType = b.getIntegerType(lanes);
    mlir::Value bits =
        LLVM::BitcastOp::create(b, loc, bitsType, access.mask);
    mlir::Value first = LLVM::CountTrailingZerosOp::create(
        b, loc, bitsType, bits, /*is_zero_poison=*/true);
    mlir::Value safe = spread(b, loc, extract(first), lanes);
    pointers = LLVM::SelectOp::create(b, loc, access.mask, pointers, safe);
  }
  SmallVector<mlir::Value> stacked;
  for (int64_t k = 0; k < rowSize; ++k) {
    SmallVector<mlir::Value> rows;
    for (int64_t square = 0; square < lanes / rowSize; ++square)
      rows.push_back(loadRow(b, loc, type,
                             extract(constant(i32, square * rowSize + k)),
                             count));
    stacked.push_back(concatenate(b, loc, rows));
  }
  SmallVector<mlir::Value> columns = transpose(b, loc, stacked);
  columns.truncate(count);
  return columns;
}

//===----------------------------------------------------------------------===//
// Updates
//===----------------------------------------------------------------------===//

/// Stores a vector in memory of the entry's and returns the address.
mlir::Value ArrayLowering::spill(mlir::Value value) {
  mlir::Value slots;
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(&entry.getBody().front());
    mlir::Value one = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
    slots = LLVM::AllocaOp::create(b, loc, pointer, value.getType(), one);
  }
  LLVM::StoreOp::create(b, loc, value, slots);
  return slots;
}

/// A byte per lane in memory; null if all are live.
mlir::Value ArrayLowering::spillMask(const LaneAccess &access) {
  if (access.isFull)
    return {};
  auto bytes = VectorType::get(access.lanes, i8);
  return spill(arith::ExtUIOp::create(b, loc, bytes, access.mask));
}

/// Runs code for a lane if it is live.
void ArrayLowering::ifLive(mlir::Value live, mlir::Value lane,
                           function_ref<void()> body) {
  if (!live)
    return body();
  mlir::Value at = LLVM::GEPOp::create(b, loc, pointer, i8, live,
                                       ArrayRef<LLVM::GEPArg>(lane));
  mlir::Value is = arith::CmpIOp::create(
      b, loc, arith::CmpIPredicate::ne,
      LLVM::LoadOp::create(b, loc, i8, at).getResult(), constant(i8, 0));
  auto branch = scf::IfOp::create(b, loc, is, /*withElseRegion=*/false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  body();
}

/// A loop over the lanes; `body` gets the number of one that is live.
void ArrayLowering::forLiveLanes(const LaneAccess &access,
                                 function_ref<void(mlir::Value)> body) {
  mlir::Value live = spillMask(access);
  auto loop =
      scf::ForOp::create(b, loc, constant(i64, 0), constant(i64, access.lanes),
                         constant(i64, 1));
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  mlir::Value lane = loop.getInductionVar();
  ifLive(live, lane, [&] { body(lane); });
}

/// Plain updates of elements that fit a row.
void ArrayLowering::updateWords(const LaneAccess &access, AtomicKind kind,
                                ArrayRef<mlir::Value> components) {
  int64_t lanes = access.lanes, count = access.leaves.size();
  mlir::Type type = access.leaves[0].type;
  SmallVector<mlir::Value> columns(components);
  while (int64_t(columns.size()) < rowSize)
    columns.push_back(columns.back());
  // Vector k has the rows of lanes k, k + 4, k + 8, ...
  SmallVector<mlir::Value> rows = transpose(b, loc, columns), slots;
  for (mlir::Value vector : rows)
    slots.push_back(spill(vector));
  mlir::Value pointers = spill(
      LLVM::PtrToIntOp::create(b, loc, VectorType::get(lanes, i64),
                               access.pointer));
  mlir::Value live = spillMask(access);
  auto row = VectorType::get(rowSize, getSignless(type));
  auto laneOf = [&](mlir::Value square, int64_t k) -> mlir::Value {
    return arith::AddIOp::create(
        b, loc,
        arith::MulIOp::create(b, loc, square, constant(i64, rowSize)),
        constant(i64, k));
  };
  auto updateLane = [&](mlir::Value square, mlir::Value lane, int64_t k) {
    mlir::Value at = LLVM::GEPOp::create(b, loc, pointer, i64, pointers,
                                         ArrayRef<LLVM::GEPArg>(lane));
    mlir::Value to = LLVM::LoadOp::create(b, loc, dataPointer, at);
    mlir::Value from = LLVM::GEPOp::create(b, loc, pointer, row, slots[k],
                                           ArrayRef<LLVM::GEPArg>(square));
    mlir::Value term = LLVM::LoadOp::create(b, loc, row, from);
    updateRow(b, loc, kind, term, type, to, count);
  };
  auto loop = scf::ForOp::create(b, loc, constant(i64, 0),
                                 constant(i64, lanes / rowSize),
                                 constant(i64, 1));
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  mlir::Value square = loop.getInductionVar();
  for (int64_t k = 0; k < rowSize; ++k) {
    mlir::Value lane = laneOf(square, k);
    ifLive(live, lane, [&] { updateLane(square, lane, k); });
  }
}

/// Updates number by number.
void ArrayLowering::updateEach(const LaneAccess &access, AtomicKind kind,
                               ArrayRef<mlir::Value> components) {
  SmallVector<mlir::Value> slots;
  for (mlir::Value component : components)
    slots.push_back(spill(component));
  mlir::Value pointers = spill(
      LLVM::PtrToIntOp::create(b, loc, VectorType::get(access.lanes, i64),
                               access.pointer));
  forLiveLanes(access, [&](mlir::Value lane) {
    mlir::Value at = LLVM::GEPOp::create(b, loc, pointer, i64, pointers,
                                         ArrayRef<LLVM::GEPArg>(lane));
    mlir::Value to = LLVM::LoadOp::create(b, loc, dataPointer, at);
    for (auto [leaf, slot] : llvm::zip_equal(access.leaves, slots)) {
      mlir::Type type = getSignless(leaf.type);
      mlir::Value from = LLVM::GEPOp::create(b, loc, pointer, type, slot,
                                             ArrayRef<LLVM::GEPArg>(lane));
      mlir::Value term = LLVM::LoadOp::create(b, loc, type, from);
      atomicUpdate(kind, term, leaf.type, advance(to, leaf.offset));
    }
  });
}

void ArrayLowering::lowerLanes(UpdateLanesOp op) {
  LaneAccess access = laneAccess(op.getArray(), op.getIndices(), op.getMask(),
                                 LaneForm::gather, op.getNonNegative());
  SmallVector<mlir::Value> components(op.getComponents());
  if (exclusive && access.hasWords())
    updateWords(access, op.getKind(), components);
  else
    updateEach(access, op.getKind(), components);
}
