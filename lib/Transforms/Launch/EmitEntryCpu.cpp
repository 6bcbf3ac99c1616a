//===- EmitEntryCpu.cpp - A range of threads on the CPU -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A range is rows of the last dimension, and rows are loops. With lanes a row
// is a loop over full vectors, whose mask is a constant, and one vector more
// for the threads that are left. Stores want a constant mask (a variable one
// was three times slower in a stream), but a long body is not worth two copies:
// there the mask is always a variable. Where vectors have to begin at multiples
// of their width, there may be a vector with a mask at the beginning, too.
//
//===----------------------------------------------------------------------===//

#include "Batches.h"
#include "EntryBuilder.h"
#include "Lanes/LanePlan.h"
#include "Updates/Atomics.h"
#include "WarpDialect/LibraryOps.h"

#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;
using warp::EntryBuilder;

/// Bodies of more operations have one copy. The library is called for all
/// lanes whatever the mask.
constexpr int64_t longestTwice = 400, longestTwiceWithCalls = 80;
/// Operations that an elementary function counts, which is inlined.
constexpr int64_t costOfCall = 140;

static int64_t countOperations(Region &region) {
  int64_t count = 0;
  region.walk([&](Operation *op) {
    bool isCall = isa<math::MathDialect>(op->getDialect()) &&
                  !isa<math::AbsFOp, math::FmaOp, math::FloorOp, math::CeilOp,
                       math::CopySignOp, math::SqrtOp, math::RsqrtOp>(op);
    count += isCall ? costOfCall : 1;
  });
  return count;
}

static int64_t longestOf(Region &body) {
  WalkResult result = body.walk([](warp::LibraryCallOp op) {
    return op.getCallee().ends_with(warp::lanesSuffix) ? WalkResult::interrupt()
                                                       : WalkResult::advance();
  });
  return result.wasInterrupted() ? longestTwiceWithCalls : longestTwice;
}

EntryBuilder::Values EntryBuilder::buildCpu() {
  Value begin = entry.getArgument(1), end = entry.getArgument(2);
  if (std::optional<warp::Batches> batches =
          warp::findBatches(kernel, threads)) {
    describeBatches(*batches);
    buildBatches(*batches, begin, end);
    return {};
  }
  bool inLanes = threads.getLanes().has_value();
  // Vectors of a range that ends before it begins would be counted wrongly.
  if (inLanes && rank == 1)
    end = arith::MaxSIOp::create(b, loc, begin, end);
  Values sums = identities(inLanes);
  sums = rank == 1 ? buildRange(begin, end, {}, sums)
                   : buildRows(begin, end, sums);
  if (!inLanes)
    return sums;
  Values combined;
  for (auto [kind, type, sum] :
       llvm::zip_equal(threads.getKinds(), threads.getTypes(), sums))
    combined.push_back(warp::CombineLanesOp::create(
        b, loc, cast<VectorType>(sum.getType()).getElementType(), kind,
        cast<TypeAttr>(type).getValue(), sum));
  return combined;
}

