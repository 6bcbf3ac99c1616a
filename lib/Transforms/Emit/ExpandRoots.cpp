//===- ExpandRoots.cpp - Branch-free square roots on GPUs -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A GPU has an approximation of 1/sqrt(x), from which its assembler makes a
// correctly rounded root: by instructions where x is an ordinary number, by a
// call where it is not. Between that branch and the next nothing can be moved,
// so the copies of an unrolled loop wait for each other. These roots of floats
// have no branch:
//
//   sqrt(x)     correctly rounded for all x. With y near 1/sqrt(x), g = x y is
//               near the root, and g + (x - g g) y/2, each in one rounding, is
//               the root. Small x, for which x - g g would be lost, are scaled
//               by a power of 4; 0 and infinity are their own roots.
//   1/sqrt(x)   y + y/2 (1 - x y y), one step of Newton's method: at most 1 ulp
//               from the true value, where a quotient of two rounded operations
//               is up to 1.5 ulp from it. Where y is 0 or infinite the step
//               gives a NaN, and y is right.
//
// A root outside of loops has nothing to wait for and is left to the assembler,
// whose instructions are fewer. With fast math the approximation of
// 1/sqrt(x) is the result, and the conversion to LLVM knows a short root.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

#include <limits>

namespace warp {
#define GEN_PASS_DEF_EXPANDROOTS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// Below this x - g g may have bits under those of the least float.
constexpr float smallest = 1e-30f;
constexpr float scale = 0x1p64f, rootOfScale = 0x1p32f;

namespace {

/// Builds f32 operations.
struct FloatBuilder {
  FloatBuilder(Operation *op, const warp::TargetInfo &target)
      : b(op), loc(op->getLoc()), target(target) {}

  Value constant(float value) {
    return arith::ConstantOp::create(b, loc, b.getF32FloatAttr(value));
  }
  Value mul(Value x, Value y) { return arith::MulFOp::create(b, loc, x, y); }
  Value neg(Value x) { return arith::NegFOp::create(b, loc, x); }
  Value fma(Value x, Value y, Value z) {
    return math::FmaOp::create(b, loc, x, y, z);
  }
  Value compare(arith::CmpFPredicate predicate, Value x, Value y) {
    return arith::CmpFOp::create(b, loc, predicate, x, y);
  }
  Value select(Value condition, Value x, Value y) {
    return arith::SelectOp::create(b, loc, condition, x, y);
  }
  Value rsqrt(Value x, bool flushes) {
    return target.emitRsqrt(b, loc, x, flushes);
  }

  OpBuilder b;
  Location loc;
  const warp::TargetInfo &target;
};

} // namespace

static Value buildRoot(FloatBuilder f, Value x) {
  Value isSmall =
      f.compare(arith::CmpFPredicate::OLT, x, f.constant(smallest));
  Value scaled = f.select(isSmall, f.mul(x, f.constant(scale)), x);
  Value y = f.rsqrt(scaled, /*flushes=*/true);
  Value g = f.mul(scaled, y);
  Value rest = f.fma(f.neg(g), g, scaled);
  Value root = f.fma(rest, f.mul(y, f.constant(0.5f)), g);
  root = f.select(isSmall, f.mul(root, f.constant(1 / rootOfScale)), root);
  Value zero = f.compare(arith::CmpFPredicate::OEQ, x, f.constant(0));
  constexpr float infinity = std::numeric_limits<float>::infinity();
  Value infinite =
      f.compare(arith::CmpFPredicate::OEQ, x, f.constant(infinity));
  Value itself = arith::OrIOp::create(f.b, f.loc, zero, infinite);
  return f.select(itself, x, root);
}

static Value buildReciprocalRoot(FloatBuilder f, Value x, bool isFast) {
  if (isFast)
    return f.rsqrt(x, /*flushes=*/true);
  Value y = f.rsqrt(x, /*flushes=*/false);
  Value rest = f.fma(f.mul(x, y), f.neg(y), f.constant(1));
  Value better = f.fma(rest, f.mul(y, f.constant(0.5f)), y);
  Value isNan = f.compare(arith::CmpFPredicate::UNO, better, better);
  return f.select(isNan, y, better);
}

namespace {

struct ExpandRoots : warp::impl::ExpandRootsBase<ExpandRoots> {
  void runOnOperation() override {
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    const warp::TargetInfo *target = &warp::getTarget(entry);
    if (!target->has(warp::Feature::ReciprocalRoot))
      return;
    bool isFast = warp::getVariant(entry).getFastMath();
    SmallVector<arith::DivFOp> quotients;
    SmallVector<math::SqrtOp> roots;
    getOperation().walk([&](Operation *op) {
      if (auto root = dyn_cast<math::SqrtOp>(op);
          root && root.getType().isF32())
        roots.push_back(root);
      auto quotient = dyn_cast<arith::DivFOp>(op);
      if (quotient && quotient.getType().isF32() &&
          matchPattern(quotient.getLhs(), m_OneFloat()) &&
          quotient.getRhs().getDefiningOp<math::SqrtOp>())
        quotients.push_back(quotient);
    });
    for (arith::DivFOp quotient : quotients) {
      auto root = quotient.getRhs().getDefiningOp<math::SqrtOp>();
      replace(quotient, buildReciprocalRoot(FloatBuilder(quotient, *target),
                                            root.getOperand(), isFast));
    }
    for (math::SqrtOp root : roots)
      if (root->use_empty())
        root.erase();
      else if (!isFast && root->getParentOfType<LoopLikeOpInterface>())
        replace(root,
                buildRoot(FloatBuilder(root, *target), root.getOperand()));
  }

  void replace(Operation *op, Value value) {
    op->getResult(0).replaceAllUsesWith(value);
    op->erase();
  }
};

} // namespace
