//===- Lowering.cpp - NVVM intrinsics, libdevice and PTX entries ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Nvidia.h"

#include "mlir/Conversion/GPUToNVVM/GPUToNVVMPass.h"
#include "mlir/Conversion/LLVMCommon/TypeConverter.h"
#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/LLVMIR/NVVMDialect.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinOps.h"
#include "mlir/Target/LLVMIR/Dialect/NVVM/NVVMToLLVMIRTranslation.h"

#include "llvm/ADT/StringSwitch.h"

using namespace mlir;
using namespace warp;

void warp::registerTargetDialects(DialectRegistry &registry) {
  registry.insert<NVVM::NVVMDialect>();
}

void warp::registerTargetTranslations(DialectRegistry &registry) {
  registerNVVMDialectTranslation(registry);
}

static Value constant(OpBuilder &b, Location loc, int32_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

static Value call(OpBuilder &b, Location loc, Type type, StringRef name,
                  ValueRange operands) {
  return LLVM::CallIntrinsicOp::create(b, loc, type, b.getStringAttr(name),
                                       operands)
      .getResult(0);
}

void NvidiaTarget::declareEntry(LLVM::LLVMFuncOp entry, int64_t bytes,
                                int64_t alignment) const {
  Builder b(entry.getContext());
  entry.setCConv(LLVM::CConv::PTX_Kernel);
  auto block = LLVM::LLVMArrayType::get(b.getI8Type(), bytes);
  entry.setArgAttr(0, "llvm.byval", TypeAttr::get(block));
  entry.setArgAttr(0, "llvm.align", b.getI64IntegerAttr(alignment));
}

//===----------------------------------------------------------------------===//
// Subgroups and blocks
//===----------------------------------------------------------------------===//

Value NvidiaTarget::emitIsFull(OpBuilder &b, Location loc) const {
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq,
                               emitActiveLanes(b, loc), constant(b, loc, -1));
}

Value NvidiaTarget::emitVoteAll(OpBuilder &b, Location loc,
                                Value condition) const {
  return call(b, loc, b.getI1Type(), "llvm.nvvm.vote.all.sync",
              {constant(b, loc, -1), condition});
}

Value NvidiaTarget::emitBallot(OpBuilder &b, Location loc,
                               Value condition) const {
  return call(b, loc, b.getI32Type(), "llvm.nvvm.vote.ballot.sync",
              {constant(b, loc, -1), condition});
}

Value NvidiaTarget::emitActiveMax(OpBuilder &b, Location loc,
                                  Value value) const {
  return call(b, loc, b.getI32Type(), "llvm.nvvm.redux.sync.umax",
              {value, emitActiveLanes(b, loc)});
}

Value NvidiaTarget::emitActiveLanes(OpBuilder &b, Location loc) const {
  return call(b, loc, b.getI32Type(), "llvm.nvvm.activemask", {});
}

Value NvidiaTarget::emitAgree(OpBuilder &b, Location loc, Value value,
                              Value lanes) const {
  Type pair = LLVM::LLVMStructType::getLiteral(b.getContext(),
                                               {b.getI32Type(), b.getI1Type()});
  Value both =
      call(b, loc, pair, "llvm.nvvm.match.all.sync.i64p", {lanes, value});
  return LLVM::ExtractValueOp::create(b, loc, both, 1);
}

void NvidiaTarget::emitSubgroupBarrier(OpBuilder &b, Location loc,
                                       Value lanes) const {
  if (!lanes)
    lanes = constant(b, loc, -1);
  LLVM::CallIntrinsicOp::create(
      b, loc, b.getStringAttr("llvm.nvvm.bar.warp.sync"), ValueRange(lanes));
}

Value NvidiaTarget::emitBlockAny(OpBuilder &b, Location loc,
                                 Value condition) const {
  return call(b, loc, b.getI1Type(), "llvm.nvvm.barrier.cta.red.or.aligned.all",
              {constant(b, loc, 0), condition});
}

//===----------------------------------------------------------------------===//
// Instructions and functions
//===----------------------------------------------------------------------===//

Value NvidiaTarget::emitRsqrt(OpBuilder &b, Location loc, Value x,
                              bool flushes) const {
  return call(
      b, loc, b.getF32Type(),
      flushes ? "llvm.nvvm.rsqrt.approx.ftz.f" : "llvm.nvvm.rsqrt.approx.f", x);
}

void NvidiaTarget::emitPairedAtomic(OpBuilder &b, Location loc, Value pointer,
                                    Value x, Value y) const {
  LLVM::InlineAsmOp::create(
      b, loc, TypeRange(), ValueRange{pointer, x, y},
      b.getStringAttr("red.global.add.v2.f32 [$0], {$1, $2};"),
      b.getStringAttr("l,f,f,~{memory}"),
      /*has_side_effects=*/b.getUnitAttr(), /*is_align_stack=*/UnitAttr(),
      LLVM::TailCallKindAttr(), LLVM::AsmDialectAttr(), ArrayAttr());
}

void NvidiaTarget::emitPrintf(OpBuilder &b, Location loc, ModuleOp module,
                              Value format, Value buffer, int64_t) const {
  auto print = module.lookupSymbol<LLVM::LLVMFuncOp>("vprintf");
  if (!print) {
    OpBuilder inModule = OpBuilder::atBlockBegin(module.getBody());
    print = LLVM::LLVMFuncOp::create(
        inModule, loc, "vprintf",
        LLVM::LLVMFunctionType::get(b.getI32Type(),
                                    {format.getType(), buffer.getType()}));
  }
  LLVM::CallOp::create(b, loc, print, ValueRange{format, buffer});
}

/// libdevice, which has less accurate versions of some; sine and cosine of
/// floats are our own.
std::string NvidiaTarget::getMathFunction(StringRef name, bool isSingle,
                                          bool fast) const {
  std::string full = (name + (isSingle ? "f" : "")).str();
  bool hasFast =
      llvm::StringSwitch<bool>(name)
          .Cases({"sin", "cos", "tan", "exp", "log", "log2", "log10", "pow"},
                 true)
          .Default(false);
  if (fast && isSingle && hasFast)
    return "__nv_fast_" + full;
  if (isSingle && (name == "sin" || name == "cos"))
    return "warp_gpu_" + full;
  return "__nv_" + full;
}

//===----------------------------------------------------------------------===//
// Conversion
//===----------------------------------------------------------------------===//

void NvidiaTarget::addPatterns(LLVMTypeConverter &types,
                               RewritePatternSet &patterns) const {
  // These would call libdevice for operations of math that warp-lower-math
  // left alone on purpose, so those of math come first.
  populateGpuToNVVMConversionPatterns(types, patterns, /*benefit=*/0);
}

void NvidiaTarget::finishKernel(LLVM::LLVMFuncOp kernel,
                                int64_t blockDim) const {
  kernel->setAttr(
      NVVM::NVVMDialect::getMaxntidAttrName(),
      DenseI32ArrayAttr::get(kernel.getContext(), int32_t(blockDim)));
}

bool NvidiaTarget::isBlockBarrier(Operation *op) const {
  auto call = dyn_cast<LLVM::CallIntrinsicOp>(op);
  return isa<NVVM::Barrier0Op, NVVM::BarrierOp>(op) ||
         (call && call.getIntrin().starts_with("llvm.nvvm.barrier"));
}
