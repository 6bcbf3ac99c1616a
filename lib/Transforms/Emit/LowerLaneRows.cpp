//===- LowerLaneRows.cpp - Transposed loads of whole elements -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A lane takes its element in rows of four numbers, each a load of 128 or 256
// bits, which is less than a gather for each number. Four lanes' rows, one
// below the other, are transposed in registers:
//
//     x0 y0 z0 w0      x0 x1 x2 x3
//     x1 y1 z1 w1  =>  y0 y1 y2 y3
//     x2 y2 z2 w2      z0 z1 z2 z3
//     x3 y3 z3 w3      w0 w1 w2 w3
//
// The last row of an element of more than four numbers overlaps the one before
// it rather than to reach over the end; a shorter element is one short row.
//
//===----------------------------------------------------------------------===//

#include "LaneAccess.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp;

static mlir::Value shuffle(OpBuilder &b, Location loc, mlir::Value x,
                           mlir::Value y, function_ref<int32_t(int32_t)> place,
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

SmallVector<mlir::Value> warp::transpose(OpBuilder &b, Location loc,
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
    return shuffle(
        b, loc, loaded, loaded, [](int32_t lane) { return lane % 2; }, rowSize);
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

/// The starts of rows.
static SmallVector<int64_t> rowStarts(int64_t count) {
  SmallVector<int64_t> starts;
  for (int64_t first = 0; first + rowSize <= count; first += rowSize)
    starts.push_back(first);
  if (count % rowSize != 0)
    starts.push_back(std::max<int64_t>(count - rowSize, 0));
  return starts;
}

static mlir::Value advance(OpBuilder &b, Location loc, mlir::Value pointer,
                           int64_t bytes) {
  if (bytes == 0)
    return pointer;
  return LLVM::GEPOp::create(b, loc, pointer.getType(), b.getI8Type(), pointer,
                             ArrayRef<LLVM::GEPArg>(int32_t(bytes)),
                             LLVM::GEPNoWrapFlags::inbounds);
}

SmallVector<mlir::Value>
warp::loadRows(OpBuilder &b, Location loc, VectorType component, int64_t count,
               function_ref<mlir::Value(int64_t)> pointerOf) {
  mlir::Type type = component.getElementType();
  int64_t lanes = component.getNumElements(), size = getByteSize(type);
  SmallVector<mlir::Value> components(count);
  for (int64_t first : rowStarts(count)) {
    SmallVector<mlir::Value> stacked;
    for (int64_t k = 0; k < rowSize; ++k) {
      SmallVector<mlir::Value> rows;
      for (int64_t lane = k; lane < lanes; lane += rowSize)
        rows.push_back(loadRow(b, loc, type,
                               advance(b, loc, pointerOf(lane), first * size),
                               std::min(count, rowSize)));
      stacked.push_back(concatenate(b, loc, rows));
    }
    SmallVector<mlir::Value> columns = transpose(b, loc, stacked);
    for (int64_t c = first; c < std::min(count, first + rowSize); ++c)
      components[c] = columns[c - first];
  }
  return components;
}

/// Writes the numbers of one element, which are in a vector from `first` on.
static void storeRow(OpBuilder &b, Location loc, mlir::Value from,
                     int32_t first, int64_t count, mlir::Value to) {
  auto type = cast<VectorType>(from.getType()).getElementType();
  int64_t size = getByteSize(type);
  auto store = [&](mlir::Value value, int64_t number) {
    LLVM::StoreOp::create(b, loc, value, advance(b, loc, to, number * size),
                          size);
  };
  int64_t even = count - count % 2;
  store(shuffle(
            b, loc, from, from, [&](int32_t i) { return first + i; }, even),
        0);
  if (even == count)
    return;
  mlir::Value last =
      arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(first + even));
  store(LLVM::ExtractElementOp::create(b, loc, from, last), even);
}

void warp::storeRows(OpBuilder &b, Location loc,
                     ArrayRef<mlir::Value> components,
                     function_ref<mlir::Value(int64_t)> pointerOf) {
  auto type = cast<VectorType>(components[0].getType());
  int64_t size = getByteSize(type.getElementType());
  int64_t count = components.size(), length = std::min(count, rowSize);
  for (int64_t first : rowStarts(count)) {
    SmallVector<mlir::Value> columns(components.slice(first, length));
    columns.resize(rowSize, columns.back());
    SmallVector<mlir::Value> rows = transpose(b, loc, columns);
    for (int64_t lane = 0; lane < type.getNumElements(); ++lane)
      storeRow(b, loc, rows[lane % rowSize], lane - lane % rowSize, length,
               advance(b, loc, pointerOf(lane), first * size));
  }
}
