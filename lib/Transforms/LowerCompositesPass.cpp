//===- LowerCompositesPass.cpp - The pass, and the check of its result ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LowerComposites.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {
#define GEN_PASS_DEF_LOWERCOMPOSITES
#define GEN_PASS_DEF_VERIFYTHREAD
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

struct LowerComposites : warp::impl::LowerCompositesBase<LowerComposites> {
  void runOnOperation() override {
    for (auto function : getOperation().getOps<func::FuncOp>()) {
      if (function->hasAttr(warp::kernelAttrName) &&
          !function->hasAttr(warp::attr::argTypes))
        function->setAttr(warp::attr::argTypes,
                          OpBuilder(&getContext())
                              .getTypeArrayAttr(function.getArgumentTypes()));
      if (failed(warp::lowerComposites(function)))
        return signalPassFailure();
    }
  }
};

/// Operations of the dialect that thread IR is made of.
constexpr llvm::StringLiteral threadOps[] = {
    "warp.load_components", "warp.store_components", "warp.atomic_components",
    "warp.atomic_cas",      "warp.view",             "warp.slice",
    "warp.component_view",  "warp.dim",              "warp.tid",
    "warp.printf",          "warp.assert"};

struct VerifyThread : warp::impl::VerifyThreadBase<VerifyThread> {
  void runOnOperation() override {
    auto kernels = llvm::count_if(
        getOperation().getOps<func::FuncOp>(), [](func::FuncOp function) {
          return function->hasAttr(warp::kernelAttrName);
        });
    if (kernels != 1) {
      getOperation().emitError("thread IR has one kernel function, but got ")
          << kernels;
      return signalPassFailure();
    }
    WalkResult result = getOperation().walk([](Operation *op) {
      return failed(check(op)) ? WalkResult::interrupt()
                               : WalkResult::advance();
    });
    if (result.wasInterrupted())
      signalPassFailure();
  }

  static LogicalResult check(Operation *op) {
    if (op->getName().getDialectNamespace() == "warp" &&
        !llvm::is_contained(threadOps, op->getName().getStringRef()))
      return op->emitOpError("is not an operation of thread IR");
    for (Type type : op->getOperandTypes())
      if (!isThreadType(type))
        return op->emitOpError("has an operand of type '")
               << type << "', which thread IR does not have";
    for (Type type : op->getResultTypes())
      if (!isThreadType(type))
        return op->emitOpError("has a result of type '")
               << type << "', which thread IR does not have";
    for (Region &region : op->getRegions())
      for (Block &block : region)
        for (Type type : block.getArgumentTypes())
          if (!isThreadType(type))
            return op->emitOpError("has a block argument of type '")
                   << type << "', which thread IR does not have";
    return success();
  }

  static bool isThreadType(Type type) {
    return isa<FloatType, IndexType, warp::ArrayType>(type) ||
           type.isSignlessInteger();
  }
};

} // namespace
