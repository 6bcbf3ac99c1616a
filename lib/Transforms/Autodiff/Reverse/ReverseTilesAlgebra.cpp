//===- ReverseTilesAlgebra.cpp - Adjoints of linear algebra of tiles ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "ReverseTiles.h"

using namespace mlir;

namespace warp::autodiff {

Value TileReverse::multiply(Value x, Value y, bool transposeX, bool transposeY,
                            Value alpha) {
  TileType a = typeOf(x), c = typeOf(y);
  bool first = a.getElementType().getIntOrFloatBitWidth() >=
               c.getElementType().getIntOrFloatBitWidth();
  TileType type =
      shaped({a.getShape()[transposeX], c.getShape()[!transposeY]},
             first ? a.getElementType() : c.getElementType());
  return TileMatmulOp::create(b, loc, type, x, y, Value(), alpha, Value(),
                              unit(transposeX), unit(transposeY));
}

Value TileReverse::solve(Value matrix, Value rhs, bool upper,
                         bool transposed) {
  return TileSolveOp::create(b, loc, rhs.getType(), matrix, rhs, unit(upper),
                             unit(transposed));
}

Value TileReverse::triangle(
    Value tile, bool upper,
    llvm::function_ref<Value(Value element, Value onDiagonal)> function) {
  Shape shape = typeOf(tile).getShape();
  return map({tile, numbers(shape, 0), numbers(shape, 1)}, [&](ValueRange x) {
    Value made = function(x[0], apply("eq", {x[1], x[2]}));
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
    if (!value)
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
      return apply("mul", {e[0], CastOp::create(b, loc, e[0].getType(), e[1])
                                     .getResult()});
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

/// With L: S = L^-T P L^-1, where P is the lower triangle of L^T g, its
/// diagonal halved; what is read is the lower triangle of a symmetric matrix.
/// Iain Murray, Differentiation of the Cholesky decomposition, 2016.
LogicalResult TileReverse::reverseCholesky(TileCholeskyOp factor) {
  Value g = take();
  if (!g)
    return success();
  bool upper = factor.getUpper();
  Value l = reverse.recover(factor.getResult());
  if (upper) {
    l = transpose(l);
    g = transpose(g);
  }
  Value half =
      constant(b, loc, cast<FloatType>(typeOf(g).getElementType()), 0.5);
  auto halved = [&](Value x, Value onDiagonal) {
    return apply("where", {onDiagonal, apply("mul", {x, half}), x});
  };
  Value p = triangle(multiply(l, g, true, false), false, halved);
  Value left = solve(l, p, false, true);
  Value s = solve(l, transpose(left), false, true);
  Value both = map({s, transpose(s)},
                   [&](ValueRange x) { return apply("add", {x[0], x[1]}); });
  Value result = triangle(both, false, halved);
  give(factor.getTile(), upper ? transpose(result) : result);
  return success();
}

LogicalResult TileReverse::reverseSolve(TileSolveOp op) {
  Value g = take();
  if (!g)
    return success();
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
  Value product = transposed ? multiply(xs, bars, false, true)
                             : multiply(bars, xs, false, true);
  give(op.getMatrix(), triangle(product, upper, [&](Value x, Value) {
         return apply("neg", x);
       }));
  return success();
}

} // namespace warp::autodiff
