//===- ExpandBuiltins.cpp - Expansion of builtins without a rule ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A builtin whose record has no formula for its overload is replaced by what
// its lowering makes of it: the scalars are extracted, the lowering runs as it
// does in warp-lower-composites, and its arith and math operations become the
// builtins that they lower from. So a derivative is the derivative of the very
// computation that the primal does, with the branches that it takes, and few
// builtins need formulas.
//
// Lengths of vectors stay builtins: how they avoid overflow is in bits of
// floats, which have no derivative, and theirs is known.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/Rules/Rules.h"
#include "Composites/UnrollLocals.h"

#include "Lowerings/Lowerings.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/ADT/StringSwitch.h"

namespace warp {
#define GEN_PASS_DEF_EXPANDBUILTINS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::lowering::Emitter;
using warp::lowering::Parts;
using warp::lowering::Scalar;
using warp::lowering::Scalars;

//===----------------------------------------------------------------------===//
// Operations of thread IR as builtins
//===----------------------------------------------------------------------===//

/// Bits of floats, which thread IR has without a sign.
static mlir::Type withSign(mlir::Type type) {
  if (type.isSignlessInteger() && !type.isInteger(1))
    return IntegerType::get(type.getContext(), type.getIntOrFloatBitWidth(),
                            IntegerType::Unsigned);
  return type;
}

static StringRef getComparison(Operation *op) {
  if (auto compare = dyn_cast<arith::CmpFOp>(op))
    return llvm::StringSwitch<StringRef>(
               arith::stringifyCmpFPredicate(compare.getPredicate()))
        .Case("olt", "lt")
        .Case("ole", "le")
        .Case("ogt", "gt")
        .Case("oge", "ge")
        .Case("oeq", "eq")
        .Case("une", "ne")
        .Default("");
  return llvm::StringSwitch<StringRef>(
             arith::stringifyCmpIPredicate(
                 cast<arith::CmpIOp>(op).getPredicate()))
      .Case("ult", "lt")
      .Case("ule", "le")
      .Case("ugt", "gt")
      .Case("uge", "ge")
      .Case("eq", "eq")
      .Case("ne", "ne")
      .Default("");
}

/// The Python name of the builtin that an operation is; empty if none is.
static StringRef getBuiltinName(Operation *op) {
  if (isa<arith::CmpFOp, arith::CmpIOp>(op))
    return getComparison(op);
  StringRef name = op->getName().getStringRef();
  StringRef known = llvm::StringSwitch<StringRef>(name)
                        .Cases({"arith.addf", "arith.addi"}, "add")
                        .Cases({"arith.subf", "arith.subi"}, "sub")
                        .Cases({"arith.mulf", "arith.muli"}, "mul")
                        .Cases({"arith.divf", "arith.divui"}, "div")
                        .Cases({"arith.remf", "arith.remui"}, "mod")
                        .Case("arith.negf", "neg")
                        .Cases({"arith.maxnumf", "arith.maxui"}, "max")
                        .Cases({"arith.minnumf", "arith.minui"}, "min")
                        .Case("arith.andi", "bit_and")
                        .Case("arith.ori", "bit_or")
                        .Case("arith.xori", "bit_xor")
                        .Case("arith.shli", "lshift")
                        .Case("arith.shrui", "rshift")
                        .Case("arith.select", "where")
                        .Case("math.absf", "abs")
                        .Case("math.powf", "pow")
                        .Case("math.roundeven", "rint")
                        .Default("");
  if (known.empty() && name.consume_front("math."))
    return name;
  return known;
}

namespace {

/// Turns the operations that a lowering made into builtins.
class BuiltinsFromArith {
public:
  LogicalResult convert(ArrayRef<Operation *> ops) {
    for (Operation *op : ops)
      if (failed(convert(op)))
        return failure();
    return success();
  }

private:
  LogicalResult convert(Operation *op) {
    Dialect *dialect = op->getDialect();
    if (isa<warp::WarpDialect, scf::SCFDialect>(dialect))
      return success();
    OpBuilder b(op);
    SmallVector<Value, 3> operands;
    for (Value operand : op->getOperands())
      operands.push_back(getOperand(b, operand));
    Value result = create(b, op, operands);
    if (!result)
      return op->emitError("'")
             << op->getName() << "' has no form that can be differentiated";
    op->getResult(0).replaceAllUsesWith(result);
    op->erase();
    return success();
  }

