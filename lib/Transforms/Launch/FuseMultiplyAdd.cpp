//===- FuseMultiplyAdd.cpp - Contraction to multiply-add ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Optimisers that may contract do so by what they see, and see other code where
// threads are lanes, items are interleaved or loops unrolled. So what rounds is
// decided here, once, and nothing contracts afterwards. Processors without the
// instruction compute the same by a function, as results must not depend on
// where they were computed.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/IR/Builders.h"

namespace warp {
#define GEN_PASS_DEF_FUSEMULTIPLYADD
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// The product that a sum may take over: it has no other use, and is computed
/// as often.
static arith::MulFOp getProduct(Value value, Operation *sum) {
  auto product = value.getDefiningOp<arith::MulFOp>();
  bool fits = product && product->hasOneUse() &&
              product->getBlock() == sum->getBlock() &&
              !product->hasAttr(warp::exactAttrName);
  return fits ? product : nullptr;
}

static void fuse(Operation *sum) {
  if (sum->hasAttr(warp::exactAttrName))
    return;
  bool isDifference = isa<arith::SubFOp>(sum);
  Value left = sum->getOperand(0), right = sum->getOperand(1);
  arith::MulFOp product = getProduct(left, sum);
  bool isLeft = bool(product);
  if (!product)
    product = getProduct(right, sum);
  if (!product)
    return;
  OpBuilder b(sum);
  Location loc = sum->getLoc();
  Value x = product.getLhs(), y = product.getRhs();
  Value rest = isLeft ? right : left;
  if (isDifference && isLeft)
    rest = arith::NegFOp::create(b, loc, rest);
  if (isDifference && !isLeft)
    x = arith::NegFOp::create(b, loc, x);
  Value fused = math::FmaOp::create(b, loc, x, y, rest);
  sum->getResult(0).replaceAllUsesWith(fused);
  sum->erase();
  product->erase();
}

namespace {

struct FuseMultiplyAdd : warp::impl::FuseMultiplyAddBase<FuseMultiplyAdd> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    bool gpu = warp::getTarget(kernel).isSimt();
    SmallVector<Operation *> sums;
    // The kernel, and functions that it calls.
    getOperation().walk([&](Operation *op) {
      if (!isa<arith::AddFOp, arith::SubFOp>(op))
        return;
      unsigned width = op->getResult(0).getType().getIntOrFloatBitWidth();
      if (gpu || width >= 32)
        sums.push_back(op);
    });
    for (Operation *sum : sums)
      fuse(sum);
  }
};

} // namespace
