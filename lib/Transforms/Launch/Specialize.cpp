//===- Specialize.cpp - Attach the facts of a launch ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel is compiled once per kind of launch: its rank, which arrays are
// packed, whether 32 bits index everything. Such facts enter the IR here, as
// an attribute of the kernel function unless it has that already, and no pass
// after this one has options.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "IndexChecks.h"
#include "KernelFunction.h"
#include "Variant.h"

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"

namespace warp {
#define GEN_PASS_DEF_SPECIALIZE
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

struct Specialize : warp::impl::SpecializeBase<Specialize> {
  /// The options of the pass are those of a compilation.
  LogicalResult initializeOptions(
      StringRef text,
      function_ref<LogicalResult(const Twine &)> errorHandler) override {
    areGiven |= !text.empty();
    return warp::parseOptions(text, [&](StringRef key, StringRef value) {
      return warp::setOption(options, key, value)
                 ? success()
                 : errorHandler(warp::describeBadOption(key, value));
    });
  }

  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    bool isNew = areGiven || !kernel->hasAttr(warp::attr::variant);
    if (isNew && !warp::setVariant(kernel, options))
      return signalPassFailure();
    warp::VariantAttr variant = warp::getVariant(kernel);
    rank = variant.getRank();
    if (variant.getDebug())
      warp::insertIndexChecks(getOperation());
    getOperation().walk([&](Operation *op) {
      if (auto tid = dyn_cast<warp::TidOp>(op))
        dropDimensions(tid);
      else if (auto update = dyn_cast<warp::AccumulateOp>(op))
        expand(update);
      else if (auto call = dyn_cast<warp::LibraryCallOp>(op))
        answer(call, kernel);
      else if (auto assertion = dyn_cast<warp::AssertOp>(op))
        dropUnlessChecked(assertion, variant);
      else if (isa<warp::QuatRotateOp, warp::QuatRotateInvOp>(op) &&
               variant.getDebug() && !kernel->hasAttr(warp::attr::primal))
        expectUnit(op);
    });
  }

  /// Says for which kind of target the code is, to what asks.
  static void answer(warp::LibraryCallOp call, Operation *kernel) {
    if (call.getCallee() != warp::isCpu)
      return;
    OpBuilder b(call);
    Value result = call.getResult(0);
    bool isCpu = !warp::getTarget(kernel).isSimt();
    result.replaceAllUsesWith(warp::ConstantOp::create(
        b, call.getLoc(), b.getIntegerAttr(result.getType(), isCpu)));
    call->erase();
  }

  static void dropUnlessChecked(warp::AssertOp op, warp::VariantAttr variant) {
    if (!variant.getDebug() && !op.getAlways())
      op->erase();
  }

  /// A vector that is rotated keeps its length only by a unit quaternion.
  /// Derivatives also rotate by what is none.
  void expectUnit(Operation *rotation) {
    OpBuilder b(rotation);
    Location loc = rotation->getLoc();
    for (Operation *outer = rotation->getParentOp(); outer;
         outer = outer->getParentOp())
      if (outer->getName().stripDialect().starts_with("tile"))
        return;
    Value q = rotation->getOperand(0);
    Type scalar = warp::getElementScalar(q.getType());
    auto number = [&](double value) -> Value {
      return warp::ConstantOp::create(b, loc, b.getFloatAttr(scalar, value));
    };
    auto call = [&](StringRef name, ValueRange operands) {
      return warp::createBuiltin(b, loc, name, operands)->getResult(0);
    };
    bool isNarrow = scalar.getIntOrFloatBitWidth() < 32;
    Value square = call("dot", {q, q});
    Value gap = call("abs", {call("sub", {square, number(1.0)})});
    Value isUnit = call("le", {gap, number(isNarrow ? 1e-2 : 1e-4)});
    StringRef name = rotation->getName().stripDialect();
    warp::AssertOp::create(b, loc, isUnit,
                           name.str() + " expects a quaternion of length 1, "
                                        "else it scales what it rotates");
  }

  /// Indices beyond the rank of the launch are zero.
  void dropDimensions(warp::TidOp tid) {
    unsigned kept = std::min<int64_t>(tid.getNumResults(), rank);
    if (kept == tid.getNumResults())
      return;
    OpBuilder b(tid);
    auto shorter = warp::TidOp::create(
        b, tid.getLoc(), TypeRange(tid.getResults().take_front(kept)));
    for (auto [i, index] : llvm::enumerate(tid.getResults())) {
      if (i < kept) {
        index.replaceAllUsesWith(shorter->getResult(i));
        continue;
      }
      auto zero = b.getIntegerAttr(index.getType(), 0);
      index.replaceAllUsesWith(warp::ConstantOp::create(b, tid.getLoc(), zero));
    }
    tid->erase();
  }

  /// An element that no two threads of this launch share is updated plainly.
  void expand(warp::AccumulateOp op) {
    OpBuilder b(op);
    Location loc = op.getLoc();
    Value value = op.getValue(), array = op.getArray();
    Type type = value.getType();
    if (int64_t(op.getUnique().value_or(0)) < rank) {
      warp::AtomicOp::create(b, loc, type, warp::AtomicKind::add, value, array,
                             op.getIndices());
    } else {
      auto old = warp::LoadOp::create(b, loc, type, array, op.getIndices());
      auto sum = warp::AddOp::create(b, loc, TypeRange(type),
                                     ValueRange{old.getResult(), value});
      warp::StoreOp::create(b, loc, sum->getResult(0), array, op.getIndices());
    }
    op->erase();
  }

  warp::CompileOptions options;
  bool areGiven = false;
  int64_t rank = 1;
};

} // namespace
