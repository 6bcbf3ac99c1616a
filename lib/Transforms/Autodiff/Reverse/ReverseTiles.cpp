//===- ReverseTiles.cpp - Adjoints of operations on tiles -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Cotangents of tiles are tiles, so rules are operations on tiles. The models
// of operations have them (lib/Transforms/Tiles):
//
// clang-format off
//   primal                    adjoint, on the cotangent g of the result
//   load / store, atomic      add to gradients / take them; a store zeroes them
//   map                       a map of the body's adjoint
//   splat, operand of a map   the sum of each thread's elements
//   sum, broadcast            each other's
//   slice / insert, gather / scatter, get / set, shapes    each other's
//   min, max                  where the extremum is
//   scan                      the scan from the other end
//   matmul                    alpha g b^T, alpha a^T g, beta g
//   Cholesky                  an operation of its own, of the triangle that is read
//   solve                     a triangular solve and a product
//   Fourier transform         the other one
// clang-format on
//
//===----------------------------------------------------------------------===//

#include "ReverseTiles.h"
#include "Tiles/TileBuffers.h"

#include "WarpDialect/TilePasses.h"

#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::autodiff {

/// A tile access reads again what was there, or says why it cannot.
LogicalResult ReverseBuilder::replayTileAccess(TileAccessOp op) {
  if (op.mayWrite()) {
    if (op->use_empty())
      return success();
    return op->emitOpError(
        "returns the old value, which depends on the order of "
        "threads; a derivative cannot go through it");
  }
  std::string why;
  bool needsOneThread;
  Recovery recovery = memory.getRecovery(op, why, needsOneThread);
  Operation *clone = op->clone();
  clone->setOperands(recover(op->getOperands()));
  if (recovery == Recovery::Preserved)
    cast<TileAccessOp>(clone).getArrayMutable().set(
        recoverPreserved(op.getArray()));
  builder.insert(clone);
  if (recovery == Recovery::Impossible)
    clone->setAttr(attr::unrecoverable, builder.getStringAttr(why));
  if (needsOneThread)
    clone->setAttr(attr::assumesOneThread, builder.getUnitAttr());
  setRecovered(op->getResults(), clone->getResults());
  return success();
}

TileReverse::TileReverse(ReverseBuilder &reverse, Operation *op)
    : reverse(reverse), b(reverse.builder), loc(op->getLoc()), op(op) {
  threads = std::max<int64_t>(
      1, tiles::getBlockThreads(op->getParentOfType<func::FuncOp>()));
}

LogicalResult TileReverse::refuse() {
  if (!take())
    return success();
  return op->emitError("'")
         << op->getName().stripDialect()
         << "' has no derivative here; write a custom derivative, or "
            "stop_gradient(...) around its operands";
}

//===----------------------------------------------------------------------===//
// Shapes
//===----------------------------------------------------------------------===//

Value TileReverse::index(int64_t value) {
  return ConstantOp::create(
      b, loc, b.getIntegerAttr(b.getIntegerType(32, true), value));
}

Value TileReverse::reshape(Value tile, Shape shape) {
  TileType type = shaped(shape, typeOf(tile).getElementType());
  if (type == tile.getType())
    return tile;
  return TileReshapeOp::create(b, loc, type, tile);
}

Value TileReverse::broadcast(Value tile, Shape shape) {
  TileType type = shaped(shape, typeOf(tile).getElementType());
  if (type == tile.getType())
    return tile;
  return TileBroadcastOp::create(b, loc, type, tile);
}

Value TileReverse::transpose(Value tile) {
  TileType type = typeOf(tile);
  return TileTransposeOp::create(
      b, loc,
      shaped({type.getShape()[1], type.getShape()[0]}, type.getElementType()),
      tile, ArrayRef<int64_t>{1, 0});
}

Value TileReverse::reduce(Value tile, std::optional<int64_t> axis) {
  TileType type = typeOf(tile);
  // All threads take part in the sum of all elements.
  if (type.getRank() == 1)
    axis.reset();
  return TileReduceOp::create(
      b, loc, getReducedType(type, axis, type.getElementType()),
      TileReduction::add, tile,
      axis ? b.getI64IntegerAttr(*axis) : IntegerAttr());
}

Value TileReverse::iota(int64_t count, int64_t step) {
  return TileIotaOp::create(b, loc, shaped({count}, b.getIntegerType(32, true)),
                            index(0), index(step));
}

Value TileReverse::numbers(Shape shape, int64_t axis) {
  SmallVector<int64_t> flat(shape.size(), 1);
  flat[axis] = shape[axis];
  return broadcast(reshape(iota(shape[axis]), flat), shape);
}

Value TileReverse::overThreads(Value tile, Type type) {
  TileType shape = typeOf(tile);
  int64_t count = shape.getNumElements();
  int64_t rows = llvm::divideCeil(count, threads);
  Value flat = reshape(tile, {count});
  if (rows * threads != count) {
    Value none = zeroOf(shaped({rows * threads}, shape.getElementType()));
    flat = TileInsertOp::create(b, loc, none.getType(), flat, none,
                                ValueRange(index(0)), ArrayRef<int64_t>(1));
  }
  Value sums = reduce(reshape(flat, {rows, threads}), 0);
  return TileToThreadsOp::create(b, loc, type, sums);
}

//===----------------------------------------------------------------------===//
// Products and memory
//===----------------------------------------------------------------------===//

Value TileReverse::multiply(Value x, Value y, bool transposeX, bool transposeY,
                            Value alpha) {
  auto widthOf = [&](Value tile) {
    return typeOf(tile).getElementType().getIntOrFloatBitWidth();
  };
  Type element = typeOf(widthOf(x) >= widthOf(y) ? x : y).getElementType();
  unsigned width = element.getIntOrFloatBitWidth();
  for (Value *factor : {&x, &y})
    if (widthOf(*factor) < width)
      *factor = map(*factor, [&](ValueRange e) -> Value {
        return CastOp::create(b, loc, element, e[0]);
      });
  TileType type = shaped(
      {typeOf(x).getShape()[transposeX], typeOf(y).getShape()[!transposeY]},
      element);
  return TileMatmulOp::create(b, loc, type, x, y, Value(), alpha, Value(),
                              unit(transposeX), unit(transposeY));
}

Value TileReverse::loadGradient(TileAccessOp access) {
  return TileLoadOp::create(b, loc, cotangentType(access.getWritten()),
                            reverse.gradOf(access.getArray()),
                            recover(access.getOffsets()),
                            recoverOptional(access.getPicked()),
                            access.getAxis(), access.getChecked());
}

LogicalResult reverseTile(ReverseBuilder &reverse, Operation *op) {
  TileReverse adjoint(reverse, op);
  return cast<TileOpInterface>(op).adjoint(adjoint);
}

} // namespace warp::autodiff
