//===- ConvertToLLVM.cpp - The rest goes to the LLVM dialect --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Structured control flow becomes branches, then arith, math and cf operations
// become LLVM's in one conversion. Float operations may contract to fma, as C
// compilers do; code that needs a product rounded uses `math.fma` where it
// wants one. A variant with fast math allows reassociation and reciprocals as
// well, but NaN and infinity keep their meaning.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/Conversion/ArithToLLVM/ArithToLLVM.h"
#include "mlir/Conversion/ControlFlowToLLVM/ControlFlowToLLVM.h"
#include "mlir/Conversion/LLVMCommon/TypeConverter.h"
#include "mlir/Conversion/MathToLLVM/MathToLLVM.h"
#include "mlir/Conversion/SCFToControlFlow/SCFToControlFlow.h"
#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/ControlFlow/IR/ControlFlow.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Transforms/DialectConversion.h"

namespace warp {
#define GEN_PASS_DEF_CONVERTTOLLVM
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

/// Patterns live as long as the pass; the type converter must, too.
struct Conversion {
  explicit Conversion(MLIRContext *context) : types(context) {
    RewritePatternSet structured(context);
    populateSCFToControlFlowConversionPatterns(structured);
    toBranches = std::move(structured);
    RewritePatternSet rest(context);
    arith::populateArithToLLVMConversionPatterns(types, rest);
    cf::populateControlFlowToLLVMConversionPatterns(types, rest);
    populateMathToLLVMConversionPatterns(types, rest,
                                         /*approximateLog1p=*/false);
    toLLVM = std::move(rest);
  }

  LLVMTypeConverter types;
  FrozenRewritePatternSet toBranches, toLLVM;
};

struct ConvertToLLVM : warp::impl::ConvertToLLVMBase<ConvertToLLVM> {
  LogicalResult initialize(MLIRContext *context) override {
    conversion = std::make_shared<Conversion>(context);
    return success();
  }

  void runOnOperation() override {
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    setFloatFlags(entry);

    ConversionTarget branches(getContext());
    branches.addIllegalDialect<scf::SCFDialect>();
    branches.markUnknownOpDynamicallyLegal([](Operation *) { return true; });
    if (failed(applyPartialConversion(getOperation(), branches,
                                      conversion->toBranches)))
      return signalPassFailure();

    ConversionTarget llvm(getContext());
    llvm.addLegalDialect<LLVM::LLVMDialect>();
    llvm.addIllegalDialect<arith::ArithDialect, cf::ControlFlowDialect,
                           math::MathDialect>();
    if (failed(applyPartialConversion(getOperation(), llvm,
                                      conversion->toLLVM)))
      return signalPassFailure();
  }

  void setFloatFlags(FunctionOpInterface entry) {
    auto flags = arith::FastMathFlags::contract;
    if (warp::getVariant(entry).getFastMath())
      flags = flags | arith::FastMathFlags::reassoc |
              arith::FastMathFlags::arcp | arith::FastMathFlags::afn |
              arith::FastMathFlags::nsz;
    entry.walk([&](arith::ArithFastMathInterface op) {
      // A conversion there and back rounds, whatever may contract.
      if (op->hasAttr(warp::exactAttrName) ||
          isa<arith::TruncFOp, arith::ExtFOp>(*op))
        return;
      auto own = op.getFastMathFlagsAttr();
      auto all = own ? own.getValue() | flags : flags;
      op->setAttr(op.getFastMathAttrName(),
                  arith::FastMathFlagsAttr::get(&getContext(), all));
    });
  }

  std::shared_ptr<Conversion> conversion;
};

} // namespace
