//===- ConvertToLLVM.cpp - Conversion to the LLVM dialect -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Structured control flow becomes branches, then arith, math and cf operations
// become LLVM's in one conversion. Which products are fused with sums was
// settled before (warp-fuse-multiply-add), so nothing may contract here.
// Operations of the gpu dialect become the target's, by patterns in the same
// conversion or before it.
// A variant with fast math allows reassociation, reciprocals and more
// contraction, but NaN and infinity keep their meaning.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "Launch/GpuBlock.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/Conversion/ArithCommon/AttrToLLVMConverter.h"
#include "mlir/Conversion/ArithToLLVM/ArithToLLVM.h"
#include "mlir/Conversion/ControlFlowToLLVM/ControlFlowToLLVM.h"
#include "mlir/Conversion/GPUCommon/GPUCommonPass.h"
#include "mlir/Conversion/LLVMCommon/Pattern.h"
#include "mlir/Conversion/LLVMCommon/TypeConverter.h"
#include "mlir/Conversion/MathToLLVM/MathToLLVM.h"
#include "mlir/Conversion/MemRefToLLVM/MemRefToLLVM.h"
#include "mlir/Conversion/SCFToControlFlow/SCFToControlFlow.h"
#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/ControlFlow/IR/ControlFlow.h"
#include "mlir/Dialect/GPU/IR/GPUDialect.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/MemRef/IR/MemRef.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Transforms/DialectConversion.h"

namespace warp {
#define GEN_PASS_DEF_CONVERTTOLLVM
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

/// Ids have 32 bits, become an index of 64, and are cast to 32 again. LLVM
/// would take that as leave to compute with 64.
struct NarrowIndex : ConvertOpToLLVMPattern<arith::IndexCastOp> {
  using ConvertOpToLLVMPattern::ConvertOpToLLVMPattern;

  LogicalResult
  matchAndRewrite(arith::IndexCastOp op, OpAdaptor adaptor,
                  ConversionPatternRewriter &rewriter) const override {
    auto wide = adaptor.getIn().getDefiningOp<LLVM::SExtOp>();
    if (!wide || wide.getArg().getType() != op.getType())
      return failure();
    rewriter.replaceOp(op, wide.getArg());
    return success();
  }
};

/// The smaller or larger number by IEEE 754-2019: -0 lies below +0 and a NaN is
/// missing, whatever the order of the operands. LLVM's minnum, which MLIR would
/// take, leaves the order of zeros open. Its maximumnum is what GPUs have, but
/// LLVM 22 makes NaN of it for x86 with AVX-512 if one operand is known not to
/// be one; so CPUs get maxnum, and of equal operands all bits that both have
/// (minnum: that either has).
template <typename Op>
struct NumberLimit : ConvertOpToLLVMPattern<Op> {
  using ConvertOpToLLVMPattern<Op>::ConvertOpToLLVMPattern;
  static constexpr bool isMin = std::is_same_v<Op, arith::MinNumFOp>;

