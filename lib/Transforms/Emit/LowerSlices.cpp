//===- LowerSlices.cpp - Parts of arrays along a dimension ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A slice is the array with another first element, extent and stride. Bounds
// mean what they mean in Python: below zero they count from the end, and then
// they are clamped, to where the step leads from and to. Only a step that is no
// positive constant pays for the choice of its direction.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using namespace warp;

mlir::Value ArrayLowering::clampBound(mlir::Value bound, mlir::Value low,
                                      mlir::Value high, mlir::Value extent) {
  bound = wrapIndex(widen(bound, i64), extent);
  bound = arith::MaxSIOp::create(b, loc, bound, low);
  return arith::MinSIOp::create(b, loc, bound, high);
}

/// The first index and the number of indices of a slice whose step is positive:
/// ceil((stop - start) / step), at least 0.
std::pair<mlir::Value, mlir::Value>
ArrayLowering::selectedForwards(SliceOp op, mlir::Value extent) {
  mlir::Value zero = constant(i64, 0);
  mlir::Value one = constant(i64, 1);
  mlir::Value start = clampBound(op.getStart(), zero, extent, extent);
  mlir::Value stop = clampBound(op.getStop(), zero, extent, extent);
  mlir::Value step = widen(op.getStep(), i64);
  mlir::Value span = arith::SubIOp::create(b, loc, stop, start);
  span = arith::MaxSIOp::create(b, loc, span, zero);
  mlir::Value below = arith::SubIOp::create(b, loc, step, one);
  span = arith::AddIOp::create(b, loc, span, below);
  return {start, arith::DivUIOp::create(b, loc, span, step)};
}

/// The same for any step; backwards, a bound is one less at both ends, and a
/// step of 0 selects nothing.
std::pair<mlir::Value, mlir::Value>
ArrayLowering::selected(SliceOp op, mlir::Value extent) {
  mlir::Value zero = constant(i64, 0);
  mlir::Value one = constant(i64, 1);
  mlir::Value step = widen(op.getStep(), i64);
  mlir::Value backwards = arith::CmpIOp::create(
      b, loc, arith::CmpIPredicate::slt, step, zero);
  auto choose = [&](mlir::Value behind, mlir::Value ahead) -> mlir::Value {
    return arith::SelectOp::create(b, loc, backwards, behind, ahead);
  };
  mlir::Value low = choose(constant(i64, -1), zero);
  mlir::Value high = arith::AddIOp::create(b, loc, extent, low);
  mlir::Value start = clampBound(op.getStart(), low, high, extent);
  mlir::Value stop = clampBound(op.getStop(), low, high, extent);
  mlir::Value span = arith::SubIOp::create(b, loc, choose(start, stop),
                                           choose(stop, start));
  span = arith::MaxSIOp::create(b, loc, span, zero);
  mlir::Value back = arith::SubIOp::create(b, loc, zero, step);
  mlir::Value size = arith::MaxSIOp::create(b, loc, choose(back, step), one);
  mlir::Value below = arith::SubIOp::create(b, loc, size, one);
  span = arith::AddIOp::create(b, loc, span, below);
  mlir::Value length = arith::DivUIOp::create(b, loc, span, size);
  mlir::Value stays =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, step, zero);
  return {start, arith::SelectOp::create(b, loc, stays, zero, length)};
}

void ArrayLowering::lowerSlice(SliceOp op) {
  ArrayParts parts = getParts(op.getArray());
  int64_t dim = op.getDim(), rank = parts.shape.size();
  SmallVector<mlir::Value, 4> strides;
  for (int64_t d = 0; d < rank; ++d)
    strides.push_back(stride(parts, d));
  mlir::Value extent = widen(parts.shape[dim], i64);
  APInt step;
  bool forwards = matchPattern(op.getStep(), m_ConstantInt(&step)) &&
                  step.isStrictlyPositive();
  auto [start, length] =
      forwards ? selectedForwards(op, extent) : selected(op, extent);

  parts.shape[dim] = widen(length, i32);
  parts.data = advance(parts.data,
                       arith::MulIOp::create(b, loc, start, strides[dim]));
  strides[dim] = arith::MulIOp::create(
      b, loc, widen(op.getStep(), i64), strides[dim]);
  parts.strides = strides;
  parts.unit = 0;
  known[op] = parts;
}

/// All elements of the others dimensions at one index; none if that is out of
/// bounds, which a debugging launch reports.
void ArrayLowering::lowerIndexDim(IndexDimOp op) {
  ArrayParts parts = getParts(op.getArray());
  int64_t dim = op.getDim(), rank = parts.shape.size();
  SmallVector<mlir::Value, 4> strides;
  for (int64_t d = 0; d < rank; ++d)
    strides.push_back(stride(parts, d));
  Address at;
  at.indices.push_back(wrapIndex(op.getIndex(), parts.shape[dim]));
  if (debug) {
    mlir::Value index = at.indices.front();
    at.inside = arith::CmpIOp::create(
        b, loc, arith::CmpIPredicate::ult, index,
        widen(parts.shape[dim], index.getType()));
    auto check = scf::IfOp::create(b, loc, at.inside, /*withElseRegion=*/true);
    OpBuilder::InsertionGuard insertion(b);
    b.setInsertionPointToStart(check.elseBlock());
    report(op->getLoc(), CheckKind::OutOfBounds, parts.name, at.indices,
           parts.shape[dim]);
  }
  mlir::Value offset = arith::MulIOp::create(
      b, loc, wideIndex(at.indices.front()), strides[dim]);
  parts.data = advance(parts.data, offset);
  parts.shape.erase(parts.shape.begin() + dim);
  strides.erase(strides.begin() + dim);
  if (at.inside)
    for (mlir::Value &extent : parts.shape)
      extent = arith::SelectOp::create(b, loc, at.inside, extent,
                                       constant(i32, 0));
  parts.strides = strides;
  parts.unit = 0;
  known[op] = parts;
}
