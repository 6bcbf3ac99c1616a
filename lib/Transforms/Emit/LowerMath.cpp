//===- LowerMath.cpp - Call the target's math library ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Elementary functions become calls that an optimiser knows nothing about but
// that they have no effects: of libdevice (`__nv_sinf`) on the GPU; on the CPU
// of our device library (`warp_sinf`), which is inlined and vectorised, and of
// the C library where ours has no version. Half precision computes in f32.
// What processors do themselves (square roots, rounding, fma) is left to the
// conversion to LLVM, which has intrinsics for it.
//
//===----------------------------------------------------------------------===//

#include "Lowerings/AngleGuard.h"
#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "llvm/ADT/StringMap.h"

namespace warp {
#define GEN_PASS_DEF_LOWERMATH
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

/// How the libraries have a function.
enum Availability : unsigned {
  inLibm = 0,
  /// Our device library has a version for f32.
  ours = 1,
  /// libdevice has a version of less accuracy.
  fast = 2,
  /// The CPU has an instruction, or LLVM an inline expansion.
  nativeOnCpu = 4,
};

struct Function {
  StringRef name;
  unsigned availability;
};

const llvm::StringMap<Function> &functions() {
  static const llvm::StringMap<Function> table{
      {"math.sin", {"sin", ours | fast}},
      {"math.cos", {"cos", ours | fast}},
      {"math.tan", {"tan", ours | fast}},
      {"math.asin", {"asin", ours}},
      {"math.acos", {"acos", ours}},
      {"math.atan", {"atan", ours}},
      {"math.atan2", {"atan2", ours}},
      {"math.sinh", {"sinh", ours}},
      {"math.cosh", {"cosh", ours}},
      {"math.tanh", {"tanh", ours}},
      {"math.asinh", {"asinh", inLibm}},
      {"math.acosh", {"acosh", inLibm}},
      {"math.atanh", {"atanh", inLibm}},
      {"math.exp", {"exp", ours | fast}},
      {"math.exp2", {"exp2", ours}},
      {"math.expm1", {"expm1", inLibm}},
      {"math.log", {"log", ours | fast}},
      {"math.log2", {"log2", ours | fast}},
      {"math.log10", {"log10", ours | fast}},
      {"math.log1p", {"log1p", inLibm}},
      {"math.powf", {"pow", ours | fast}},
      {"math.cbrt", {"cbrt", inLibm}},
      {"math.erf", {"erf", inLibm}},
      {"math.erfc", {"erfc", inLibm}},
      {"math.rsqrt", {"rsqrt", nativeOnCpu}},
      {"arith.remf", {"fmod", nativeOnCpu}},
  };
  return table;
}

Value withoutAngleGuard(Value operand) {
  auto guard = operand.getDefiningOp<arith::SelectOp>();
  return guard && guard->hasAttr(warp::angleGuardName) ? guard.getFalseValue()
                                                       : operand;
}

struct LowerMath : warp::impl::LowerMathBase<LowerMath> {
  void runOnOperation() override {
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    gpu = warp::isGpu(entry);
    fastMath = warp::getVariant(entry).getFastMath();
    getOperation().walk([&](Operation *op) {
      if (auto power = dyn_cast<math::FPowIOp>(op))
        return lowerIntegerPower(power);
      auto found = functions().find(op->getName().getStringRef());
      if (found == functions().end())
        return;
      if (!gpu && (found->second.availability & nativeOnCpu))
        return;
      lower(op, found->second);
    });
  }

  void lower(Operation *op, const Function &function) {
    OpBuilder b(op);
    Location loc = op->getLoc();
    Type type = op->getResult(0).getType();
    Type computed = type;
    if (type.getIntOrFloatBitWidth() < 32)
      computed = b.getF32Type();
    SmallVector<Value> operands;
    for (Value guarded : op->getOperands()) {
      Value operand = withoutAngleGuard(guarded);
      operands.push_back(
          computed == type ? operand
                           : arith::ExtFOp::create(b, loc, computed, operand)
                                 .getResult());
    }
    LLVM::LLVMFuncOp callee =
        declare(symbolName(function, computed), computed, operands.size());
    Value result = LLVM::CallOp::create(b, loc, callee, operands).getResult();
    if (computed != type)
      result = arith::TruncFOp::create(b, loc, type, result);
    op->getResult(0).replaceAllUsesWith(result);
    op->erase();
  }

  /// x^n with an integer n is x^(double) n.
  void lowerIntegerPower(math::FPowIOp op) {
    OpBuilder b(op);
    Location loc = op.getLoc();
    Type f64 = b.getF64Type(), type = op.getType();
    Value base = op.getLhs();
    if (type != f64)
      base = arith::ExtFOp::create(b, loc, f64, base);
    Value exponent = arith::SIToFPOp::create(b, loc, f64, op.getRhs());
    LLVM::LLVMFuncOp callee = declare(gpu ? "__nv_pow" : "pow", f64, 2);
    Value result =
        LLVM::CallOp::create(b, loc, callee, ValueRange{base, exponent})
            .getResult();
    if (type != f64)
      result = arith::TruncFOp::create(b, loc, type, result);
    op.replaceAllUsesWith(result);
    op->erase();
  }

  std::string symbolName(const Function &function, Type type) {
    std::string name = function.name.str();
    bool single = type.isF32();
    if (gpu && fastMath && single && (function.availability & fast))
      return "__nv_fast_" + name + "f";
    if (single)
      name += "f";
    if (gpu)
      return "__nv_" + name;
    return single && (function.availability & ours) ? "warp_" + name : name;
  }

  /// A function of floats without effects.
  LLVM::LLVMFuncOp declare(StringRef name, Type type, size_t arguments) {
    ModuleOp module = getOperation();
    if (auto found = module.lookupSymbol<LLVM::LLVMFuncOp>(name))
      return found;
    OpBuilder b = OpBuilder::atBlockBegin(module.getBody());
    SmallVector<Type> types(arguments, type);
    auto function = LLVM::LLVMFuncOp::create(
        b, module.getLoc(), name, LLVM::LLVMFunctionType::get(type, types));
    auto none = LLVM::ModRefInfo::NoModRef;
    function.setMemoryEffectsAttr(LLVM::MemoryEffectsAttr::get(
        &getContext(), {none, none, none, none, none, none}));
    function.setNoUnwind(true);
    function.setWillReturn(true);
    return function;
  }

  bool gpu = false, fastMath = false;
};

} // namespace