  LogicalResult
  matchAndRewrite(Op op, typename Op::Adaptor adaptor,
                  ConversionPatternRewriter &rewriter) const override {
    Location loc = op.getLoc();
    Value x = adaptor.getLhs(), y = adaptor.getRhs();
    Type type = x.getType();
    auto flags = arith::convertArithFastMathFlagsToLLVM(op.getFastmath());
    auto limit = [&](StringRef name) {
      auto call = LLVM::CallIntrinsicOp::create(
          rewriter, loc, type, rewriter.getStringAttr(name), ValueRange{x, y});
      call.setFastmathFlags(flags);
      return call.getResult(0);
    };
    if (op->template getParentOfType<gpu::GPUModuleOp>()) {
      rewriter.replaceOp(op, limit(isMin ? "llvm.minimumnum"
                                         : "llvm.maximumnum"));
      return success();
    }
    Value result = limit(isMin ? "llvm.minnum" : "llvm.maxnum");
    if (!bitEnumContainsAny(flags, LLVM::FastmathFlags::nsz)) {
      Type bits = rewriter.getIntegerType(
          getElementTypeOrSelf(type).getIntOrFloatBitWidth());
      if (auto vector = dyn_cast<VectorType>(type))
        bits = VectorType::get(vector.getShape(), bits,
                               vector.getScalableDims());
      Value a = LLVM::BitcastOp::create(rewriter, loc, bits, x);
      Value b = LLVM::BitcastOp::create(rewriter, loc, bits, y);
      Value both = isMin ? Value(LLVM::OrOp::create(rewriter, loc, a, b))
                         : Value(LLVM::AndOp::create(rewriter, loc, a, b));
      Value same = LLVM::FCmpOp::create(rewriter, loc,
                                        LLVM::FCmpPredicate::oeq, x, y);
      both = LLVM::BitcastOp::create(rewriter, loc, type, both);
      result = LLVM::SelectOp::create(rewriter, loc, same, both, result);
    }
    rewriter.replaceOp(op, result);
    return success();
  }
};

/// f32 to bf16 on CPUs in integers, to the nearest and ties to even. The
/// instruction that some have for it takes subnormal numbers for zero, and
/// others would call a function for each lane.
struct NarrowToBFloat : ConvertOpToLLVMPattern<arith::TruncFOp> {
  using ConvertOpToLLVMPattern::ConvertOpToLLVMPattern;

  LogicalResult
  matchAndRewrite(arith::TruncFOp op, OpAdaptor adaptor,
                  ConversionPatternRewriter &rewriter) const override {
    Value x = adaptor.getIn();
    if (!getElementTypeOrSelf(x).isF32() ||
        !getElementTypeOrSelf(op.getType()).isBF16() ||
        op->getParentOfType<gpu::GPUModuleOp>())
      return failure();
    Location loc = op.getLoc();
    auto like = [&](Type element) -> Type {
      auto vector = dyn_cast<VectorType>(x.getType());
      return vector ? vector.clone(element) : element;
    };
    Type word = like(rewriter.getI32Type()), half = like(rewriter.getI16Type());
    auto number = [&](int32_t value) -> Value {
      TypedAttr attribute = rewriter.getI32IntegerAttr(value);
      if (auto vector = dyn_cast<VectorType>(word))
        attribute = DenseElementsAttr::get(vector, attribute);
      return LLVM::ConstantOp::create(rewriter, loc, word, attribute);
    };
    Value bits = LLVM::BitcastOp::create(rewriter, loc, word, x);
    Value high = LLVM::LShrOp::create(rewriter, loc, bits, number(16));
    Value odd = LLVM::AndOp::create(rewriter, loc, high, number(1));
    Value up = LLVM::AddOp::create(rewriter, loc, odd, number(0x7fff));
    Value sum = LLVM::AddOp::create(rewriter, loc, bits, up);
    Value nearest = LLVM::LShrOp::create(rewriter, loc, sum, number(16));
    // A NaN stays one that is quiet.
    Value quiet = LLVM::OrOp::create(rewriter, loc, high, number(0x40));
    Value isNan =
        LLVM::FCmpOp::create(rewriter, loc, LLVM::FCmpPredicate::uno, x, x);
    Value chosen = LLVM::SelectOp::create(rewriter, loc, isNan, quiet, nearest);
    Value narrow = LLVM::TruncOp::create(rewriter, loc, half, chosen);
    rewriter.replaceOpWithNewOp<LLVM::BitcastOp>(
        op, like(rewriter.getBF16Type()), narrow);
    return success();
  }
};

/// Patterns live as long as the pass; the type converter must, too.
struct Conversion {
  Conversion(MLIRContext *context, const warp::TargetInfo &target)
      : types(context) {
    RewritePatternSet structured(context);
    populateSCFToControlFlowConversionPatterns(structured);
    toBranches = std::move(structured);
    RewritePatternSet rest(context);
    arith::populateArithToLLVMConversionPatterns(types, rest);
    rest.add<NumberLimit<arith::MinNumFOp>, NumberLimit<arith::MaxNumFOp>>(
        types, /*benefit=*/2);
    rest.add<NarrowToBFloat>(types, /*benefit=*/2);
    cf::populateControlFlowToLLVMConversionPatterns(types, rest);
    populateMathToLLVMConversionPatterns(types, rest,
                                         /*approximateLog1p=*/false);
    if (target.isSimt())
      addGpuPatterns(rest, target);
    toLLVM = std::move(rest);
  }

