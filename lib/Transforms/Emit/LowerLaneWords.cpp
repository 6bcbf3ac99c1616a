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
  auto loop = scf::ForOp::create(b, loc, constant(i64, 0),
                                 constant(i64, access.lanes), constant(i64, 1));
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
  mlir::Value pointers = spill(LLVM::PtrToIntOp::create(
      b, loc, VectorType::get(lanes, i64), access.pointer));
  mlir::Value live = spillMask(access);
  auto row = VectorType::get(rowSize, getSignless(type));
  auto laneOf = [&](mlir::Value square, int64_t k) -> mlir::Value {
    return arith::AddIOp::create(
        b, loc, arith::MulIOp::create(b, loc, square, constant(i64, rowSize)),
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
  auto loop =
      scf::ForOp::create(b, loc, constant(i64, 0),
                         constant(i64, lanes / rowSize), constant(i64, 1));
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
  mlir::Value pointers = spill(LLVM::PtrToIntOp::create(
      b, loc, VectorType::get(access.lanes, i64), access.pointer));
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
