//===- Table.cpp - Table of lowering rules by builtin ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The table is generated from the records of the builtins.
//
//===----------------------------------------------------------------------===//

#include "AngleGuard.h"
#include "LoweringFunctions.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "llvm/ADT/StringMap.h"

using namespace mlir;

namespace warp::lowering {

/// atan2 that no folding turns into NaN.
static Value arcTangent(Emitter &emitter, Value y, Value x) {
  Type type = x.getType();
  Value reach = emitter.create<arith::MaximumFOp>(
      emitter.create<math::AbsFOp>(y), emitter.create<math::AbsFOp>(x));
  Value isOrigin = emitter.create<arith::CmpFOp>(
      arith::CmpFPredicate::OEQ, reach, emitter.constant(type, 0).value);
  Value side = emitter.create<math::CopySignOp>(
      emitter.constant(type, 1).value, x);
  Value guard = emitter.create<arith::SelectOp>(isOrigin, side, x);
  guard.getDefiningOp()->setAttr(angleGuardName,
                                 UnitAttr::get(type.getContext()));
  return emitter.create<math::Atan2Op>(y, guard);
}

template <typename OpTy>
static Value createOp(Emitter &emitter, ValueRange in) {
  if constexpr (std::is_void_v<OpTy>) {
    llvm_unreachable("the overloads of the builtin exclude this type");
  } else if constexpr (std::is_same_v<OpTy, math::Atan2Op>) {
    return arcTangent(emitter, in[0], in[1]);
  } else {
    return emitter.create<OpTy>(in.front().getType(), in);
  }
}

/// Applies one operation to corresponding components.
template <typename FloatOp, typename SignedOp, typename UnsignedOp>
static Scalars elementwise(Emitter &emitter, Operands args) {
  size_t count = 1;
  for (const Parts &part : args)
    count = std::max(count, part.size());
  Scalars result;
  for (size_t i = 0; i < count; ++i) {
    SmallVector<Value, 3> in;
    for (const Parts &part : args)
      in.push_back(part[part.size() == 1 ? 0 : i].value);
    Scalar first = args[0][args[0].size() == 1 ? 0 : i];
    auto create = first.isFloat()      ? createOp<FloatOp>
                  : first.isUnsigned() ? createOp<UnsignedOp>
                                       : createOp<SignedOp>;
    result.push_back({&emitter, create(emitter, in), first.type});
  }
  return result;
}

LoweringFunction lookupLowering(StringRef opName) {
  static const llvm::StringMap<LoweringFunction> table = {
#define WARP_BY_FUNCTION(Name) {Name##Op::getOperationName(), lower##Name},
#define WARP_ELEMENTWISE(Op, FloatOp, SignedOp, UnsignedOp)                    \
  {Op::getOperationName(), elementwise<FloatOp, SignedOp, UnsignedOp>},
#include "WarpDialect/Lowerings.inc"
  };
  return table.lookup(opName);
}

} // namespace warp::lowering
