//===- LiveLanes.h - Loop over the set bits of a mask -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Code that lanes run one after the other. Under a mask the loop goes from one
// set bit to the next: a branch for each lane would be mispredicted as often as
// lanes leave loops at different iterations.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LIVELANES_H
#define WARP_LIB_TRANSFORMS_LIVELANES_H

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

namespace warp {

/// True if a mask certainly has all lanes.
inline bool isFullMask(mlir::Value mask) {
  mlir::DenseElementsAttr known;
  return matchPattern(mask, mlir::m_Constant(&known)) && known.isSplat() &&
         known.getSplatValue<bool>();
}

/// A loop over the live lanes, in their order; `body` gets the number of one,
/// i64. The insertion point is behind the loop afterwards.
inline void forLiveLanes(mlir::OpBuilder &b, mlir::Location loc,
                         mlir::Value mask,
                         llvm::function_ref<void(mlir::Value)> body) {
  using namespace mlir;
  int64_t lanes = cast<VectorType>(mask.getType()).getNumElements();
  mlir::Type i64 = b.getI64Type();
  auto constant = [&](int64_t value) -> mlir::Value {
    return arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(value));
  };
  OpBuilder::InsertionGuard guard(b);
  if (isFullMask(mask)) {
    auto loop = scf::ForOp::create(b, loc, constant(0), constant(lanes),
                                   constant(1));
    b.setInsertionPointToStart(loop.getBody());
    return body(loop.getInductionVar());
  }
  mlir::Value bits =
      LLVM::BitcastOp::create(b, loc, b.getIntegerType(lanes), mask);
  if (lanes < 64)
    bits = arith::ExtUIOp::create(b, loc, i64, bits);
  auto isAnyLeft = [&](OpBuilder &b, Location loc, ValueRange left) {
    mlir::Value any = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne,
                                            left[0], constant(0));
    scf::ConditionOp::create(b, loc, any, left);
  };
  auto runLowest = [&](OpBuilder &, Location loc, ValueRange left) {
    mlir::Value lane = LLVM::CountTrailingZerosOp::create(
        b, loc, i64, left[0], /*is_zero_poison=*/true);
    body(lane);
    mlir::Value lower = arith::SubIOp::create(b, loc, left[0], constant(1));
    mlir::Value next = arith::AndIOp::create(b, loc, left[0], lower);
    scf::YieldOp::create(b, loc, next);
  };
  scf::WhileOp::create(b, loc, i64, bits, isAnyLeft, runLowest);
}

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LIVELANES_H
