//===- ArrayOps.cpp - Verification of array operations --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Checks.h"
#include "WarpDialect/WarpOps.h"

using namespace mlir;

//===----------------------------------------------------------------------===//
// Shared checks
//===----------------------------------------------------------------------===//

/// (C1) as many indices as the rank.
static LogicalResult verifyRank(Operation *op, warp::ArrayType array,
                                ValueRange indices) {
  if (int64_t(indices.size()) == array.getRank())
    return success();
  return op->emitOpError("(C1) expects ")
         << array.getRank() << " indices for " << array << ", but got "
         << indices.size();
}

/// (C2) a value has the element type of the array; in thread IR, without sign.
static LogicalResult verifyElement(Operation *op, warp::ArrayType array,
                                   StringRef what, mlir::Type actual) {
  mlir::Type element = array.getElementType();
  if (actual == element || actual == warp::getSignless(element))
    return success();
  return op->emitOpError("(C2) elements of ")
         << array << " have type " << element << ", but " << what
         << " has type " << actual;
}

/// (C3) what an atomic can combine.
static LogicalResult verifyAtomic(Operation *op, warp::AtomicKind kind,
                                  mlir::Type element) {
  using warp::AtomicKind;
  mlir::Type scalar = warp::getElementScalar(element);
  if (!scalar || warp::isBool(scalar))
    return op->emitOpError("(C3) expects elements of numbers, but got ")
           << element;
  bool isBitwise = kind == AtomicKind::bit_and || kind == AtomicKind::bit_or ||
                   kind == AtomicKind::bit_xor;
  if (isBitwise && !warp::isInteger(scalar))
    return op->emitOpError("(C3) '")
           << warp::stringifyAtomicKind(kind)
           << "' expects elements of integers, but got " << element;
  return success();
}

/// (C2) components are the flattened element, signless.
static LogicalResult verifyComponents(Operation *op, warp::ArrayType array,
                                      StringRef what, TypeRange actual) {
  SmallVector<mlir::Type> expected;
  warp::flatten(array.getElementType(), expected);
  if (expected.size() != actual.size())
    return op->emitOpError("(C2) elements of ")
           << array << " have " << expected.size()
           << " components, but there are " << actual.size() << " " << what;
  for (auto [index, pair] : llvm::enumerate(llvm::zip(expected, actual))) {
    mlir::Type wanted = warp::getSignless(std::get<0>(pair));
    if (wanted != std::get<1>(pair))
      return op->emitOpError("(C2) component ")
             << index << " of " << array << " is " << wanted
             << " in thread IR, but among the " << what << " is "
             << std::get<1>(pair);
  }
  return success();
}

/// A view of `array` has this rank and element type.
static LogicalResult verifyView(Operation *op, mlir::Type actual, int64_t rank,
                                mlir::Type element) {
  auto expected = warp::ArrayType::get(op->getContext(), rank, element);
  if (actual == expected)
    return success();
  return op->emitOpError("(C2) expects a result of type ")
         << expected << ", but got " << actual;
}

static LogicalResult verifyDim(Operation *op, mlir::Type array, int64_t dim) {
  int64_t rank = cast<warp::ArrayType>(array).getRank();
  if (dim >= 0 && dim < rank)
    return success();
  return op->emitOpError("(C1) dimension ")
         << dim << " is out of range for " << array;
}

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

LogicalResult warp::LoadOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyRank(*this, array, getIndices())))
    return failure();
  return verifyElement(*this, array, "the result", getResult().getType());
}

LogicalResult warp::StoreOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyRank(*this, array, getIndices())))
    return failure();
  return verifyElement(*this, array, "the value", getValue().getType());
}

LogicalResult warp::AtomicOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyRank(*this, array, getIndices())) ||
      failed(verifyElement(*this, array, "the value", getValue().getType())) ||
      failed(verifyElement(*this, array, "the result", getOld().getType())))
    return failure();
  return verifyAtomic(*this, getKind(), array.getElementType());
}

LogicalResult warp::AtomicCasOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyRank(*this, array, getIndices())) ||
      failed(
          verifyElement(*this, array, "'expected'", getExpected().getType())) ||
      failed(verifyElement(*this, array, "the value", getValue().getType())) ||
      failed(verifyElement(*this, array, "the result", getOld().getType())))
    return failure();
  mlir::Type element = array.getElementType();
  if (isScalar(element) && !isBool(element))
    return success();
  return emitOpError("(C3) expects numbers, but got ") << element;
}

//===----------------------------------------------------------------------===//
// Gradients
//===----------------------------------------------------------------------===//

static warp::ArrayType gradientType(mlir::Value array) {
  auto type = cast<warp::ArrayType>(array.getType());
  return warp::ArrayType::get(type.getContext(), type.getRank(),
                              warp::getGradientElement(type.getElementType()));
}

void warp::GradOp::build(OpBuilder &, OperationState &state,
                         mlir::Value array) {
  state.addOperands(array);
  state.addTypes(gradientType(array));
}

