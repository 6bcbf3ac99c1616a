//===- Specialize.cpp - Attach the facts of a launch ----------------------===//
//
// A kernel is compiled once per kind of launch: its rank, which arrays are
// packed, whether 32 bits index everything. Those facts enter the IR here, as
// attributes of the kernel function, and no pass after this one has options.
//
//===----------------------------------------------------------------------===//

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
      else if (isa<warp::AssertOp>(op) && !debug)
        op->erase();
    });
  }

  LogicalResult checkOptions(FunctionOpInterface kernel) {
    if (rank < 1 || rank > 4)
      return kernel.emitError("expects a launch of 1 to 4 dimensions, but got ")
             << rank.getValue();
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
    auto setFlag = [&](StringRef name, bool value) {
      if (value)
        kernel->setAttr(name, b.getUnitAttr());
    };
    setFlag(warp::attr::index32, index32);
    setFlag(warp::attr::flat, flat);
    setFlag(warp::attr::large, large);
    setFlag(warp::attr::debug, debug);
    setFlag(warp::attr::fastMath, fastMath);
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
};

} // namespace
