//===- LowerMath.cpp - Call the target's math library ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Elementary functions become calls that an optimiser knows nothing about but
// that they have no effects: of libdevice (`__nv_erff`) on the GPU; on the CPU
// of our device library (`warp_sinf`), which is inlined. On the GPU, sine and
// cosine of floats are ours, too. Half precision is computed in f32. Operations
// that processors do themselves (square roots, rounding, fma) are left to the
// conversion to LLVM, which has intrinsics for it.
//
// A vector holds lanes of the CPU. Our library has its functions for a few
// widths (`warp_sinf_x16`); other vectors are halved until they have one of
// these, and what is left is called lane by lane.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "LowerLibraryCalls.h"
#include "Lowerings/AngleGuard.h"
#include "WarpDialect/CallAttributes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/IR/Dominance.h"
#include "mlir/IR/TypeUtilities.h"
#include "llvm/ADT/MapVector.h"
#include "llvm/ADT/Sequence.h"
#include "llvm/ADT/StringMap.h"

namespace warp {
#define GEN_PASS_DEF_LOWERMATH
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

/// Vectors that our device library has functions for, in bits; those of less
/// than 4 floats have none (their place is not one register in C's convention).
constexpr unsigned leastVector = 128, largestVector = 512;

/// Names of functions, by operation.
const llvm::StringMap<StringRef> &functions() {
  static const llvm::StringMap<StringRef> table{
      {"math.sin", "sin"},     {"math.cos", "cos"},     {"math.tan", "tan"},
      {"math.asin", "asin"},   {"math.acos", "acos"},   {"math.atan", "atan"},
      {"math.atan2", "atan2"}, {"math.sinh", "sinh"},   {"math.cosh", "cosh"},
      {"math.tanh", "tanh"},   {"math.asinh", "asinh"}, {"math.acosh", "acosh"},
      {"math.atanh", "atanh"}, {"math.exp", "exp"},     {"math.exp2", "exp2"},
      {"math.expm1", "expm1"}, {"math.log", "log"},     {"math.log2", "log2"},
      {"math.log10", "log10"}, {"math.log1p", "log1p"}, {"math.powf", "pow"},
      {"math.cbrt", "cbrt"},   {"math.erf", "erf"},     {"math.erfc", "erfc"},
      {"math.rsqrt", "rsqrt"}, {"arith.remf", "fmod"},
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
    target = &warp::getTarget(entry);
    fastMath = warp::getVariant(entry).getFastMath();
    if (!target->getSineCosine().empty() && !fastMath)
      for (auto function : getOperation().getOps<FunctionOpInterface>())
        joinAngles(function);
    getOperation().walk([&](Operation *op) {
      if (auto power = dyn_cast<math::FPowIOp>(op))
        return lowerIntegerPower(power);
      auto found = functions().find(op->getName().getStringRef());
      if (found == functions().end())
        return;
      Type type = op->getResult(0).getType();
      if (!symbolName(found->second, type).empty())
        lower(op, found->second);
    });
    SmallVector<FunctionOpInterface> bodies;
    for (auto function : getOperation().getOps<FunctionOpInterface>())
      if (function->hasAttr(warp::attr::kept))
        bodies.push_back(function);
    bodies.push_back(entry);
    int64_t registers = 0;
    for (FunctionOpInterface function : bodies) {
      if (failed(warp::lowerLibraryCalls(getOperation(), function)))
        return signalPassFailure();
      // A thread has as many in the functions that the entry calls.
      if (auto most =
              function->getAttrOfType<IntegerAttr>(warp::attr::mostRegisters))
        registers = std::max(registers, most.getInt());
    }
    if (registers)
      entry->setAttr(warp::attr::mostRegisters,
                     Builder(&getContext()).getI64IntegerAttr(registers));
  }

  /// Sine and cosine of one float, where one is computed before the other, are
  /// one call.
  void joinAngles(FunctionOpInterface function) {
    llvm::MapVector<Value, SmallVector<Operation *>> users;
    function.walk([&](Operation *op) {
      if (isa<math::SinOp, math::CosOp>(op) &&
          op->getOperand(0).getType().isF32())
        users[withoutAngleGuard(op->getOperand(0))].push_back(op);
    });
    DominanceInfo dominance(function);
    for (auto &[angle, ops] : users)
      while (!ops.empty()) {
        Operation *first = ops.front();
        auto others = llvm::partition(ops, [&](Operation *op) {
          return dominance.dominates(first, op);
        });
        ArrayRef<Operation *> joined(ops.begin(), others);
        if (!llvm::all_of(joined, llvm::IsaPred<math::SinOp>) &&
            !llvm::all_of(joined, llvm::IsaPred<math::CosOp>))
          joinAngle(angle, first, joined);
        ops.erase(ops.begin(), others);
      }
  }

  void joinAngle(Value angle, Operation *first, ArrayRef<Operation *> ops) {
    OpBuilder b(first);
    Location loc = first->getLoc();
    auto pair = VectorType::get(2, angle.getType());
    LLVM::LLVMFuncOp callee =
        declare(target->getSineCosine(), pair, {angle.getType()});
    Value values = LLVM::CallOp::create(b, loc, callee, angle).getResult();
    Value zero = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(0));
    Value one = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
    Value sine = LLVM::ExtractElementOp::create(b, loc, values, zero);
    Value cosine = LLVM::ExtractElementOp::create(b, loc, values, one);
    for (Operation *op : ops) {
      op->getResult(0).replaceAllUsesWith(isa<math::SinOp>(op) ? sine : cosine);
      op->erase();
    }
  }

