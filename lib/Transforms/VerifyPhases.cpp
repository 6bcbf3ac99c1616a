//===- VerifyPhases.cpp - What may be left after each phase ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Every phase of the pipeline ends with one of these passes. A straggler is a
// bug of the phase, and is named with its place before a later pass meets it.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_VERIFYWARP
#define GEN_PASS_DEF_VERIFYTHREAD
#define GEN_PASS_DEF_VERIFYGPU
#define GEN_PASS_DEF_VERIFYLLVM
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

static InFlightDiagnostic straggler(Operation *op, StringRef phase) {
  return op->emitError("operation '")
         << op->getName() << "' is not part of phase '" << phase << "'";
}

/// Fails at the first operation that `allowed` refuses.
static LogicalResult
checkOperations(ModuleOp module, StringRef phase,
                function_ref<bool(Operation *)> allowed) {
  WalkResult result = module.walk([&](Operation *op) {
    if (op == module || allowed(op))
      return WalkResult::advance();
    straggler(op, phase);
    return WalkResult::interrupt();
  });
  return failure(result.wasInterrupted());
}

static bool isThreadType(Type type) {
  return isa<warp::ArrayType, warp::ScratchType, IndexType>(type) ||
         warp::isFloat(type) || type.isSignlessInteger();
}

namespace {

struct VerifyWarp : warp::impl::VerifyWarpBase<VerifyWarp> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    if (kernel.getNumResults() != 0) {
      kernel.emitError("expects a kernel without results, but got ")
          << kernel.getNumResults();
      return signalPassFailure();
    }
    auto call = getOperation().walk([](func::CallOp call) {
      call.emitError("the call of '")
          << call.getCallee()
          << "' cannot be inlined; functions cannot call themselves";
      return WalkResult::interrupt();
    });
    if (call.wasInterrupted())
      return signalPassFailure();
    if (failed(checkOperations(getOperation(), "warp", [](Operation *op) {
          // Canonicalised control flow leaves a select, or logic on a condition;
          // adjoint loops count in arith.
          return isa<warp::WarpDialect, scf::SCFDialect, func::FuncDialect,
                     arith::ArithDialect>(op->getDialect());
        })))
      signalPassFailure();
  }
};

struct VerifyThread : warp::impl::VerifyThreadBase<VerifyThread> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    auto allowed = [](Operation *op) {
      Dialect *dialect = op->getDialect();
      if (isa_and_nonnull<warp::WarpDialect>(dialect))
        return op->hasTrait<warp::ThreadPhase>();
      // Conversions that saturate have no form in arith.
      if (isa<LLVM::CallIntrinsicOp>(op))
        return true;
      return isa_and_nonnull<arith::ArithDialect, math::MathDialect,
                             scf::SCFDialect, func::FuncDialect>(dialect);
    };
    if (failed(checkOperations(getOperation(), "thread", allowed)) ||
        failed(checkTypes()))
      signalPassFailure();
  }

  LogicalResult checkTypes() {
    auto refuse = [](Operation *op, Type type) {
      op->emitError("type ") << type << " is not part of phase 'thread'";
      return WalkResult::interrupt();
    };
    return failure(getOperation()
                       .walk([&](Operation *op) {
                         for (Type type : op->getResultTypes())
                           if (!isThreadType(type))
                             return refuse(op, type);
                         for (Region &region : op->getRegions())
                           for (Type type : region.getArgumentTypes())
                             if (!isThreadType(type))
                               return refuse(op, type);
                         return WalkResult::advance();
                       })
                       .wasInterrupted());
  }
};

struct VerifyGpu : warp::impl::VerifyGpuBase<VerifyGpu> {
  void runOnOperation() override {
    auto allowed = [](Operation *op) {
      Dialect *dialect = op->getDialect();
      // Their headers cost more than names.
      if (dialect && (dialect->getNamespace() == "gpu" ||
                      dialect->getNamespace() == "memref"))
        return true;
      return isa_and_nonnull<arith::ArithDialect, LLVM::LLVMDialect,
                             math::MathDialect, scf::SCFDialect>(dialect);
    };
    if (failed(checkOperations(getOperation(), "gpu", allowed)))
      return signalPassFailure();
    for (auto function : getOperation().getOps<FunctionOpInterface>())
      if (function->hasAttr(warp::attr::entry) && warp::isGpu(function)) {
        function.emitError("expects the entry '")
            << function.getName() << "' in a 'gpu.module'";
        return signalPassFailure();
      }
  }
};

struct VerifyLLVM : warp::impl::VerifyLLVMBase<VerifyLLVM> {
  void runOnOperation() override {
    if (failed(checkOperations(getOperation(), "llvm", [](Operation *op) {
          Dialect *dialect = op->getDialect();
          return dialect && (isa<LLVM::LLVMDialect>(dialect) ||
                             dialect->getNamespace() == "nvvm");
        })))
      signalPassFailure();
  }
};

} // namespace
