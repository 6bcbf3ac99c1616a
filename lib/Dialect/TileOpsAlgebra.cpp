//===- TileOpsAlgebra.cpp - Verification of reductions, linear algebra ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "TileVerification.h"

#include "mlir/IR/OpImplementation.h"
#include "llvm/ADT/STLExtras.h"

using namespace mlir;
using warp::isNumber;
using warp::require;
using warp::TileType;
using warp::typeOf;

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
  if (failed(verifyElementFunction(*this)) ||
      failed(require(*this,
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

static bool isReal(mlir::Type type) { return type.isF32() || type.isF64(); }

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

LogicalResult warp::TileCholeskyAdjointOp::verify() {
  TileType type = typeOf(getFactor());
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