  /// Null if there is no such builtin.
  static Value create(OpBuilder &b, Operation *op, ArrayRef<Value> operands) {
    if (!isa<arith::ArithDialect, math::MathDialect>(op->getDialect()))
      return nullptr;
    Location loc = op->getLoc();
    Type type = withSign(op->getResult(0).getType());
    if (isa<arith::BitcastOp>(op))
      return warp::BitcastOp::create(b, loc, type, operands[0]);
    if (isa<arith::ExtFOp, arith::TruncFOp, arith::UIToFPOp, arith::ExtUIOp,
            arith::TruncIOp>(op))
      return warp::CastOp::create(b, loc, type, operands[0]);
    auto call = [&](StringRef name, ArrayRef<Value> args) -> Value {
      const warp::BuiltinSpec *spec = warp::lookupBuiltin(name);
      if (!spec)
        return nullptr;
      return warp::createBuiltin(b, loc, *spec, args)->getResult(0);
    };
    if (isa<math::FmaOp>(op))
      return call("add", {call("mul", operands.take_front(2)), operands[2]});
    StringRef name = getBuiltinName(op);
    return name.empty() ? nullptr : call(name, operands);
  }

  /// Constants are of thread IR still.
  Value getOperand(OpBuilder &b, Value operand) {
    auto constant = operand.getDefiningOp<arith::ConstantOp>();
    if (!constant)
      return operand;
    TypedAttr value = constant.getValue();
    if (auto integer = dyn_cast<IntegerAttr>(value))
      value =
          IntegerAttr::get(withSign(integer.getType()), integer.getValue());
    return warp::ConstantOp::create(b, operand.getLoc(), value);
  }
};

/// Collects the operations that a builder makes.
struct Recorder : OpBuilder::Listener {
  void notifyOperationInserted(Operation *op,
                               OpBuilder::InsertPoint previous) override {
    if (!previous.isSet())
      ops.push_back(op);
  }
  SmallVector<Operation *> ops;
};

//===----------------------------------------------------------------------===//
// The pass
//===----------------------------------------------------------------------===//

class Expansion {
public:
  explicit Expansion(func::FuncOp function)
      : emitter(function.getContext(), &function.getBody().front()) {
    emitter.keep = [this](StringRef name, ArrayRef<Scalar> vector) {
      return keep(name, vector);
    };
  }

  LogicalResult expand(Operation *op) {
    auto function =
        warp::lowering::lookupLowering(op->getName().getStringRef());
    if (!function)
      return op->emitOpError("has no lowering to scalars");
    emitter.moveTo(op);
    SmallVector<Scalars, 4> scalars;
    for (Value operand : op->getOperands())
      scalars.push_back(takeApart(operand));
    SmallVector<Parts, 4> operands;
    for (auto [value, parts] : llvm::zip_equal(op->getOperands(), scalars))
      operands.push_back({value.getType(), parts});

    Recorder recorder;
    emitter.builder.setListener(&recorder);
    Scalars results = function(emitter, operands);
    emitter.builder.setListener(nullptr);

    ArrayRef<Scalar> rest = results;
    SmallVector<Value> values;
    for (Type type : op->getResultTypes()) {
      size_t count = warp::getComponentCount(type);
      values.push_back(putTogether(rest.take_front(count), type));
      rest = rest.drop_front(count);
    }
    op->replaceAllUsesWith(values);
    op->erase();
    return BuiltinsFromArith().convert(recorder.ops);
  }

private:
  Scalars takeApart(Value value) {
    value = warp::autodiff::widen(emitter.builder, emitter.loc, value);
    Type type = value.getType();
    if (!warp::isComposite(type))
      return {{&emitter, value, type}};
    Scalars scalars;
    Type scalar = warp::getElementScalar(type);
    auto matrix = dyn_cast<warp::MatType>(type);
    for (int64_t i = 0, n = warp::getComponentCount(type); i < n; ++i) {
      SmallVector<Value, 2> indices;
      if (matrix)
        indices = {index(i / matrix.getCols()), index(i % matrix.getCols())};
      else
        indices = {index(i)};
      scalars.push_back(
          {&emitter,
           emitter.create<warp::ExtractOp>(scalar, value, indices), scalar});
    }
    return scalars;
  }

