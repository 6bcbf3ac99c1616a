//===- LowerCompositesPass.cpp - The pass warp-lower-composites -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LowerComposites.h"
#include "PlaceLocals.h"
#include "UnrollLocals.h"

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
      if (!function.isExternal()) {
        warp::unrollLocals(function, warp::UnrollFor::Long);
        warp::placeLocals(function);
      }
      if (failed(warp::lowerComposites(function)))
        return signalPassFailure();
    }
  }
};

} // namespace
