//===- VerifyPhases.cpp - Legal operations after each phase ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Every phase of the pipeline ends with one of these passes. A straggler is a
// bug of the phase, and is named with its place before a later pass meets it.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_VERIFYWARP
#define GEN_PASS_DEF_VERIFYTHREAD
#define GEN_PASS_DEF_VERIFYLAUNCH
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

/// A value of one thread, or one per lane.
static bool isLaunchType(Type type) {
  auto lanes = dyn_cast<VectorType>(type);
  if (!lanes)
    return isThreadType(type);
  Type element = lanes.getElementType();
  return lanes.getRank() == 1 && !lanes.isScalable() &&
         (element.isIndex() || warp::isFloat(element) ||
          element.isSignlessInteger());
}

/// Fails at the first result or argument of a type that `allowed` refuses.
static LogicalResult checkTypes(ModuleOp module, StringRef phase,
                                function_ref<bool(Type)> allowed) {
  auto refuse = [&](Operation *op, Type type) {
    op->emitError("type ") << type << " is not part of phase '" << phase << "'";
    return WalkResult::interrupt();
  };
  WalkResult result = module.walk([&](Operation *op) {
    for (Type type : op->getResultTypes())
      if (!allowed(type))
        return refuse(op, type);
    for (Region &region : op->getRegions())
      for (Type type : region.getArgumentTypes())
        if (!allowed(type))
          return refuse(op, type);
    return WalkResult::advance();
  });
  return failure(result.wasInterrupted());
}

/// The operations that thread and launch IR share.
static bool isScalarCode(Operation *op) {
  // Conversions that saturate have no form in arith.
  return isa<LLVM::CallIntrinsicOp>(op) ||
         isa_and_nonnull<arith::ArithDialect, math::MathDialect,
                         scf::SCFDialect, func::FuncDialect>(op->getDialect());
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
    auto call = getOperation().walk([&](func::CallOp call) {
      auto callee = getOperation().lookupSymbol(call.getCallee());
      if (callee && callee->hasAttr(warp::attr::kept))
        return WalkResult::advance();
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
      return isScalarCode(op);
    };
    if (failed(checkOperations(getOperation(), "thread", allowed)) ||
        failed(checkTypes(getOperation(), "thread", isThreadType)))
      signalPassFailure();
  }
};

struct VerifyLaunch : warp::impl::VerifyLaunchBase<VerifyLaunch> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel ||
        failed(checkOperations(getOperation(), "launch", isAllowed)) ||
        failed(checkTypes(getOperation(), "launch", isLaunchType)) ||
        failed(checkGroup(kernel)))
      signalPassFailure();
  }

  static bool isAllowed(Operation *op) {
    if (!isa_and_nonnull<warp::WarpDialect>(op->getDialect()))
      return isScalarCode(op);
    bool ofThreads = op->hasTrait<warp::ThreadPhase>() && !isa<warp::TidOp>(op);
    // A result of lanes has a value per lane.
    bool ofLanes =
        llvm::any_of(op->getOperandTypes(), llvm::IsaPred<VectorType>) ||
        llvm::any_of(op->getResultTypes(), llvm::IsaPred<VectorType>);
    return ofThreads || ofLanes ||
           isa<warp::GroupOp, warp::ThreadsOp, warp::OnceOp, warp::YieldOp>(op);
  }

  static LogicalResult checkGroup(FunctionOpInterface kernel) {
    unsigned groups = 0;
    for (Operation &op : kernel.getFunctionBody().getOps()) {
      groups += isa<warp::GroupOp>(op);
      if (!isa<warp::GroupOp, func::ReturnOp>(op))
        return op.emitOpError("expects to stand in the 'warp.group'");
    }
    if (groups != 1)
      return kernel.emitError("expects one 'warp.group', but got ") << groups;
    WalkResult result = kernel->walk<WalkOrder::PreOrder>([](Operation *op) {
      if (isa<warp::ThreadsOp, warp::OnceOp>(op))
        return WalkResult::skip();
      if (op->hasTrait<OpTrait::HasRecursiveMemoryEffects>() ||
          isa<FunctionOpInterface>(op) ||
          op->hasTrait<OpTrait::IsTerminator>() || isMemoryEffectFree(op))
        return WalkResult::advance();
      op->emitOpError("expects to stand in 'warp.threads' or 'warp.once', as "
                      "it has effects");
      return WalkResult::interrupt();
    });
    return failure(result.wasInterrupted());
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
      if (function->hasAttr(warp::attr::entry) &&
          warp::getTarget(function).isSimt()) {
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
