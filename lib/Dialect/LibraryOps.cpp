//===- LibraryOps.cpp - Calls of the device library -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions.td has the records of what lib/DeviceLib defines. A star stands for
// several endings.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/WarpDialect.h"
#include "warp/NativeCode.h"

#include "mlir/IR/TypeUtilities.h"

using namespace mlir;

static constexpr warp::LibraryFunction functions[] = {
#include "WarpDialect/LibraryFunctions.inc"
    {warp::isCpu, "", "i"},
};

const warp::LibraryFunction *warp::findLibraryFunction(StringRef symbol) {
  if (symbol.consume_back(lanesSuffix)) {
    const LibraryFunction *function = findLibraryFunction(symbol);
    return function && function->shared >= 0 ? function : nullptr;
  }
  for (const LibraryFunction &function : functions)
    if (function.symbol.ends_with("*")
            ? symbol.starts_with(function.symbol.drop_back())
            : function.symbol == symbol)
      return &function;
  return nullptr;
}

bool warp::findsSlot(LibraryCallOp call) {
  const LibraryFunction *function = findLibraryFunction(call.getCallee());
  return function && function->findsSlot;
}

mlir::Type warp::getLibraryType(MLIRContext *context, char letter) {
  if (letter == 'f')
    return Float32Type::get(context);
  if (letter == 'd')
    return Float64Type::get(context);
  return letter == 'i' ? IntegerType::get(context, 32, IntegerType::Signed)
                       : IntegerType::get(context, 64, IntegerType::Unsigned);
}

/// With and without a sign, as the phases have it. A thread's memory is an
/// address. All but the first `shared` are vectors.
static bool fits(TypeRange types, StringRef letters, size_t shared) {
  if (types.size() != letters.size())
    return false;
  for (auto [i, type, letter] : llvm::enumerate(types, letters)) {
    bool isVector = isa<VectorType>(type);
    Type scalar = isVector ? getElementTypeOrSelf(type) : type;
    if (isVector != (i >= shared))
      return false;
    if (!(letter == 'l' && isa<warp::ScratchType>(scalar)) &&
        warp::getSignless(scalar) !=
            warp::getSignless(warp::getLibraryType(type.getContext(), letter)))
      return false;
  }
  return true;
}

LogicalResult warp::LibraryCallOp::verify() {
  if (getCallee().starts_with(nativeCodePrefix)) {
    auto isScalar = [](mlir::Type type) { return type.isIntOrFloat(); };
    if (getNumResults() != 0 && llvm::all_of(getOperandTypes(), isScalar) &&
        llvm::all_of(getResultTypes(), isScalar))
      return success();
    return emitOpError("(C3) native code takes and gives scalars");
  }
  const LibraryFunction *function = findLibraryFunction(getCallee());
  if (!function)
    return emitOpError("(C1) the device library has no function '")
           << getCallee() << "'";
  bool isLanes = getCallee().ends_with(lanesSuffix);
  size_t shared = isLanes ? size_t(function->shared) : SIZE_MAX;
  if (!fits(getArgs().getTypes(), function->operands, shared) ||
      !fits(getResults().getTypes(), function->results, isLanes ? 0 : shared))
    return emitOpError("(C2) '")
           << getCallee() << "' takes '" << function->operands
           << "' and gives '" << function->results << "'";
  return success();
}

void warp::LibraryCallOp::getEffects(
    SmallVectorImpl<MemoryEffects::EffectInstance> &effects) {
  if (getNumResults() != 0 && !getCallee().starts_with(nativeMemoryPrefix))
    return;
  effects.emplace_back(MemoryEffects::Read::get());
  effects.emplace_back(MemoryEffects::Write::get());
}

#define GET_OP_CLASSES
#include "WarpDialect/WarpLibraryOps.cpp.inc"
