//===- BlockSums.cpp - Exact sums of the threads of a block ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If all threads of a launch add to one element, each keeps its digits in
// registers, as a window of the weights around those of its first float. At the
// end the lanes of a warp add digits of the same weight by shuffles, from the
// lowest weight that one of them has to the highest, and the warps of a block
// do so in shared memory, which has a word for every weight. A word that is not
// zero then goes to the sum of the launch.
//
//===----------------------------------------------------------------------===//

#include "BlockSums.h"

#include "BlockReduce.h"
#include "Launch/GpuBlock.h"
#include "warp/ExactSums.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using arith::CmpIPredicate;

static Value constant(OpBuilder &b, Location loc, int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(value));
}

static Value element(OpBuilder &b, Location loc, Value array, Value index) {
  return LLVM::GEPOp::create(b, loc, array.getType(), b.getI64Type(), array,
                             index, LLVM::GEPNoWrapFlags::inbounds);
}

static Value slot(OpBuilder &b, Location loc, Value window, int64_t number) {
  return element(b, loc, window, constant(b, loc, number));
}

/// Combines a value of each lane; all lanes get the result.
template <typename Op>
static Value overLanes(OpBuilder &b, Location loc, Value value) {
  return warp::overLanes(b, loc, value, [&](Value x, Value y) -> Value {
    return Op::create(b, loc, x, y);
  });
}

/// A loop of the threads of the block over the words of an array.
static void forEachWord(OpBuilder &b, Location loc, Value thread, int64_t count,
                        int64_t blockDim, function_ref<void(Value)> body) {
  auto loop = scf::ForOp::create(b, loc, thread, constant(b, loc, count),
                                 constant(b, loc, blockDim));
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  body(loop.getInductionVar());
}

Value warp::makeWindow(OpBuilder &b, Location loc, unsigned width) {
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  Type type =
      LLVM::LLVMArrayType::get(b.getI64Type(), windowDigits(width) + 1);
  Value window = LLVM::AllocaOp::create(b, loc, pointer, type,
                                        constant(b, loc, 1), 8);
  LLVM::StoreOp::create(b, loc, constant(b, loc, emptyWindow), window);
  for (unsigned i = 1; i <= windowDigits(width); ++i)
    LLVM::StoreOp::create(b, loc, constant(b, loc, 0),
                          slot(b, loc, window, i));
  return window;
}

/// Adds the windows of a warp to the words of the block.
static void addLanes(OpBuilder &b, Location loc, Value window, Value words,
                     Value lane, unsigned width) {
  Type i64 = b.getI64Type();
  Value place = LLVM::LoadOp::create(b, loc, i64, window);
  Value isEmpty = arith::CmpIOp::create(
      b, loc, CmpIPredicate::eq, place, constant(b, loc, warp::emptyWindow));
  Value begin =
      arith::SubIOp::create(b, loc, place, constant(b, loc, 1));
  int64_t digits = warp::windowDigits(width);
  Value end = arith::AddIOp::create(b, loc, begin, constant(b, loc, digits));
  int64_t count = warp::countDigits(width);
  Value none = constant(b, loc, 0), all = constant(b, loc, count);
  Value low = overLanes<arith::MinSIOp>(
      b, loc, arith::SelectOp::create(b, loc, isEmpty, all, begin));
  Value high = overLanes<arith::MaxSIOp>(
      b, loc, arith::SelectOp::create(b, loc, isEmpty, none, end));
  low = arith::MaxSIOp::create(b, loc, low, none);
  high = arith::MinSIOp::create(b, loc, high, all);
  auto loop =
      scf::ForOp::create(b, loc, low, high, constant(b, loc, 1));
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  Value weight = loop.getInductionVar(), digit = none;
  Value offset = arith::SubIOp::create(b, loc, weight, begin);
  for (int64_t i = 0; i < digits; ++i) {
    Value isHere = arith::CmpIOp::create(b, loc, CmpIPredicate::eq, offset,
                                         constant(b, loc, i));
    Value own =
        LLVM::LoadOp::create(b, loc, i64, slot(b, loc, window, i + 1));
    digit = arith::SelectOp::create(b, loc, isHere, own, digit);
  }
  digit = overLanes<arith::AddIOp>(b, loc, digit);
  Value isFirst =
      arith::CmpIOp::create(b, loc, CmpIPredicate::eq, lane, none);
  auto once = scf::IfOp::create(b, loc, isFirst, /*withElseRegion=*/false);
  b.setInsertionPointToStart(once.thenBlock());
  LLVM::AtomicRMWOp::create(
      b, loc, LLVM::AtomicBinOp::add, element(b, loc, words, weight), digit,
      LLVM::AtomicOrdering::monotonic, warp::targetAt(b).getBlockScope(), 8);
}

void warp::addWindows(OpBuilder &b, Location loc, ModuleOp module,
                      SumFunctions &functions, const SumPlace &to, Value window,
                      unsigned width, int64_t blockDim) {
  int64_t count = countDigits(width);
  Type i64 = b.getI64Type();
  Value thread = arith::ExtUIOp::create(b, loc, i64, threadInBlock(b, loc));
  Value lane = arith::AndIOp::create(
      b, loc, thread, constant(b, loc, warp::subgroupSizeAt(b) - 1));
  Value words = makeShared(b, loc, module,
                           LLVM::LLVMArrayType::get(i64, count), "exact_sum");
  forEachWord(b, loc, thread, count, blockDim, [&](Value weight) {
    LLVM::StoreOp::create(b, loc, constant(b, loc, 0),
                          element(b, loc, words, weight));
  });
  synchronizeBlock(b, loc);
  addLanes(b, loc, window, words, lane, width);
  synchronizeBlock(b, loc);
  forEachWord(b, loc, thread, count, blockDim, [&](Value weight) {
    Value digit = LLVM::LoadOp::create(b, loc, i64,
                                       element(b, loc, words, weight));
    functions.addDigit(b, loc, to, weight, digit, width);
  });
}
