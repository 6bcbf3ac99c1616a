//===- LowerLaneNeighbours.cpp - Nearly contiguous lane accesses ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Accesses to elements that follow each other unless a lane is at a border
// (warp::areMostlyNeighbours). Lanes compare where they are:
//
//   first = place[k] - k, k the first live lane
//   if place[l] - l == first in all live lanes l
//     load, or update, the elements from `first` on
//   else
//     gather, or update one by one
//
//===----------------------------------------------------------------------===//

#include "LaneAccess.h"
#include "Lanes/Spread.h"
#include "Updates/Atomics.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

#include <numeric>

using namespace mlir;
using namespace warp;

namespace {
/// The place of lane 0, live or not, if those of live lanes follow each other.
struct Run {
  mlir::Value first, isOne;
};
} // namespace

static Run findRun(OpBuilder &b, Location loc, mlir::Value places,
                   mlir::Value mask) {
  auto type = cast<VectorType>(places.getType());
  int64_t lanes = type.getNumElements();
  unsigned bits = type.getElementTypeBitWidth();
  SmallVector<APInt> numbers;
  for (int64_t lane = 0; lane < lanes; ++lane)
    numbers.emplace_back(bits, lane);
  mlir::Value lane = arith::ConstantOp::create(
      b, loc, DenseElementsAttr::get(type, ArrayRef<APInt>(numbers)));
  mlir::Value starts = arith::SubIOp::create(b, loc, places, lane);
  bool isFull = isFullMask(mask);
  mlir::Type word = b.getIntegerType(lanes);
  auto toWord = [&](mlir::Value flags) -> mlir::Value {
    return LLVM::BitcastOp::create(b, loc, word, flags);
  };
  mlir::Value live =
      isFull ? arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(0))
                   .getResult()
             : LLVM::CountTrailingZerosOp::create(b, loc, word, toWord(mask),
                                                  /*is_zero_poison=*/true)
                   .getResult();
  Run run;
  run.first = LLVM::ExtractElementOp::create(b, loc, starts, live);
  mlir::Value differs =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, starts,
                            spread(b, loc, run.first, lanes));
  if (!isFull)
    differs = arith::AndIOp::create(b, loc, differs, mask);
  mlir::Value none =
      arith::ConstantOp::create(b, loc, b.getIntegerAttr(word, 0));
  run.isOne = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq,
                                    toWord(differs), none);
  return run;
}

/// Runs `together` with a `unit` access where elements follow each other, else
/// `apart`; both have results of these types.
SmallVector<mlir::Value> ArrayLowering::ifNeighbours(
    AccessOp op, mlir::Value mask, ArrayRef<bool> nonNegative,
    ArrayRef<mlir::Type> types,
    function_ref<SmallVector<mlir::Value>(const LaneAccess &)> together,
    function_ref<SmallVector<mlir::Value>()> apart) {
  mlir::Value array = op.getArray();
  ArrayParts parts = getParts(array);
  ValueRange indices = op.getIndices();
  auto isVector = [](mlir::Value v) { return isa<VectorType>(v.getType()); };
  // In one row the last index tells; else what all of them lead to.
  bool isRow = llvm::none_of(indices.drop_back(), isVector) &&
               getElementTypeOrSelf(indices.back()).isInteger();
  if (!isRow && parts.unit == 0)
    return apart();
  LaneAccess access;
  collectLeaves(elementType(array), 0, access.leaves);
  access.mask = mask;
  access.isFull = isFullMask(mask);
  access.lanes = cast<VectorType>(mask.getType()).getNumElements();
  mlir::Value places =
      isRow ? indices.back()
            : gatherOffsets(parts, indices, nonNegative, access.lanes);
  Run run = findRun(b, loc, places, mask);
  if (isRow && !nonNegative.back()) {
    mlir::Value zero = arith::ConstantOp::create(
        b, loc, b.getIntegerAttr(run.first.getType(), 0));
    mlir::Value isRight = arith::CmpIOp::create(
        b, loc, arith::CmpIPredicate::sge, run.first, zero);
    run.isOne = arith::AndIOp::create(b, loc, run.isOne, isRight);
  }
  auto branch = scf::IfOp::create(b, loc, types, run.isOne,
                                  /*addThenBlock=*/true, /*addElseBlock=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, apart());
  b.setInsertionPointToStart(branch.thenBlock());
  if (isRow) {
    SmallVector<mlir::Value> from;
    for (auto [index, extent, isRight] :
         llvm::zip(indices.drop_back(), parts.shape, nonNegative))
      from.push_back(isRight ? index : wrapIndex(index, extent));
    from.push_back(run.first);
    access.pointer = elementPointer(parts, from, elementType(array),
                                    /*inside=*/access.isFull);
  } else {
    access.pointer = LLVM::GEPOp::create(
        b, loc, dataPointer, LLVM::LLVMArrayType::get(i8, parts.unit),
        parts.data, ArrayRef<LLVM::GEPArg>(run.first));
  }
  scf::YieldOp::create(b, loc, together(access));
  return SmallVector<mlir::Value>(branch.getResults());
}

/// Components of the elements from the first lane's on, or gathered ones.
SmallVector<mlir::Value> ArrayLowering::loadNeighbours(LoadLanesOp op) {
  SmallVector<Leaf> leaves;
  collectLeaves(elementType(op.getArray()), 0, leaves);
  int64_t lanes = cast<VectorType>(op.getMask().getType()).getNumElements();
  auto types = llvm::map_to_vector(leaves, [&](const Leaf &leaf) {
    return mlir::Type(storedLanes(leaf.type, lanes));
  });
  return ifNeighbours(
      cast<AccessOp>(op.getOperation()), op.getMask(), op.getNonNegative(),
      types,
      [&](const LaneAccess &access) {
        return asStored(leaves, lanes, loadUnit(access, /*stride=*/1));
      },
      [&] {
        return asStored(leaves, lanes,
                        loadGathered(laneAccess(op.getArray(), op.getIndices(),
                                                op.getMask(), LaneForm::gather,
                                                op.getNonNegative())));
      });
}

/// Plain updates: lanes at consecutive elements do not conflict.
void ArrayLowering::updateNeighbours(UpdateLanesOp op) {
  ifNeighbours(
      cast<AccessOp>(op.getOperation()), op.getMask(), op.getNonNegative(), {},
      [&](const LaneAccess &access) {
        SmallVector<mlir::Value> sums;
        for (auto [leaf, before, value] :
             llvm::zip_equal(access.leaves, loadUnit(access, /*stride=*/1),
                             op.getComponents()))
          sums.push_back(
              combine(b, loc, op.getKind(), before, value, leaf.type));
        storeUnit(access, /*stride=*/1, sums);
        return SmallVector<mlir::Value>();
      },
      [&] {
        updateApart(op);
        return SmallVector<mlir::Value>();
      });
}
