//===- TileOps.cpp - Verification of operations on tiles ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each check carries the label of the constraint it enforces, as the op's
// description numbers them. Verifiers of reductions and linear algebra are in
// TileOpsAlgebra.cpp.
//
//===----------------------------------------------------------------------===//

#include "TileVerification.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/IR/OpImplementation.h"
#include "llvm/ADT/STLExtras.h"

using namespace mlir;
using warp::isNumber;
using warp::require;
using warp::TileType;
using warp::typeOf;

#include "WarpDialect/WarpTileEnums.cpp.inc"
#include "WarpDialect/WarpTileInterfaces.cpp.inc"

#define GET_OP_CLASSES
#include "WarpDialect/WarpTileOps.cpp.inc"

bool warp::isTileOp(Operation *op) {
  return llvm::any_of(op->getOperandTypes(), llvm::IsaPred<TileType>) ||
         llvm::any_of(op->getResultTypes(), llvm::IsaPred<TileType>);
}

TileType warp::getReducedType(TileType tile, std::optional<int64_t> axis,
                              mlir::Type element) {
  SmallVector<int64_t> shape;
  if (axis) {
    shape.assign(tile.getShape().begin(), tile.getShape().end());
    shape.erase(shape.begin() + *axis);
  }
  if (shape.empty())
    shape.push_back(1);
  return TileType::get(tile.getContext(), shape, element);
}

//===----------------------------------------------------------------------===//
// Making tiles
//===----------------------------------------------------------------------===//

LogicalResult warp::TileSplatOp::verify() {
  return require(*this,
                 typeOf(getResult()).getElementType() == getValue().getType(),
                 "(C1) expects a value of the element type");
}

LogicalResult warp::TileIotaOp::verify() {
  TileType type = typeOf(getResult());
  if (failed(require(*this, type.getRank() == 1,
                     "(C1) expects a tile of one dimension")))
    return failure();
  return require(*this,
                 isNumber(type.getElementType()) &&
                     getStart().getType() == type.getElementType() &&
                     getStep().getType() == type.getElementType(),
                 "(C2) expects operands of the element type, a number");
}

static LogicalResult verifyThreads(Operation *op, mlir::Type value,
                                   TileType tile) {
  bool whole = tile.getElementType() == value && tile.getRank() == 1;
  SmallVector<int64_t> extents;
  if (auto vec = dyn_cast<warp::VecType>(value))
    extents = {vec.getLength()};
  else if (auto mat = dyn_cast<warp::MatType>(value))
    extents = {mat.getRows(), mat.getCols()};
  bool parts = !extents.empty() &&
               tile.getElementType() == warp::getElementScalar(value) &&
               tile.getShape().drop_back() == ArrayRef<int64_t>(extents);
  return require(op, whole || parts,
                 "(C1) expects a tile of the value per thread, or of its "
                 "components");
}

LogicalResult warp::TileFromThreadsOp::verify() {
  return verifyThreads(*this, getValue().getType(), typeOf(getResult()));
}

LogicalResult warp::TileToThreadsOp::verify() {
  return verifyThreads(*this, getResult().getType(), typeOf(getTile()));
}

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

template <typename Op> static LogicalResult verifyMemory(Op op, TileType tile) {
  auto array = cast<warp::ArrayType>(op.getArray().getType());
  if (failed(require(op,
                     tile.getRank() == array.getRank() &&
                         tile.getElementType() == array.getElementType(),
                     "(C1) expects a tile of the array's rank and element "
                     "type")) ||
      failed(require(op, int64_t(op.getOffsets().size()) == array.getRank(),
                     "(C2) expects an offset per dimension")))
    return failure();
  if (!op.getPicked())
    return success();
  TileType picked = typeOf(op.getPicked());
  int64_t axis = op.getAxis();
  return require(op,
                 axis >= 0 && axis < tile.getRank() && picked.getRank() == 1 &&
                     warp::isInteger(picked.getElementType()) &&
                     picked.getShape()[0] == tile.getShape()[axis],
                 "(C3) expects as many picked indices as the tile has along "
                 "the axis");
}

LogicalResult warp::TileLoadOp::verify() {
  return verifyMemory(*this, typeOf(getResult()));
}

LogicalResult warp::TileStoreOp::verify() {
  return verifyMemory(*this, typeOf(getTile()));
}

LogicalResult warp::TileAtomicOp::verify() {
  return verifyMemory(*this, typeOf(getTile()));
}

//===----------------------------------------------------------------------===//
// Elementwise
//===----------------------------------------------------------------------===//

static mlir::Type elementOf(mlir::Type type) {
  auto tile = dyn_cast<TileType>(type);
  return tile ? tile.getElementType() : type;
}

