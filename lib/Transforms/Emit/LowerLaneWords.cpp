//===- LowerLaneWords.cpp - Scattered elements, lane by lane --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Scattered elements of several numbers are loaded lane by lane, as
// rows (LowerLaneRows.cpp). Updates go through memory the other way: values are
// transposed into rows, and a loop over the lanes adds row after row, in the
// order of the lanes, as their elements may be the same.
//
//===----------------------------------------------------------------------===//

#include "LaneAccess.h"
#include "Lanes/Neighbours.h"
#include "Lanes/Spread.h"
#include "Updates/Atomics.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using namespace warp;

/// Combines the numbers of one element with a row, in pieces of one or two: a
/// masked store keeps a load of the next lane's waiting.
static void updateRow(OpBuilder &b, Location loc, warp::AtomicKind kind,
                      mlir::Value row, mlir::Type type, mlir::Value element,
                      int64_t count) {
  int64_t size = getByteSize(type);
  for (int32_t first = 0; first < count; first += 2) {
    mlir::Value at =
        LLVM::GEPOp::create(b, loc, element.getType(), b.getI8Type(), element,
                            ArrayRef<LLVM::GEPArg>(int32_t(first * size)));
    mlir::Value term =
        first + 1 < count
            ? LLVM::ShuffleVectorOp::create(b, loc, row, row,
                                            ArrayRef<int32_t>{first, first + 1})
                  .getResult()
            : LLVM::ExtractElementOp::create(
                  b, loc, row,
                  arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(first)))
                  .getResult();
    mlir::Value old = LLVM::LoadOp::create(b, loc, term.getType(), at, size);
    LLVM::StoreOp::create(b, loc, combine(b, loc, kind, old, term, type), at,
                          size);
  }
}

/// Lanes that are not live read what the first live one does.
SmallVector<mlir::Value> ArrayLowering::loadWords(const LaneAccess &access) {
  int64_t lanes = access.lanes;
  mlir::Value pointers = access.pointer;
  auto extract = [&](mlir::Value number) -> mlir::Value {
    return LLVM::ExtractElementOp::create(b, loc, pointers, number);
  };
  if (!access.isFull) {
    mlir::Value safe = spread(b, loc, extract(access.firstLive(b, loc)), lanes);
    pointers = LLVM::SelectOp::create(b, loc, access.mask, pointers, safe);
  }
  SmallVector<mlir::Value> pointerOf;
  for (int64_t lane = 0; lane < lanes; ++lane) {
    mlir::Value one = extract(constant(i32, lane));
    if (access.offset)
      one = LLVM::GEPOp::create(b, loc, one.getType(), i8, one,
                                ArrayRef<LLVM::GEPArg>(access.offset));
    pointerOf.push_back(one);
  }
  return loadRows(b, loc, access.wordLanes(), access.leaves.size(),
                  [&](int64_t lane) { return pointerOf[lane]; });
}

//===----------------------------------------------------------------------===//
// Updates
//===----------------------------------------------------------------------===//

/// Stores vectors of one type, one after the other, in memory of the entry's
/// and returns the address.
mlir::Value ArrayLowering::spill(mlir::ValueRange vectors) {
  mlir::Type type = vectors.front().getType();
  mlir::Value slots;
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(&entry.getBody().front());
    mlir::Value count =
        LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(vectors.size()));
    slots = LLVM::AllocaOp::create(b, loc, pointer, type, count);
  }
  for (auto [k, vector] : llvm::enumerate(vectors)) {
    mlir::Value to = LLVM::GEPOp::create(b, loc, pointer, type, slots,
                                         ArrayRef<LLVM::GEPArg>(int32_t(k)));
    LLVM::StoreOp::create(b, loc, vector, to);
  }
  return slots;
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
  SmallVector<mlir::Value> rows = transpose(b, loc, columns);
  mlir::Value all = spill(rows);
  mlir::Value addresses = LLVM::PtrToIntOp::create(
      b, loc, VectorType::get(lanes, i64), access.pointer);
  mlir::Value pointers = spill(addresses);
  auto row = VectorType::get(rowSize, getSignless(type));
  // Lane 4 * square + k.
  auto updateLane = [&](mlir::Value lane, mlir::Value square, mlir::Value k) {
    mlir::Value at = LLVM::GEPOp::create(b, loc, pointer, i64, pointers,
                                         ArrayRef<LLVM::GEPArg>(lane));
    mlir::Value to = LLVM::LoadOp::create(b, loc, dataPointer, at);
    mlir::Value squares = constant(i64, lanes / rowSize);
    mlir::Value place = arith::AddIOp::create(
        b, loc, arith::MulIOp::create(b, loc, k, squares), square);
    mlir::Value from = LLVM::GEPOp::create(b, loc, pointer, row, all,
                                           ArrayRef<LLVM::GEPArg>(place));
    mlir::Value term = LLVM::LoadOp::create(b, loc, row, from);
    updateRow(b, loc, kind, term, type, to, count);
  };
  mlir::Value size = constant(i64, rowSize);
  auto updateAll = [&] {
    auto loop =
        scf::ForOp::create(b, loc, constant(i64, 0),
                           constant(i64, lanes / rowSize), constant(i64, 1));
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(loop.getBody());
    mlir::Value square = loop.getInductionVar();
    mlir::Value first = arith::MulIOp::create(b, loc, square, size);
    for (int64_t k = 0; k < rowSize; ++k) {
      mlir::Value number = constant(i64, k);
      updateLane(arith::AddIOp::create(b, loc, first, number), square, number);
    }
  };
  if (access.isFull)
    return updateAll();
  // In long code full vectors have no copy of their own.
  mlir::Value isAll =
      LLVM::vector_reduce_and::create(b, loc, b.getI1Type(), access.mask);
  auto branch = scf::IfOp::create(b, loc, isAll, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  updateAll();
  b.setInsertionPointToStart(branch.elseBlock());
  forLiveLanes(b, loc, access.mask, [&](mlir::Value lane) {
    updateLane(lane, arith::DivUIOp::create(b, loc, lane, size),
               arith::RemUIOp::create(b, loc, lane, size));
  });
}

/// Updates number by number.
void ArrayLowering::updateEach(const LaneAccess &access, AtomicKind kind,
                               ArrayRef<mlir::Value> components) {
  SmallVector<mlir::Value> slots;
  for (mlir::Value component : components)
    slots.push_back(spill(component));
  mlir::Value addresses = LLVM::PtrToIntOp::create(
      b, loc, VectorType::get(access.lanes, i64), access.pointer);
  mlir::Value pointers = spill(addresses);
  forLiveLanes(b, loc, access.mask, [&](mlir::Value lane) {
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
  if (auto window = windows.find(op); window != windows.end())
    return window->second.empty() ? void() : updateWindow(window->second);
  if (exclusive && op->hasAttr(attr::neighbours))
    return updateNeighbours(op);
  updateApart(op);
}

void ArrayLowering::updateApart(UpdateLanesOp op) {
  LaneAccess access = laneAccess(op.getArray(), op.getIndices(), op.getMask(),
                                 LaneForm::gather, op.getNonNegative());
  SmallVector<mlir::Value> components(op.getComponents());
  bool isRow = access.hasWords() && access.leaves.size() <= size_t(rowSize) &&
               llvm::all_equal(llvm::map_range(
                   access.leaves, [](const Leaf &leaf) { return leaf.type; }));
  if (exclusive && isRow)
    updateWords(access, op.getKind(), components);
  else
    updateEach(access, op.getKind(), components);
}