EntryBuilder::Values EntryBuilder::buildRows(Value begin, Value end,
                                             ValueRange sums) {
  Type i64 = b.getI64Type();
  Type rowType = index32 ? b.getI32Type() : i64;
  Value any = cmp(arith::CmpIPredicate::slt, begin, end);
  auto enter = scf::IfOp::create(b, loc, TypeRange(sums), any,
                                 /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  if (!sums.empty()) {
    b.setInsertionPointToStart(enter.elseBlock());
    scf::YieldOp::create(b, loc, sums);
  }
  b.setInsertionPointToStart(enter.thenBlock());
  Value one = constant(i64, 1), zero = constant(i64, 0);
  Value width = narrow(dims[rank - 1], i64);
  auto rowOf = [&](Value linear) {
    Value divided = div(narrow(linear, rowType), narrow(width, rowType));
    return narrow(divided, i64);
  };
  Value firstRow = rowOf(begin);
  Value lastRow = rowOf(sub(end, one));
  Value firstColumn = sub(begin, mul(firstRow, width));
  Value endColumn = sub(end, mul(lastRow, width));
  auto rows =
      scf::ForOp::create(b, loc, firstRow, add(lastRow, one), one, sums);
  {
    OpBuilder::InsertionGuard inRow(b);
    b.setInsertionPointToStart(rows.getBody());
    Value number = rows.getInductionVar();
    Value isFirst = cmp(arith::CmpIPredicate::eq, number, firstRow);
    Value isLast = cmp(arith::CmpIPredicate::eq, number, lastRow);
    Value from = arith::SelectOp::create(b, loc, isFirst, firstColumn, zero);
    Value to = arith::SelectOp::create(b, loc, isLast, endColumn, width);
    Values outer = unravel(narrow(number, rowType), rank - 1);
    Values next = buildRange(from, to, outer, rows.getRegionIterArgs());
    if (!sums.empty())
      scf::YieldOp::create(b, loc, next);
  }
  if (!sums.empty())
    scf::YieldOp::create(b, loc, rows.getResults());
  return Values(enter.getResults());
}

EntryBuilder::Values EntryBuilder::buildRange(Value begin, Value end,
                                              ValueRange outer,
                                              ValueRange sums) {
  if (!threads.getLanes())
    return buildScalarLoop(begin, end, outer, sums);
  if (threads->hasAttr(warp::alignedAttr))
    return buildAlignedLanes(begin, end, outer, sums);
  if (countOperations(threads.getBody()) > longestOf(threads.getBody()))
    return buildMaskedLanes(begin, end, outer, sums);
  Value whole = arith::AndIOp::create(
      b, loc, sub(end, begin), constant(b.getI64Type(), -threads.getWidth()));
  Value last = add(begin, whole);
  Values next = buildFullLanes(begin, last, outer, sums);
  return buildLastLanes(last, end, outer, next);
}

EntryBuilder::Values
EntryBuilder::buildLoop(Value begin, Value end, Value step, ValueRange outer,
                        ValueRange sums,
                        llvm::function_ref<Values(const Values &)> take) {
  auto loop = scf::ForOp::create(b, loc, begin, end, step, sums);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  Values indices(outer);
  indices.push_back(loop.getInductionVar());
  Values next = combine(loop.getRegionIterArgs(), take(indices));
  if (!sums.empty())
    scf::YieldOp::create(b, loc, next);
  return Values(loop.getResults());
}

EntryBuilder::Values EntryBuilder::buildScalarLoop(Value begin, Value end,
                                                   ValueRange outer,
                                                   ValueRange sums) {
  Value one = constant(b.getI64Type(), 1);
  return buildLoop(begin, end, one, outer, sums,
                   [&](const Values &indices) { return takeThread(indices); });
}

/// [begin, end) is a multiple of the width.
EntryBuilder::Values EntryBuilder::buildFullLanes(Value begin, Value end,
                                                  ValueRange outer,
                                                  ValueRange sums) {
  Value width = constant(b.getI64Type(), threads.getWidth());
  return buildLoop(begin, end, width, outer, sums, [&](const Values &indices) {
    auto mask = cast<ShapedType>(threads.getLive().getType());
    Value all = arith::ConstantOp::create(
        b, loc, DenseElementsAttr::get(mask, b.getBoolAttr(true)));
    return cloneThread(indices, all);
  });
}

/// A mask of the first `count` lanes, or of all.
Value EntryBuilder::liveLanes(Value count) {
  Type i32 = b.getI32Type();
  auto lanes = VectorType::get(threads.getWidth(), i32);
  Value numbers = warp::LaneNumbersOp::create(b, loc, lanes);
  Value limit = warp::BroadcastOp::create(b, loc, lanes, narrow(count, i32));
  return cmp(arith::CmpIPredicate::slt, numbers, limit);
}

/// Fewer threads than the width.
EntryBuilder::Values EntryBuilder::buildLastLanes(Value begin, Value end,
                                                  ValueRange outer,
                                                  ValueRange sums) {
  Value any = cmp(arith::CmpIPredicate::slt, begin, end);
  return buildPart(any, begin, outer, sums,
                   [&] { return liveLanes(sub(end, begin)); });
}

EntryBuilder::Values EntryBuilder::buildMaskedLanes(Value begin, Value end,
                                                    ValueRange outer,
                                                    ValueRange sums) {
  Value width = constant(b.getI64Type(), threads.getWidth());
  return buildLoop(begin, end, width, outer, sums, [&](const Values &indices) {
    Value left = sub(end, indices.back());
    Value count = arith::MinSIOp::create(b, loc, left, width);
    return cloneThread(indices, liveLanes(count));
  });
}

/// One vector of threads if there are any, from `first` on.
EntryBuilder::Values
EntryBuilder::buildPart(Value any, Value first, ValueRange outer,
                        ValueRange sums, llvm::function_ref<Value()> findLive) {
  auto branch = scf::IfOp::create(b, loc, TypeRange(sums), any,
                                  /*withElseRegion=*/!sums.empty());
  OpBuilder::InsertionGuard guard(b);
  if (!sums.empty()) {
    b.setInsertionPointToStart(branch.elseBlock());
    scf::YieldOp::create(b, loc, sums);
  }
  b.setInsertionPointToStart(branch.thenBlock());
  Values indices(outer);
  indices.push_back(first);
  Values next = combine(sums, cloneThread(indices, findLive()));
  if (!sums.empty())
    scf::YieldOp::create(b, loc, next);
  return Values(branch.getResults());
}

/// Vectors begin at multiples of the width: what comes before the first full
/// one is the end of a vector, what comes after the last the beginning of one.
EntryBuilder::Values EntryBuilder::buildAlignedLanes(Value begin, Value end,
                                                     ValueRange outer,
                                                     ValueRange sums) {
  Type i64 = b.getI64Type();
  Value width = constant(i64, threads.getWidth());
  Value down = constant(i64, -threads.getWidth());
  Value first = arith::AndIOp::create(b, loc, begin, down);
  auto liveBetween = [&](Value from, Value to) {
    Value before = arith::XOrIOp::create(
        b, loc, liveLanes(from),
        arith::ConstantOp::create(
            b, loc,
            DenseElementsAttr::get(
                cast<ShapedType>(threads.getLive().getType()),
                b.getBoolAttr(true))));
    return both(before, liveLanes(to));
  };
  if (countOperations(threads.getBody()) > longestOf(threads.getBody()))
    return buildLoop(first, end, width, outer, sums,
                     [&](const Values &indices) {
                       Value zero = constant(i64, 0);
                       Value from = sub(begin, indices.back());
                       Value to = sub(end, indices.back());
                       from = arith::MaxSIOp::create(b, loc, from, zero);
                       to = arith::MinSIOp::create(b, loc, to, width);
                       return cloneThread(indices, liveBetween(from, to));
                     });
  Value isPart = cmp(arith::CmpIPredicate::slt, first, begin);
  Value isAny = cmp(arith::CmpIPredicate::slt, begin, end);
  Value to = arith::MinSIOp::create(b, loc, sub(end, first), width);
  Values next = buildPart(both(isPart, isAny), first, outer, sums,
                          [&] { return liveBetween(sub(begin, first), to); });
  Value from =
      arith::SelectOp::create(b, loc, isPart, add(first, width), first);
  from = arith::MinSIOp::create(b, loc, from, end);
  Value whole = arith::AndIOp::create(b, loc, sub(end, from), down);
  Value last = add(from, whole);
  next = buildFullLanes(from, last, outer, next);
  return buildLastLanes(last, end, outer, next);
}
