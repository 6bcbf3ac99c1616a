//===- ReverseTilesAlgebra.cpp - Adjoints of linear algebra of tiles ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "ReverseTiles.h"

using namespace mlir;

namespace warp::autodiff {

static bool isOne(Value factor) {
  auto known = factor.getDefiningOp<ConstantOp>();
  auto number = known ? dyn_cast<FloatAttr>(known.getValue()) : FloatAttr();
  return number && number.getValue().isExactlyValue(1.0);
}

/// The shorter factor as the other one's type, which holds its numbers.
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

/// The product with the transpose of the other; of columns elementwise, so that
/// it is computed where it is used.
Value TileReverse::outer(Value x, Value y) {
  int64_t rows = typeOf(x).getShape()[0], columns = typeOf(y).getShape()[0];
  if (typeOf(x).getShape()[1] != 1)
    return multiply(x, y, false, true);
  Value row = reshape(y, {1, columns});
  return map({broadcast(x, {rows, columns}), broadcast(row, {rows, columns})},
             [&](ValueRange e) { return apply("mul", e); });
}

Value TileReverse::solve(Value matrix, Value rhs, bool upper, bool transposed) {
  return TileSolveOp::create(b, loc, rhs.getType(), matrix, rhs, unit(upper),
                             unit(transposed));
}

Value TileReverse::triangle(Value tile, bool upper,
                            llvm::function_ref<Value(Value)> function) {
  Shape shape = typeOf(tile).getShape();
  return map({tile, numbers(shape, 0), numbers(shape, 1)}, [&](ValueRange x) {
    Value made = function(x[0]);
    Value inside = apply(upper ? "le" : "ge", {x[1], x[2]});
    return apply("where", {inside, made, zeroOf(made.getType())});
  });
}

LogicalResult TileReverse::reverseMatmul(TileMatmulOp matmul) {
  Value g = take();
  if (!g)
    return success();
  Value x = reverse.recover(matmul.getA()), y = reverse.recover(matmul.getB());
  bool tx = matmul.getTransposeA(), ty = matmul.getTransposeB();
  auto factor = [&](Value value) -> Value {
    if (!value || isOne(value))
      return {};
    Value known = reverse.recover(value);
    Type type = typeOf(g).getElementType();
    return known.getType() == type ? known
                                   : CastOp::create(b, loc, type, known);
  };
  Value alpha = factor(matmul.getAlpha()), beta = factor(matmul.getBeta());
  auto fit = [&](Value cotangent, Value primal) {
    TileType type = cotangentType(primal);
    if (cotangent.getType() == type)
      return cotangent;
    return map(cotangent, [&](ValueRange e) -> Value {
      return CastOp::create(b, loc, type.getElementType(), e[0]);
    });
  };
  if (wants(matmul.getA()))
    give(matmul.getA(), fit(tx ? multiply(y, g, ty, true, alpha)
                               : multiply(g, y, false, !ty, alpha),
                            matmul.getA()));
  if (wants(matmul.getB()))
    give(matmul.getB(), fit(ty ? multiply(g, x, true, tx, alpha)
                               : multiply(x, g, !tx, false, alpha),
                            matmul.getB()));
  auto inner = [&](Value other, Value scale) {
    Value products = map({g, other}, [&](ValueRange e) {
      return apply(
          "mul",
          {e[0], CastOp::create(b, loc, e[0].getType(), e[1]).getResult()});
    });
    return overThreads(products, differentialType(scale.getType()));
  };
  if (matmul.getAlpha() && wants(matmul.getAlpha()))
    give(matmul.getAlpha(), inner(multiply(x, y, tx, ty), matmul.getAlpha()));
  if (!matmul.getC())
    return success();
  if (matmul.getBeta() && wants(matmul.getBeta()))
    give(matmul.getBeta(),
         inner(reverse.recover(matmul.getC()), matmul.getBeta()));
  if (wants(matmul.getC()) && beta)
    g = map({g, beta},
            [&](ValueRange e) { return apply("mul", {e[0], e[1]}); });
  give(matmul.getC(), g);
  return success();
}

LogicalResult TileReverse::reverseCholesky(TileCholeskyOp factor) {
  Value g = take();
  if (!g)
    return success();
  give(factor.getTile(),
       TileCholeskyAdjointOp::create(b, loc, g.getType(),
                                     reverse.recover(factor.getResult()), g,
                                     factor.getUpperAttr()));
  return success();
}

/// The factor A = L L^T and the first solve, if this is the second one of
/// A x = b and all that the first one is for.
static TileCholeskyOp findSystem(TileSolveOp op, TileSolveOp &first) {
  auto factor = op.getMatrix().getDefiningOp<TileCholeskyOp>();
  first = op.getRhs().getDefiningOp<TileSolveOp>();
  bool upper = op.getUpper();
  // A = U^T U is solved with the transpose first.
  if (!factor || !first || factor->getBlock() != op->getBlock() ||
      first->getBlock() != op->getBlock() || !first->hasOneUse() ||
      first.getMatrix() != op.getMatrix() || factor.getUpper() != upper ||
      first.getUpper() != upper || op.getTransposed() == upper ||
      first.getTransposed() != upper)
    return nullptr;
  return factor;
}

/// For x = A^-1 b, with any factor: b' = A^-1 x', and A' = - b' x^T, of
/// which the triangle that is read gets the other one's part, too.
void TileReverse::reverseSystem(TileCholeskyOp factor, TileSolveOp first,
                                TileSolveOp second, Value g) {
  bool upper = factor.getUpper();
  Value matrix = reverse.recover(factor.getResult());
  Value rhs = solve(matrix, g, upper, upper);
  rhs = solve(matrix, rhs, upper, !upper);
  give(first.getRhs(), rhs);
  TileType type = typeOf(rhs);
  int64_t n = type.getShape()[0];
  int64_t columns = type.getRank() == 2 ? type.getShape()[1] : 1;
  Value bars = reshape(rhs, {n, columns});
  Value xs = reshape(reverse.recover(second.getResult()), {n, columns});
  Value product = outer(bars, xs);
  Value other = columns == 1 ? outer(xs, bars) : transpose(product);
  Shape shape = typeOf(product).getShape();
  Value both = map({product, other, numbers(shape, 0), numbers(shape, 1)},
                   [&](ValueRange x) {
                     Value sum = apply("add", {x[0], x[1]});
                     Value isOnDiagonal = apply("eq", {x[2], x[3]});
                     return apply("where", {isOnDiagonal, x[0], sum});
                   });
  give(factor.getTile(),
       triangle(both, upper, [&](Value x) { return apply("neg", x); }));
}

LogicalResult TileReverse::reverseSolve(TileSolveOp op) {
  Value g = take();
  if (!g)
    return success();
  TileSolveOp first;
  if (TileCholeskyOp factor = findSystem(op, first);
      factor && wants(factor.getTile())) {
    reverseSystem(factor, first, op, g);
    return success();
  }
  bool upper = op.getUpper(), transposed = op.getTransposed();
  Value matrix = reverse.recover(op.getMatrix());
  Value rhs = solve(matrix, g, upper, !transposed);
  give(op.getRhs(), rhs);
  if (!wants(op.getMatrix()))
    return success();
  Value x = reverse.recover(op.getResult());
  TileType type = typeOf(rhs);
  int64_t n = type.getShape()[0];
  int64_t columns = type.getRank() == 2 ? type.getShape()[1] : 1;
  Value bars = reshape(rhs, {n, columns}), xs = reshape(x, {n, columns});
  Value product = transposed ? outer(xs, bars) : outer(bars, xs);
  give(op.getMatrix(),
       triangle(product, upper, [&](Value x) { return apply("neg", x); }));
  return success();
}

} // namespace warp::autodiff
