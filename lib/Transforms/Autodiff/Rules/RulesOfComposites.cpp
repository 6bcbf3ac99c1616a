//===- RulesOfComposites.cpp - Derivative rules of composites -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Operations that build and decompose composites are linear in every component,
// so a tangent goes through the operation itself, and a cotangent the other
// way.
//
//===----------------------------------------------------------------------===//

#include "RulesOfComposites.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

namespace warp::autodiff {

bool isCompositeOp(Operation *op) {
  return isa<ConstructOp, ExtractOp, InsertOp, CastOp, arith::SelectOp>(op);
}

/// `value`, converted if it has other scalars.
static Value convert(RuleContext &context, Value value, Type type) {
  if (value.getType() == type)
    return value;
  return CastOp::create(context.builder, context.loc, type, value);
}

//===----------------------------------------------------------------------===//
// Components
//===----------------------------------------------------------------------===//

/// Indices of component `i`: two for a matrix.
static SmallVector<Value, 2> getIndices(RuleContext &context, Type composite,
                                        int64_t i) {
  auto index = [&](int64_t number) -> Value {
    Type type = context.builder.getIntegerType(32, true);
    return ConstantOp::create(context.builder, context.loc,
                              IntegerAttr::get(type, number));
  };
  if (auto matrix = dyn_cast<MatType>(composite))
    return {index(i / matrix.getCols()), index(i % matrix.getCols())};
  return {index(i)};
}

static Value extract(RuleContext &context, Value composite, int64_t i) {
  Type type = composite.getType();
  return ExtractOp::create(context.builder, context.loc, getElementScalar(type),
                           composite, getIndices(context, type, i));
}

/// The components from `first` as a value of `type`.
static Value slice(RuleContext &context, Value composite, int64_t first,
                   Type type) {
  if (isScalar(type))
    return extract(context, composite, first);
  SmallVector<Value> parts;
  for (int64_t i = 0, n = getComponentCount(type); i < n; ++i)
    parts.push_back(extract(context, composite, first + i));
  return ConstructOp::create(context.builder, context.loc, type, parts);
}

static Value sumComponents(RuleContext &context, Value composite) {
  Value sum = extract(context, composite, 0);
  for (int64_t i = 1, n = getComponentCount(composite.getType()); i < n; ++i)
    sum = add(context.builder, context.loc, sum,
              extract(context, composite, i));
  return sum;
}

static void pullbackConstruct(RuleContext &context, ConstructOp op,
                              Value cotangent, ArrayRef<bool> wanted,
                              MutableArrayRef<Value> adjoints) {
  if (op.getNumOperands() == 1 && isScalar(op.getOperand(0).getType())) {
    if (wanted[0])
      adjoints[0] = sumComponents(context, cotangent);
    return;
  }
  int64_t position = 0;
  for (auto [i, part] : llvm::enumerate(op.getComponents())) {
    Type type = differentialType(part.getType());
    if (wanted[i] && type)
      adjoints[i] = slice(context, cotangent, position, type);
    position += getComponentCount(part.getType());
  }
}

//===----------------------------------------------------------------------===//
// Both modes
//===----------------------------------------------------------------------===//

void pullbackComposite(RuleContext &context, Operation *op, ValueRange operands,
                       Value cotangent, ArrayRef<bool> wanted,
                       MutableArrayRef<Value> adjoints) {
  OpBuilder &b = context.builder;
  Location loc = context.loc;
  auto zeroOf = [&](unsigned i) {
    return zero(b, loc, differentialType(op->getOperand(i).getType()));
  };
  llvm::TypeSwitch<Operation *>(op)
      .Case([&](ConstructOp op) {
        pullbackConstruct(context, op, cotangent, wanted, adjoints);
      })
      .Case([&](ExtractOp op) {
        if (wanted[0])
          adjoints[0] = InsertOp::create(b, loc, cotangent, zeroOf(0),
                                         operands.drop_front(1));
      })
      .Case([&](InsertOp op) {
        ValueRange indices = operands.drop_front(2);
        if (wanted[0])
          adjoints[0] = ExtractOp::create(
              b, loc, differentialType(op.getValue().getType()), cotangent,
              indices);
        if (wanted[1])
          adjoints[1] =
              InsertOp::create(b, loc, zeroOf(0), cotangent, indices);
      })
      .Case([&](CastOp op) {
        if (Type type = differentialType(op.getSource().getType());
            type && wanted[0])
          adjoints[0] = convert(context, cotangent, type);
      })
      .Case([&](arith::SelectOp op) {
        Value none = zeroOf(1);
        auto choose = [&](Value yes, Value no) {
          return createBuiltin(b, loc, "where", {operands[0], yes, no})
              ->getResult(0);
        };
        if (wanted[1])
          adjoints[1] = choose(cotangent, none);
        if (wanted[2])
          adjoints[2] = choose(none, cotangent);
      });
}

Value pushforwardComposite(RuleContext &context, Operation *op,
                           ValueRange operands, ArrayRef<Value> tangents) {
  OpBuilder &b = context.builder;
  Location loc = context.loc;
  Type type = differentialType(op->getResult(0).getType());
  auto tangentOf = [&](unsigned i) {
    return tangents[i]
               ? tangents[i]
               : zero(b, loc, differentialType(op->getOperand(i).getType()));
  };
  return llvm::TypeSwitch<Operation *, Value>(op)
      .Case([&](ConstructOp op) {
        SmallVector<Value> parts;
        for (unsigned i = 0; i < operands.size(); ++i)
          parts.push_back(tangentOf(i));
        return ConstructOp::create(b, loc, type, parts);
      })
      .Case([&](ExtractOp op) {
        return ExtractOp::create(b, loc, type, tangents[0],
                                 operands.drop_front(1));
      })
      .Case([&](InsertOp op) {
        return InsertOp::create(b, loc, tangentOf(0), tangentOf(1),
                                operands.drop_front(2));
      })
      .Case([&](CastOp op) { return convert(context, tangents[0], type); })
      .Case([&](arith::SelectOp op) {
        return createBuiltin(b, loc, "where",
                             {operands[0], tangentOf(1), tangentOf(2)})
            ->getResult(0);
      });
}

} // namespace warp::autodiff