  void lower(Operation *op, StringRef function) {
    OpBuilder b(op);
    Type type = op->getResult(0).getType();
    Type computed = type;
    if (getElementTypeOrSelf(type).getIntOrFloatBitWidth() < 32)
      computed = withElement(type, b.getF32Type());
    SmallVector<Value> operands;
    for (Value guarded : op->getOperands()) {
      Value operand = withoutAngleGuard(guarded);
      operands.push_back(extend(b, operand, computed));
    }
    Value result = call(b, op->getLoc(), function, operands);
    if (computed != type)
      result = arith::TruncFOp::create(b, op->getLoc(), type, result);
    op->getResult(0).replaceAllUsesWith(result);
    op->erase();
  }

  /// x^n with an integer n is x^(double) n.
  void lowerIntegerPower(math::FPowIOp op) {
    OpBuilder b(op);
    Location loc = op.getLoc();
    Type type = op.getType(), computed = withElement(type, b.getF64Type());
    Value base = extend(b, op.getLhs(), computed);
    Value exponent = arith::SIToFPOp::create(b, loc, computed, op.getRhs());
    Value result =
        call(b, loc, functions().at("math.powf"), {base, exponent});
    if (type != computed)
      result = arith::TruncFOp::create(b, loc, type, result);
    op.replaceAllUsesWith(result);
    op->erase();
  }

  static Type withElement(Type type, Type element) {
    auto vector = dyn_cast<VectorType>(type);
    return vector ? Type(vector.clone(element)) : element;
  }

  static Value extend(OpBuilder &b, Value x, Type type) {
    if (x.getType() == type)
      return x;
    return arith::ExtFOp::create(b, x.getLoc(), type, x);
  }

  Value call(OpBuilder &b, Location loc, StringRef function,
             ArrayRef<Value> operands) {
    Type type = operands[0].getType();
    auto vector = dyn_cast<VectorType>(type);
    if (!vector || hasVersions(vector)) {
      LLVM::LLVMFuncOp callee =
          declare(symbolName(function, type), type,
                  SmallVector<Type>(operands.size(), type));
      return LLVM::CallOp::create(b, loc, callee, operands).getResult();
    }
    int64_t lanes = vector.getNumElements(), half = lanes / 2;
    bool halves = lanes % 2 == 0 &&
                  half * vector.getElementTypeBitWidth() >= leastVector;
    return halves ? callHalves(b, loc, function, operands, half)
                  : callLanes(b, loc, function, operands, lanes);
  }

  Value callHalves(OpBuilder &b, Location loc, StringRef function,
                   ArrayRef<Value> operands, int32_t half) {
    auto lower = llvm::to_vector(llvm::seq<int32_t>(0, half));
    auto upper = llvm::to_vector(llvm::seq<int32_t>(half, 2 * half));
    auto part = [&](ArrayRef<int32_t> lanes) {
      SmallVector<Value> parts;
      for (Value x : operands)
        parts.push_back(LLVM::ShuffleVectorOp::create(b, loc, x, x, lanes));
      return call(b, loc, function, parts);
    };
    Value first = part(lower), second = part(upper);
    auto all = llvm::to_vector(llvm::seq<int32_t>(0, 2 * half));
    return LLVM::ShuffleVectorOp::create(b, loc, first, second, all);
  }

  Value callLanes(OpBuilder &b, Location loc, StringRef function,
                  ArrayRef<Value> operands, int64_t lanes) {
    Value result = LLVM::PoisonOp::create(b, loc, operands[0].getType());
    for (int64_t lane = 0; lane < lanes; ++lane) {
      Value at = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(lane));
      SmallVector<Value> scalars;
      for (Value x : operands)
        scalars.push_back(LLVM::ExtractElementOp::create(b, loc, x, at));
      Value y = call(b, loc, function, scalars);
      result = LLVM::InsertElementOp::create(b, loc, result, y, at);
    }
    return result;
  }

  /// True if our device library has functions for a vector as a whole.
  static bool hasVersions(VectorType type) {
    int64_t bits = type.getNumElements() * type.getElementTypeBitWidth();
    return llvm::isPowerOf2_64(bits) && bits >= leastVector &&
           bits <= largestVector;
  }

  /// Half precision is computed in f32.
  std::string symbolName(StringRef function, Type type) const {
    bool isSingle = !getElementTypeOrSelf(type).isF64();
    std::string name = target->getMathFunction(function, isSingle, fastMath);
    if (auto vector = dyn_cast<VectorType>(type); vector && !name.empty())
      name += "_x" + std::to_string(vector.getNumElements());
    return name;
  }

  /// A function of floats without effects.
  LLVM::LLVMFuncOp declare(StringRef name, Type result,
                           ArrayRef<Type> arguments) {
    ModuleOp module = getOperation();
    if (auto found = module.lookupSymbol<LLVM::LLVMFuncOp>(name))
      return found;
    OpBuilder b = OpBuilder::atBlockBegin(module.getBody());
    auto function = LLVM::LLVMFuncOp::create(
        b, module.getLoc(), name,
        LLVM::LLVMFunctionType::get(result, arguments));
    auto none = LLVM::ModRefInfo::NoModRef;
    function.setMemoryEffectsAttr(LLVM::MemoryEffectsAttr::get(
        &getContext(), {none, none, none, none, none, none}));
    function.setNoUnwind(true);
    function.setWillReturn(true);
    return function;
  }

  const warp::TargetInfo *target = nullptr;
  bool fastMath = false;
};

} // namespace
