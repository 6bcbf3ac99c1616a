//===- Specialize.cpp - Attach the facts of a launch ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel is compiled once per kind of launch: its rank, which arrays are
// packed, whether 32 bits index everything. Those facts enter the IR here, as
// attributes of the kernel function, and no pass after this one has options.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "KernelFunction.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"

namespace warp {
#define GEN_PASS_DEF_SPECIALIZE
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

struct Specialize : warp::impl::SpecializeBase<Specialize> {
  using SpecializeBase::SpecializeBase;

  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel || failed(checkOptions(kernel)))
      return signalPassFailure();
    attachFacts(kernel);
    getOperation().walk([&](Operation *op) {
      if (auto tid = dyn_cast<warp::TidOp>(op))
        dropDimensions(tid);
      else if (auto update = dyn_cast<warp::AccumulateOp>(op))
        expand(update);
      else if (isa<warp::AssertOp>(op) && !debug)
        op->erase();
    });
  }

  LogicalResult checkOptions(FunctionOpInterface kernel) {
    if (rank < 1 || rank > 4)
      return kernel.emitError("expects a launch of 1 to 4 dimensions, but got ")
             << rank.getValue();
    if (lanes < 0 || lanes > 64 ||
        (lanes > 0 && !llvm::isPowerOf2_64(lanes)))
      return kernel.emitError("expects 1 to 64 lanes, a power of two, or 0, "
                              "but got ")
             << lanes.getValue();
    StringRef name = target.getValue();
    StringRef arch = name;
    unsigned number;
    if (name == "cpu" || name.starts_with("cpu:") ||
        (arch.consume_front("sm_") && !arch.consumeInteger(10, number)))
      return success();
    return kernel.emitError("expects the target 'cpu' or 'sm_<number>', but "
                            "got '")
           << name << "'";
  }

  void attachFacts(FunctionOpInterface kernel) {
    Builder b(&getContext());
    kernel->setAttr(warp::attr::target, b.getStringAttr(target));
    kernel->setAttr(warp::attr::rank, b.getI64IntegerAttr(rank));
    kernel->setAttr(warp::attr::contiguous, b.getI64IntegerAttr(contiguous));
    kernel->setAttr(warp::attr::blockDim, b.getI64IntegerAttr(blockDim));
    kernel->setAttr(warp::attr::threads, b.getI64IntegerAttr(threads));
    kernel->setAttr(warp::attr::vectorBits, b.getI64IntegerAttr(vectorBits));
    if (lanes != 0)
      kernel->setAttr(warp::attr::lanes, b.getI64IntegerAttr(lanes));
    auto setFlag = [&](StringRef name, bool value) {
      if (value)
        kernel->setAttr(name, b.getUnitAttr());
    };
    setFlag(warp::attr::index32, index32);
    setFlag(warp::attr::flat, flat);
    setFlag(warp::attr::large, large);
    setFlag(warp::attr::disjoint, disjoint);
    setFlag(warp::attr::debug, debug);
    setFlag(warp::attr::fastMath, fastMath);
    setFlag(warp::attr::deterministic, deterministic);
    setFlag(warp::attr::ordered, ordered);
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
      index.replaceAllUsesWith(
          warp::ConstantOp::create(b, tid.getLoc(), zero));
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
};

} // namespace