  void addGpuPatterns(RewritePatternSet &patterns,
                      const warp::TargetInfo &target) {
    populateGpuMemorySpaceAttributeConversions(
        types, [](gpu::AddressSpace space) -> unsigned {
          return space == gpu::AddressSpace::Workgroup ? warp::sharedSpace : 0;
        });
    target.addPatterns(types, patterns);
    patterns.add<NarrowIndex>(types, /*benefit=*/2);
    populateFinalizeMemRefToLLVMConversionPatterns(types, patterns);
  }

  LLVMTypeConverter types;
  FrozenRewritePatternSet toBranches, toLLVM;
};

struct ConvertToLLVM : warp::impl::ConvertToLLVMBase<ConvertToLLVM> {
  void getDependentDialects(DialectRegistry &registry) const override {
    ConvertToLLVMBase::getDependentDialects(registry);
    warp::registerTargetDialects(registry);
  }

  void runOnOperation() override {
    gpu::GPUFuncOp kernel = findKernel();
    FunctionOpInterface entry =
        kernel ? kernel : warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    setFloatFlags(entry);
    const warp::TargetInfo &target = warp::getTarget(entry);
    int64_t blockDim = warp::getVariant(entry).getBlockDim();
    DictionaryAttr parameterFacts = kernel ? kernel.getArgAttrDict(0) : nullptr;
    bool isInModule = bool(kernel);

    if (isInModule)
      target.prepareKernel(kernel->getParentOp());
    Conversion conversion(&getContext(), target);
    ConversionTarget branches(getContext());
    branches.addIllegalDialect<scf::SCFDialect>();
    branches.markUnknownOpDynamicallyLegal([](Operation *) { return true; });
    if (failed(applyPartialConversion(getOperation(), branches,
                                      conversion.toBranches)))
      return signalPassFailure();

    ConversionTarget llvm(getContext());
    llvm.addLegalDialect<LLVM::LLVMDialect>();
    llvm.addLegalDialect("nvvm");
    llvm.addIllegalDialect<arith::ArithDialect, cf::ControlFlowDialect,
                           gpu::GPUDialect, math::MathDialect,
                           memref::MemRefDialect>();
    llvm.addLegalOp<gpu::GPUModuleOp>();
    if (failed(applyPartialConversion(getOperation(), llvm, conversion.toLLVM)))
      return signalPassFailure();
    if (isInModule)
      takeOut(target, parameterFacts, blockDim);
  }

  /// The kernel of the only `gpu.module`; null if there is none.
  gpu::GPUFuncOp findKernel() {
    for (auto module : getOperation().getOps<gpu::GPUModuleOp>())
      for (auto kernel : module.getOps<gpu::GPUFuncOp>())
        return kernel;
    return nullptr;
  }

  /// Moves everything out of the `gpu.module`, as LLVM has one module for it
  /// all, and says of the kernel what the conversion does not know of.
  void takeOut(const warp::TargetInfo &target, DictionaryAttr parameterFacts,
               int64_t blockDim) {
    auto module = *getOperation().getOps<gpu::GPUModuleOp>().begin();
    for (auto function : module.getOps<LLVM::LLVMFuncOp>())
      if (function->hasAttr(warp::attr::entry)) {
        function.setArgAttrs(0, parameterFacts);
        target.finishKernel(function, blockDim);
      }
    Block *inside = &module.getBodyRegion().front();
    module->getBlock()->getOperations().splice(module->getIterator(),
                                               inside->getOperations());
    module.erase();
  }

  void setFloatFlags(FunctionOpInterface entry) {
    if (!warp::getVariant(entry).getFastMath())
      return;
    auto flags = arith::FastMathFlags::contract |
                 arith::FastMathFlags::reassoc | arith::FastMathFlags::arcp |
                 arith::FastMathFlags::afn | arith::FastMathFlags::nsz;
    getOperation().walk([&](arith::ArithFastMathInterface op) {
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
};

} // namespace
