//===- TileOps.cpp - Verification of operations on tiles ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each check carries the label of the constraint it enforces, as the op's
// description numbers them.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/IR/OpImplementation.h"
#include "llvm/ADT/STLExtras.h"

using namespace mlir;
using warp::TileType;

#include "WarpDialect/WarpTileEnums.cpp.inc"

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

static TileType typeOf(Value tile) { return cast<TileType>(tile.getType()); }

static LogicalResult require(Operation *op, bool holds, const Twine &message) {
  if (holds)
    return success();
  return op->emitOpError() << message;
}

static bool isNumber(mlir::Type type) {
  return warp::isScalar(type) && !warp::isBool(type);
}

static bool isReal(mlir::Type type) { return type.isF32() || type.isF64(); }

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

template <typename Op>
static LogicalResult verifyMemory(Op op, TileType tile) {
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
  if (failed(require(*this, bool(first), "(C1) expects a tile")) ||
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
  return require(*this,
                 to == TileType::get(getContext(), shape,
                                     from.getElementType()),
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

static LogicalResult verifyElement(Operation *op, TileType tile,
                                   size_t indices, mlir::Type element) {
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

LogicalResult warp::TileSetOp::verify() {
  return verifyElement(*this, typeOf(getTile()), getIndices().size(),
                       getValue().getType());
}

//===----------------------------------------------------------------------===//
// Reductions
//===----------------------------------------------------------------------===//

static LogicalResult verifyReduced(Operation *op, Value tile,
                                   std::optional<int64_t> axis, Value result,
                                   mlir::Type element, const Twine &label) {
  TileType type = typeOf(tile);
  if (axis && (*axis < 0 || *axis >= type.getRank()))
    return op->emitOpError() << label << " expects a dimension of the tile";
  return require(op,
                 typeOf(result) == warp::getReducedType(type, axis, element),
                 label + " expects what is left of the tile's shape");
}

LogicalResult warp::TileReduceOp::verify() {
  mlir::Type element = typeOf(getTile()).getElementType();
  if (failed(verifyReduced(*this, getTile(), getAxis(), getResult(), element,
                           "(C1)")))
    return failure();
  return require(*this, getKind() == TileReduction::add || isNumber(element),
                 "(C2) expects numbers");
}

LogicalResult warp::TileArgReduceOp::verify() {
  if (failed(require(*this,
                     getKind() != TileReduction::add &&
                         isNumber(typeOf(getTile()).getElementType()),
                     "(C1) expects 'min' or 'max' of numbers")))
    return failure();
  auto index = IntegerType::get(getContext(), 32, IntegerType::Signed);
  return verifyReduced(*this, getTile(), getAxis(), getResult(), index, "(C2)");
}

LogicalResult warp::TileFoldOp::verify() {
  mlir::Type element = typeOf(getTile()).getElementType();
  Block &body = getBody().front();
  SmallVector<mlir::Type> two(2, element);
  if (failed(require(*this,
                     llvm::equal(body.getArgumentTypes(), two) &&
                         llvm::equal(body.getTerminator()->getOperandTypes(),
                                     ArrayRef(element)),
                     "(C1) expects a function of two elements")))
    return failure();
  if (getPartials())
    return require(*this, getTile().getType() == getResult().getType(),
                   "(C2) expects partial results in the shape of the tile");
  return verifyReduced(*this, getTile(), getAxis(), getResult(), element,
                       "(C2)");
}

LogicalResult warp::TileScanOp::verify() {
  if (failed(require(*this, isNumber(typeOf(getTile()).getElementType()),
                     "(C1) expects numbers")))
    return failure();
  return require(*this, !getExclusive() || getKind() == TileReduction::add,
                 "(C2) only sums are exclusive");
}

LogicalResult warp::TileSortOp::verify() {
  TileType keys = typeOf(getKeys()), positions = typeOf(getPositions());
  if (failed(require(*this, isNumber(keys.getElementType()),
                     "(C1) expects numbers")))
    return failure();
  return require(*this,
                 keys.getShape() == positions.getShape() &&
                     positions.getElementType().isSignedInteger(32),
                 "(C2) expects a position per element");
}

static LogicalResult verifyPositions(Operation *op, TileType part,
                                     TileType positions, TileType tile) {
  if (failed(require(op,
                     part.getShape() == positions.getShape() &&
                         warp::isInteger(positions.getElementType()),
                     "(C1) expects a position per element")))
    return failure();
  return require(op, part.getElementType() == tile.getElementType(),
                 "(C2) expects the same element type");
}

LogicalResult warp::TileGatherOp::verify() {
  return verifyPositions(*this, typeOf(getResult()), typeOf(getPositions()),
                         typeOf(getTile()));
}

LogicalResult warp::TileScatterOp::verify() {
  return verifyPositions(*this, typeOf(getPart()), typeOf(getPositions()),
                         typeOf(getTile()));
}

//===----------------------------------------------------------------------===//
// Linear algebra
//===----------------------------------------------------------------------===//

LogicalResult warp::TileMatmulOp::verify() {
  TileType a = typeOf(getA()), b = typeOf(getB()), c = typeOf(getResult());
  if (failed(require(*this,
                     a.getRank() == 2 && b.getRank() == 2 && c.getRank() == 2,
                     "(C1) expects tiles of two dimensions")))
    return failure();
  bool ta = getTransposeA(), tb = getTransposeB();
  bool fits = a.getShape()[!ta] == b.getShape()[tb] &&
              a.getShape()[ta] == c.getShape()[0] &&
              b.getShape()[!tb] == c.getShape()[1] &&
              (!getC() || typeOf(getC()).getShape() == c.getShape());
  if (failed(require(*this, fits, "(C1) expects tiles that fit")))
    return failure();
  bool floats = isFloat(a.getElementType()) && isFloat(b.getElementType()) &&
                isFloat(c.getElementType());
  if (failed(require(*this, floats, "(C1) expects floats")))
    return failure();
  auto isFactor = [&](Value factor) {
    return !factor || factor.getType() == c.getElementType() ||
           factor.getType().isF32();
  };
  return require(*this, isFactor(getAlpha()) && isFactor(getBeta()),
                 "(C2) expects factors of the result's element type");
}

static bool isSquare(TileType type) {
  return type.getRank() == 2 && type.getShape()[0] == type.getShape()[1];
}

LogicalResult warp::TileCholeskyOp::verify() {
  TileType type = typeOf(getTile());
  return require(*this, isSquare(type) && isReal(type.getElementType()),
                 "(C1) expects a square tile of f32 or f64");
}

LogicalResult warp::TileSolveOp::verify() {
  TileType matrix = typeOf(getMatrix()), rhs = typeOf(getRhs());
  if (failed(require(*this, isSquare(matrix) && isReal(matrix.getElementType()),
                     "(C1) expects a square tile of f32 or f64")))
    return failure();
  return require(*this,
                 rhs.getRank() <= 2 &&
                     rhs.getShape()[0] == matrix.getShape()[0] &&
                     rhs.getElementType() == matrix.getElementType(),
                 "(C2) expects a right side with a row per row of the matrix");
}

LogicalResult warp::TileDiagAddOp::verify() {
  TileType matrix = typeOf(getTile()), diagonal = typeOf(getDiagonal());
  return require(*this,
                 isSquare(matrix) && diagonal.getRank() == 1 &&
                     diagonal.getShape()[0] == matrix.getShape()[0] &&
                     diagonal.getElementType() == matrix.getElementType(),
                 "(C1) expects a square tile and one of its diagonal");
}

LogicalResult warp::TileFftOp::verify() {
  auto pair = dyn_cast<VecType>(typeOf(getTile()).getElementType());
  return require(*this,
                 pair && pair.getLength() == 2 && isReal(pair.getElementType()),
                 "(C1) expects complex numbers");
}
