//===- ScratchOps.cpp - Verification of WarpScratchOps.td -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpOps.h"

#include "mlir/IR/TypeUtilities.h"

using namespace mlir;

LogicalResult
warp::ScratchType::verify(llvm::function_ref<InFlightDiagnostic()> emitError,
                          int64_t slots, mlir::Type elementType) {
  if (slots < 1 || slots > maxComponents)
    return emitError() << "(C1) expects 1 to " << maxComponents
                       << " slots, but got " << slots;
  // Lanes have a value each in a slot.
  mlir::Type value = elementType;
  if (auto lanes = dyn_cast_or_null<VectorType>(elementType))
    value = lanes.getElementType();
  if (!value || !(isThreadScalar(value) || isComposite(value)))
    return emitError() << "(C2) expects a scalar or composite as element "
                          "type, but got "
                       << elementType;
  return success();
}

/// (C1) what goes in or out has the element type. (C2) the index is an integer,
/// or with lanes one for each.
static LogicalResult verifyElement(Operation *op, warp::ScratchType scratch,
                                   StringRef what, mlir::Type actual,
                                   mlir::Type index) {
  auto value = dyn_cast<VectorType>(scratch.getElementType());
  auto perLane = dyn_cast<VectorType>(index);
  bool isInteger = isa<IntegerType, IndexType>(getElementTypeOrSelf(index));
  if (!isInteger || (perLane && (!value || value.getNumElements() !=
                                               perLane.getNumElements())))
    return op->emitOpError("(C2) slots of ")
           << scratch << " have no index of type " << index;
  if (actual == scratch.getElementType())
    return success();
  return op->emitOpError("(C1) slots of ")
         << scratch << " have type " << scratch.getElementType() << ", but "
         << what << " has type " << actual;
}

LogicalResult warp::ScratchLoadOp::verify() {
  return verifyElement(*this, cast<ScratchType>(getScratch().getType()),
                       "the result", getResult().getType(), getIndex().getType());
}

LogicalResult warp::ScratchStoreOp::verify() {
  return verifyElement(*this, cast<ScratchType>(getScratch().getType()),
                       "the value", getValue().getType(), getIndex().getType());
}