LogicalResult warp::TileMapOp::verify() {
  TileType first;
  for (mlir::Type type : llvm::concat<const mlir::Type>(
           llvm::to_vector(getInputs().getTypes()),
           llvm::to_vector(getOutputs().getTypes()))) {
    auto tile = dyn_cast<TileType>(type);
    if (!tile)
      continue;
    if (!first)
      first = tile;
    if (failed(require(*this, tile.getShape() == first.getShape(),
                       "(C1) expects tiles of one shape")))
      return failure();
  }
  Block &body = getBody().front();
  if (failed(verifyElementFunction(*this)) ||
      failed(require(*this, bool(first), "(C1) expects a tile")) ||
      failed(require(
          *this,
          llvm::equal(body.getArgumentTypes(),
                      llvm::map_range(getInputs().getTypes(), elementOf)),
          "(C2) expects an argument for an element of each operand")))
    return failure();
  return require(
      *this,
      llvm::equal(body.getTerminator()->getOperandTypes(),
                  llvm::map_range(getOutputs().getTypes(), elementOf)),
      "(C3) expects to yield an element of each result");
}

//===----------------------------------------------------------------------===//
// Shapes and parts
//===----------------------------------------------------------------------===//

LogicalResult warp::TileTransposeOp::verify() {
  TileType from = typeOf(getTile()), to = typeOf(getResult());
  SmallVector<int64_t> sorted(getAxes());
  llvm::sort(sorted);
  bool isPermutation = int64_t(sorted.size()) == from.getRank() &&
                       llvm::equal(sorted, llvm::seq<int64_t>(from.getRank()));
  if (failed(require(*this, isPermutation, "(C1) expects a permutation")))
    return failure();
  SmallVector<int64_t> shape;
  for (int64_t axis : getAxes())
    shape.push_back(from.getShape()[axis]);
  return require(
      *this, to == TileType::get(getContext(), shape, from.getElementType()),
      "(C2) expects extents in the order of the dimensions");
}

LogicalResult warp::TileReshapeOp::verify() {
  TileType from = typeOf(getTile()), to = typeOf(getResult());
  return require(*this,
                 from.getNumElements() == to.getNumElements() &&
                     from.getElementType() == to.getElementType(),
                 "(C1) expects a tile of the same elements");
}

LogicalResult warp::TileBroadcastOp::verify() {
  TileType from = typeOf(getTile()), to = typeOf(getResult());
  if (failed(require(*this, from.getElementType() == to.getElementType(),
                     "(C2) expects the same element type")))
    return failure();
  bool fits = from.getRank() <= to.getRank();
  for (auto [a, b] :
       llvm::zip(llvm::reverse(from.getShape()), llvm::reverse(to.getShape())))
    fits &= a == 1 || a == b;
  return require(*this, fits, "(C1) expects extents that are 1 or the same");
}

static LogicalResult verifyPart(Operation *op, TileType part, TileType whole,
                                size_t offsets, size_t steps) {
  if (failed(require(op,
                     int64_t(offsets) == whole.getRank() &&
                         int64_t(steps) == whole.getRank(),
                     "(C1) expects an offset and a step per dimension")))
    return failure();
  return require(op,
                 part.getElementType() == whole.getElementType() &&
                     part.getRank() == whole.getRank(),
                 "(C2) expects a part of the same element type and rank");
}

LogicalResult warp::TileSliceOp::verify() {
  return verifyPart(*this, typeOf(getResult()), typeOf(getTile()),
                    getOffsets().size(), getSteps().size());
}

LogicalResult warp::TileInsertOp::verify() {
  return verifyPart(*this, typeOf(getPart()), typeOf(getTile()),
                    getOffsets().size(), getSteps().size());
}

static LogicalResult verifyElement(Operation *op, TileType tile, size_t indices,
                                   mlir::Type element) {
  if (failed(require(op, int64_t(indices) == tile.getRank(),
                     "(C1) expects an index per dimension")))
    return failure();
  return require(op, element == tile.getElementType(),
                 "(C2) expects a value of the element type");
}

LogicalResult warp::TileGetOp::verify() {
  return verifyElement(*this, typeOf(getTile()), getIndices().size(),
                       getResult().getType());
}

mlir::Type warp::getPartType(mlir::Type element, ArrayAttr path) {
  for (Attribute step : path) {
    if (auto field = dyn_cast<StringAttr>(step))
      element = getFieldType(element, field);
    else if (auto count = dyn_cast<IntegerAttr>(step);
             count && element && isComposite(element))
      element = getIndexedType(element, count.getInt());
    else
      return {};
    if (!element)
      return {};
  }
  return element;
}

void warp::TileSetOp::build(OpBuilder &b, OperationState &state,
                            mlir::Type result, TileUpdate kind,
                            mlir::Value value, mlir::Value tile,
                            ValueRange indices, mlir::Value where) {
  build(b, state, result, kind, value, tile, indices, ValueRange(), where,
        ArrayAttr());
}

LogicalResult warp::TileSetOp::verify() {
  TileType tile = typeOf(getTile());
  ArrayAttr path = getPathAttr();
  if (!path)
    return verifyElement(*this, tile, getIndices().size(),
                         getValue().getType());
  int64_t components = 0;
  for (Attribute step : path)
    if (auto count = dyn_cast<IntegerAttr>(step))
      components += count.getInt();
  if (failed(require(*this,
                     components == int64_t(getComponents().size()) &&
                         getPartType(tile.getElementType(), path) ==
                             getValue().getType(),
                     "(C2) expects a value of the type of the part that the "
                     "path leads to")))
    return failure();
  return verifyElement(*this, tile, getIndices().size(), tile.getElementType());
}
