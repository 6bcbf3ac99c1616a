//===- LaunchOps.cpp - Verifiers of phase `launch` ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/LaneOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/BuiltinTypes.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;

LogicalResult warp::ParameterOp::verify() {
  // (C1)
  if (static_cast<int64_t>(getOffset()) < 0)
    return emitOpError("expects an offset of 0 or more, but got ")
           << static_cast<int64_t>(getOffset());
  // (C2)
  if (getPacked() && !isa<warp::ArrayType>(getResult().getType()))
    return emitOpError("expects an array to be packed, but got ")
           << getResult().getType();
  return success();
}

//===----------------------------------------------------------------------===//
// Regions
//===----------------------------------------------------------------------===//

LogicalResult warp::GroupOp::verify() {
  Operation *parent = (*this)->getParentOp();
  if (!isa<FunctionOpInterface>(parent))
    return emitOpError("(C1) expects to stand in a function");
  auto threads = getBody().front().getOps<ThreadsOp>();
  if (std::distance(threads.begin(), threads.end()) != 1)
    return emitOpError("(C2) expects one 'warp.threads'");
  return success();
}

LogicalResult warp::ThreadsOp::verify() {
  unsigned rank = getIndices().size();
  if (rank > 4)
    return emitOpError("(C1) expects at most 4 indices, but got ") << rank;
  for (BlockArgument index : getIndices())
    if (!index.getType().isInteger(32))
      return emitOpError("(C1) expects indices of type i32, but got ")
             << index.getType();
  if (getLanes()) {
    auto mask = dyn_cast<VectorType>(getLive().getType());
    if (!mask || !mask.getElementType().isInteger(1) ||
        mask.getNumElements() != getWidth())
      return emitOpError("(C1) expects a mask of ")
             << getWidth() << " lanes, but got " << getLive().getType();
  }
  size_t count = getTypes().size();
  if (getKinds().size() != count || getCombined().size() != count ||
      getYield()->getNumOperands() != count)
    return emitOpError("(C2) expects as many kinds, types and results as "
                       "values that are yielded");
  for (auto [type, result, yielded] :
       llvm::zip_equal(getTypes().getAsValueRange<TypeAttr>(), getResultTypes(),
                       getYield()->getOperandTypes())) {
    mlir::Type expected = result;
    if (getLanes())
      expected = VectorType::get(getWidth(), result);
    if (getSignless(type) != result || yielded != expected)
      return emitOpError("(C3) combines ")
             << type << ", but yields " << yielded << " and results in "
             << result;
  }
  return success();
}

LogicalResult warp::OnceOp::verify() {
  if ((*this)->getParentOfType<ThreadsOp>() ||
      !(*this)->getParentOfType<GroupOp>())
    return emitOpError("(C1) expects to stand in a 'warp.group', outside of "
                       "its threads");
  return success();
}

LogicalResult warp::EachLaneOp::verify() {
  Block &block = getBody().front();
  if (block.getNumArguments() != getInputs().size())
    return emitOpError("(C1) expects an argument for each operand");
  int64_t lanes = cast<VectorType>(getMask().getType()).getNumElements();
  auto fits = [&](mlir::Type vector, mlir::Type scalar) {
    auto type = dyn_cast<VectorType>(vector);
    return type && type.getNumElements() == lanes &&
           type.getElementType() == scalar;
  };
  for (auto [operand, argument] :
       llvm::zip_equal(getInputs(), block.getArguments()))
    if (!fits(operand.getType(), argument.getType()))
      return emitOpError("(C1) has an argument ")
             << argument.getType() << " for an operand " << operand.getType();
  Operation *yield = block.getTerminator();
  if (yield->getNumOperands() != getNumResults())
    return emitOpError("(C1) expects to yield a value for each result");
  for (auto [result, value] :
       llvm::zip_equal(getResultTypes(), yield->getOperandTypes()))
    if (!fits(result, value))
      return emitOpError("(C1) yields ") << value << " for a result " << result;
  return success();
}

//===----------------------------------------------------------------------===//
// Accesses of lanes
//===----------------------------------------------------------------------===//

/// (C1) and (C2) of accesses: the array's indices, and a value per lane of each
/// scalar that its elements are made of.
static LogicalResult verifyLanes(Operation *op, warp::ArrayType array,
                                 ValueRange indices, ValueRange components,
                                 Value mask) {
  if (int64_t(indices.size()) != array.getRank())
    return op->emitOpError("(C1) expects ")
           << array.getRank() << " indices for " << array << ", but got "
           << indices.size();
  int64_t lanes = cast<VectorType>(mask.getType()).getNumElements();
  SmallVector<mlir::Type> expected;
  warp::flatten(array.getElementType(), expected);
  if (auto run = op->getAttrOfType<IntegerAttr>(warp::attr::run);
      run && expected.size() == 1)
    expected.resize(std::max<int64_t>(run.getInt(), 1), expected.front());
  for (mlir::Type &type : expected)
    type = warp::getSignless(type);
  if (components.size() != expected.size())
    return op->emitOpError("(C2) expects ")
           << expected.size() << " components for " << array << ", but got "
           << components.size();
  for (auto [component, type] : llvm::zip_equal(components, expected)) {
    auto vector = cast<VectorType>(component.getType());
    if (vector.getElementType() != type || vector.getNumElements() != lanes)
      return op->emitOpError("(C2) expects a component of ")
             << lanes << " lanes of " << type << ", but got " << vector;
  }
  return success();
}

LogicalResult warp::LoadLanesOp::verify() {
  return verifyLanes(*this, cast<warp::ArrayType>(getArray().getType()),
                     getIndices(), getComponents(), getMask());
}

LogicalResult warp::StoreLanesOp::verify() {
  return verifyLanes(*this, cast<warp::ArrayType>(getArray().getType()),
                     getIndices(), getComponents(), getMask());
}

LogicalResult warp::UpdateLanesOp::verify() {
  return verifyLanes(*this, cast<warp::ArrayType>(getArray().getType()),
                     getIndices(), getComponents(), getMask());
}
