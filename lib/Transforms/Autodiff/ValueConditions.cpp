//===- ValueConditions.cpp - Assertions about values in use ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The adjoint recomputes all that the kernel computes, and what nobody needs of
// it is dropped as dead code. An assertion would stay, so it stands as an
// operation without effects between the value and its uses until then.
//
//===----------------------------------------------------------------------===//

#include "ValueConditions.h"

#include "WarpDialect/WarpOps.h"

using namespace mlir;

namespace warp::autodiff {

/// On a cast of a value and a condition to the value.
static constexpr StringLiteral expected = "warp.expected";

Value expect(OpBuilder &builder, Value condition, Value value,
             StringRef message) {
  auto marker = UnrealizedConversionCastOp::create(
      builder, value.getLoc(), TypeRange(value.getType()),
      ValueRange{value, condition});
  marker->setAttr(expected, builder.getStringAttr(message));
  return marker.getResult(0);
}

void assertConditions(func::FuncOp function) {
  SmallVector<UnrealizedConversionCastOp> markers;
  function.walk([&](UnrealizedConversionCastOp op) {
    if (op->hasAttr(expected))
      markers.push_back(op);
  });
  for (UnrealizedConversionCastOp marker : markers) {
    OpBuilder b(marker);
    AssertOp::create(b, marker.getLoc(), marker.getOperand(1),
                     marker->getAttrOfType<StringAttr>(expected),
                     /*always=*/true);
    marker.getResult(0).replaceAllUsesWith(marker.getOperand(0));
    marker.erase();
  }
}

} // namespace warp::autodiff