LogicalResult warp::GradOp::verify() {
  ArrayType expected = gradientType(getArray());
  if (getResult().getType() == expected)
    return success();
  return emitOpError("(C1) expects a result of type ")
         << expected << ", but got " << getResult().getType();
}

LogicalResult warp::AccumulateOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyRank(*this, array, getIndices())) ||
      failed(verifyElement(*this, array, "the value", getValue().getType())))
    return failure();
  mlir::Type scalar = getElementScalar(array.getElementType());
  if (!scalar || !isFloat(scalar))
    return emitOpError("(C3) expects elements of floats, but got ")
           << array.getElementType();
  std::optional<uint64_t> unique = getUnique();
  if (unique && (*unique < 1 || *unique > 4))
    return emitOpError("(C4) expects 'unique' to be 1 to 4, but got ")
           << int64_t(*unique);
  return success();
}

//===----------------------------------------------------------------------===//
// Views
//===----------------------------------------------------------------------===//

LogicalResult warp::ViewOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  int64_t count = getIndices().size();
  if (count < 1 || count >= array.getRank())
    return emitOpError("(C1) expects at least 1 index and fewer than ")
           << array.getRank() << " for " << array << ", but got " << count;
  return verifyView(*this, getResult().getType(), array.getRank() - count,
                    array.getElementType());
}

LogicalResult warp::SliceOp::verify() {
  return verifyDim(*this, getArray().getType(), getDim());
}

LogicalResult warp::IndexDimOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyDim(*this, array, getDim())))
    return failure();
  auto result = cast<ArrayType>(getResult().getType());
  if (result.getRank() == array.getRank() - 1 &&
      result.getElementType() == array.getElementType())
    return success();
  return emitOpError("(C2) expects an array of one dimension less than ")
         << array << ", but got " << result;
}

LogicalResult warp::ComponentViewOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  mlir::Type element = array.getElementType(), part;
  if (isa<TransformType>(element) && getField()) {
    part = getFieldType(element, *getField());
    if (!part || !getIndices().empty())
      return emitOpError("(C1) a transform has the fields 'p' and 'q' and no "
                         "indices with them, but got '")
             << *getField() << "'";
  } else if (auto structure = dyn_cast<StructType>(element)) {
    if (!getField() || !getIndices().empty())
      return emitOpError("(C1) elements are structs: expects a field and no "
                         "indices");
    int64_t index = structure.getFieldIndex(*getField());
    if (index < 0)
      return emitOpError("(C1) struct '")
             << structure.getName() << "' has no field '" << *getField() << "'";
    part = structure.getFieldTypes()[index];
    if (!isArrayElement(part))
      return emitOpError("(C1) field '")
             << *getField() << "' is an array, which can't be an element";
  } else {
    if (getField())
      return emitOpError("(C1) expects indices for elements of type ")
             << element << ", but got the field '" << *getField() << "'";
    part = getIndexedType(element, getIndices().size());
    if (!part)
      return emitOpError("(C1) ")
             << getIndices().size() << " indices select no part of " << element;
  }
  return verifyView(*this, getResult().getType(), array.getRank(), part);
}

LogicalResult warp::DimOp::verify() {
  return verifyDim(*this, getArray().getType(), getDim());
}

LogicalResult warp::StrideOp::verify() {
  return verifyDim(*this, getArray().getType(), getDim());
}

void warp::ArrayAtOp::build(OpBuilder &b, OperationState &state, Type type,
                            Value address, ValueRange extents) {
  build(b, state, type, address, extents, /*grad=*/Value());
}

LogicalResult warp::ArrayAtOp::verify() {
  auto array = cast<ArrayType>(getResult().getType());
  int64_t rank = array.getRank(), given = getExtents().size();
  if (given != rank)
    return emitOpError("(C1) expects ")
           << rank << " extents for " << array << ", but got " << given;
  mlir::Type scalar = getElementScalar(array.getElementType());
  if (getGrad() && !(scalar && isFloat(scalar)))
    return emitOpError("(C2) elements of ") << array << " have no derivatives";
  return success();
}

//===----------------------------------------------------------------------===//
// Thread IR
//===----------------------------------------------------------------------===//

LogicalResult warp::LoadComponentsOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyRank(*this, array, getIndices())))
    return failure();
  return verifyComponents(*this, array, "results", getResultTypes());
}

LogicalResult warp::StoreComponentsOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyRank(*this, array, getIndices())))
    return failure();
  return verifyComponents(*this, array, "operands", getComponents().getTypes());
}

LogicalResult warp::AtomicComponentsOp::verify() {
  auto array = cast<ArrayType>(getArray().getType());
  if (failed(verifyRank(*this, array, getIndices())) ||
      failed(verifyComponents(*this, array, "operands",
                              getComponents().getTypes())) ||
      failed(verifyComponents(*this, array, "results", getResultTypes())))
    return failure();
  return verifyAtomic(*this, getKind(), array.getElementType());
}

LogicalResult warp::AddressOp::verify() {
  return verifyRank(*this, cast<ArrayType>(getArray().getType()), getIndices());
}
