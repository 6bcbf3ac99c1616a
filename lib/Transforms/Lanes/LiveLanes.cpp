//===- LiveLanes.cpp - Loop over the set bits of a mask -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Code that lanes run one after the other. Under a mask the loop goes from one
// set bit to the next: a branch for each lane would be mispredicted as often as
// lanes leave loops at different iterations.
//
//===----------------------------------------------------------------------===//

#include "LiveLanes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;

std::optional<bool> warp::getConstantMask(Value mask) {
  DenseElementsAttr known;
  if (!matchPattern(mask, m_Constant(&known)) || !known.isSplat())
    return std::nullopt;
  return known.getSplatValue<bool>();
}

bool warp::isFullMask(Value mask) {
  return getConstantMask(mask).value_or(false);
}

void warp::forLiveLanes(OpBuilder &b, Location loc, Value mask,
                        function_ref<void(Value)> body) {
  int64_t lanes = cast<VectorType>(mask.getType()).getNumElements();
  Type i64 = b.getI64Type();
  auto constant = [&](int64_t value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(value));
  };
  OpBuilder::InsertionGuard guard(b);
  if (isFullMask(mask)) {
    auto loop =
        scf::ForOp::create(b, loc, constant(0), constant(lanes), constant(1));
    b.setInsertionPointToStart(loop.getBody());
    return body(loop.getInductionVar());
  }
  Value bits = LLVM::BitcastOp::create(b, loc, b.getIntegerType(lanes), mask);
  if (lanes < 64)
    bits = arith::ExtUIOp::create(b, loc, i64, bits);
  auto isAnyLeft = [&](OpBuilder &b, Location loc, ValueRange left) {
    Value any = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, left[0],
                                      constant(0));
    scf::ConditionOp::create(b, loc, any, left);
  };
  auto runLowest = [&](OpBuilder &, Location loc, ValueRange left) {
    Value lane = LLVM::CountTrailingZerosOp::create(b, loc, i64, left[0],
                                                    /*is_zero_poison=*/true);
    body(lane);
    Value lower = arith::SubIOp::create(b, loc, left[0], constant(1));
    Value next = arith::AndIOp::create(b, loc, left[0], lower);
    scf::YieldOp::create(b, loc, next);
  };
  scf::WhileOp::create(b, loc, i64, bits, isAnyLeft, runLowest);
}