  Value index(int64_t i) {
    Type type = emitter.builder.getIntegerType(32, true);
    return emitter.create<warp::ConstantOp>(IntegerAttr::get(type, i));
  }

  /// A value of the type that the operation had.
  Value putTogether(ArrayRef<Scalar> scalars, Type type) {
    SmallVector<Value> parts;
    for (Scalar x : scalars)
      parts.push_back(asOurs(x.value));
    Type wide = warp::isFloat(warp::getElementScalar(type))
                    ? warp::autodiff::differentialType(type)
                    : type;
    Value value = warp::isComposite(type)
                      ? emitter.create<warp::ConstructOp>(wide, parts)
                      : parts[0];
    return wide == type ? value : emitter.create<warp::CastOp>(type, value);
  }

  /// A builtin of a vector, in the midst of a lowering.
  Scalars keep(StringRef name, ArrayRef<Scalar> vector) {
    Type scalar = vector[0].type;
    auto type = warp::VecType::get(scalar.getContext(), vector.size(), scalar);
    SmallVector<Value> parts;
    for (Scalar x : vector)
      parts.push_back(asOurs(x.value));
    Value whole = emitter.create<warp::ConstructOp>(type, parts);
    Operation *op = warp::createBuiltin(emitter.builder, emitter.loc, name,
                                        ValueRange(whole));
    return takeApart(op->getResult(0));
  }

  /// Constants of thread IR become those of the warp dialect.
  Value asOurs(Value value) {
    auto constant = value.getDefiningOp<arith::ConstantOp>();
    return constant ? emitter.create<warp::ConstantOp>(constant.getValue())
                    : value;
  }

  Emitter emitter;
};

struct ExpandBuiltins : warp::impl::ExpandBuiltinsBase<ExpandBuiltins> {
  static bool shouldExpand(Operation *op) {
    return isa<warp::BuiltinOp>(op) && warp::autodiff::isDifferentiable(op) &&
           !warp::autodiff::hasRule(op) &&
           llvm::any_of(op->getResultTypes(), [](Type type) {
             return bool(warp::autodiff::differentialType(type));
           });
  }

  /// The remaining constants of a lowering.
  static void eraseConstants(Block &entry) {
    for (Operation &op : llvm::make_early_inc_range(entry))
      if (isa<arith::ConstantOp>(op) && op.use_empty())
        op.erase();
  }

  void runOnOperation() override {
    for (auto function : getOperation().getOps<func::FuncOp>()) {
      if (function.isExternal())
        continue;
      warp::unrollLocals(function, warp::UnrollFor::Any);
      Expansion expansion(function);
      // An expansion may keep builtins that need one themselves.
      for (bool changed = true; changed;) {
        SmallVector<Operation *> ops;
        function.walk([&](Operation *op) {
          if (shouldExpand(op))
            ops.push_back(op);
        });
        changed = !ops.empty();
        for (Operation *op : ops)
          if (failed(expansion.expand(op)))
            return signalPassFailure();
      }
      eraseConstants(function.getBody().front());
    }
  }
};

} // namespace
