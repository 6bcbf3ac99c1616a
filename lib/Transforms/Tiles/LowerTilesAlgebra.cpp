//===- LowerTilesAlgebra.cpp - Products and factors -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Of tiles that the threads of a block share; on a CPU, where a block is one
// thread, the device library has functions for whole tiles
// (LowerTilesLibrary.cpp).
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Products
//===----------------------------------------------------------------------===//

void TileLowering::lowerMatmul(TileMatmulOp op) {
  if (callsForTiles(kernel, threads))
    return callProduct(op);
  TileType type = tileType(op.getResult()), a = tileType(op.getA());
  Type out = type.getElementType();
  Type sum = out.getIntOrFloatBitWidth() == 16 ? Type(b.getF32Type()) : out;
  int64_t depth = a.getShape()[!op.getTransposeA()];
  auto at = [&](Value tile, bool transposed, Value i, Value j) {
    return cast(element(tile, transposed ? Values{j, i} : Values{i, j}), sum);
  };
  share(type.getShape(), [&](ValueRange ij) {
    Value total =
        loop(number(0), number(depth), number(1), constant(sum, 0),
             [&](Value k, ValueRange sums) -> Values {
               Value x = at(op.getA(), op.getTransposeA(), ij[0], k);
               Value y = at(op.getB(), op.getTransposeB(), k, ij[1]);
               return {builtin("add", {sums[0], builtin("mul", {x, y})})};
             })[0];
    if (op.getAlpha())
      total = builtin("mul", {total, cast(op.getAlpha(), sum)});
    if (op.getC()) {
      Value c = cast(element(op.getC(), ij), sum);
      if (Value beta = op.getBeta()) {
        // Zero leaves nothing of the tile, whatever is in it.
        Value none = constant(sum, 0), scale = cast(beta, sum);
        Value scaled = builtin("mul", {c, scale});
        c = builtin("where", {builtin("eq", {scale, none}), none, scaled});
      }
      total = builtin("add", {total, c});
    }
    store(op.getResult(), ij, cast(total, out));
  });
}

//===----------------------------------------------------------------------===//
// Factors
//===----------------------------------------------------------------------===//

/// Left-looking: column j from those before it. Every thread computes the
/// diagonal; the rest of a column is shared.
void TileLowering::lowerCholesky(TileCholeskyOp op) {
  if (callsForTiles(kernel, threads))
    return callCholesky(op);
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape()[0];
  Type real = type.getElementType();
  Value result = op.getResult();
  bool upper = op.getUpper();
  auto at = [&](Value i, Value j) {
    return upper ? Values{j, i} : Values{i, j};
  };
  auto rest = [&](Value i, Value j) {
    Value first = element(op.getTile(), at(i, j));
    return loop(number(0), j, number(1), first,
                [&](Value k, ValueRange sums) -> Values {
                  Value product = builtin(
                      "mul", {load(result, at(i, k)), load(result, at(j, k))});
                  return {builtin("sub", {sums[0], product})};
                })[0];
  };
  loop(n, [&](Value j) {
    Value square = rest(j, j);
    // The root of what is not positive is NaN, and so is what follows.
    Value isPositive = builtin("gt", {square, constant(real, 0)});
    Value none = constant(real, std::numeric_limits<double>::quiet_NaN());
    Value diagonal =
        builtin("sqrt", builtin("where", {isPositive, square, none}));
    // In place, all have to have read it.
    barrier();
    byFirstThread([&] { store(result, at(j, j), diagonal); });
    Value begin = add(j, number(1));
    if (threads > 1)
      begin = add(begin, thread);
    loop(begin, number(n), number(threads), {}, [&](Value i, ValueRange) {
      store(result, at(i, j), builtin("div", {rest(i, j), diagonal}));
      store(result, at(j, i), constant(real, 0));
      return Values();
    });
    barrier();
  });
}

/// In place of the cotangent, columns from the last to the first: what a column
/// of the factor was computed from gets its part. Iain Murray, Differentiation
/// of the Cholesky decomposition, 2016.
void TileLowering::lowerCholeskyAdjoint(TileCholeskyAdjointOp op) {
  begin(op, op.getCotangent());
  if (callsForTiles(kernel, threads))
    return callCholeskyAdjoint(op);
  TileType type = tileType(op.getFactor());
  int64_t n = type.getShape()[0];
  Type real = type.getElementType();
  Value bar = op.getResult();
  bool upper = op.getUpper();
  auto at = [&](Value i, Value j) {
    return upper ? Values{j, i} : Values{i, j};
  };
  auto factor = [&](Value i, Value j) {
    return element(op.getFactor(), at(i, j));
  };
  loop(n, [&](Value step) {
    Value j = sub(number(n - 1), step), below = add(j, number(1));
    Value over = builtin("div", {constant(real, 1), factor(j, j)});
    // What column k has in common with column j.
    auto common = [&](Value k) {
      return loop(below, number(n), number(1), constant(real, 0),
                  [&](Value i, ValueRange sums) -> Values {
                    Value product =
                        builtin("mul", {load(bar, at(i, j)), factor(i, k)});
                    return {builtin("add", {sums[0], product})};
                  })[0];
    };
    Value rest = builtin("mul", {common(j), over});
    Value diagonal =
        builtin("mul", {builtin("sub", {load(bar, at(j, j)), rest}), over});
    Value first = thread ? thread : number(0);
    loop(first, j, number(threads), {}, [&](Value k, ValueRange) {
      Value own = factor(j, k), ratio = builtin("mul", {own, over});
      Value change = builtin("add", {builtin("mul", {common(k), over}),
                                     builtin("mul", {diagonal, own})});
      auto subtract = [&](Value i, Value part) {
        store(bar, at(i, k), builtin("sub", {load(bar, at(i, k)), part}));
      };
      subtract(j, change);
      loop(below, number(n), number(1), {}, [&](Value i, ValueRange) {
        subtract(i, builtin("mul", {load(bar, at(i, j)), ratio}));
        return Values();
      });
      store(bar, at(k, j), constant(real, 0));
      return Values();
    });
    // All have read the column.
    barrier();
    byFirstThread([&] {
      Value half = builtin("mul", {diagonal, constant(real, 0.5)});
      store(bar, at(j, j), half);
    });
    loop(add(below, first), number(n), number(threads), {},
         [&](Value i, ValueRange) {
           store(bar, at(i, j), builtin("mul", {load(bar, at(i, j)), over}));
           return Values();
         });
  });
}

/// A row of the solution at a time, which is then subtracted from the others.
void TileLowering::lowerSolve(TileSolveOp op) {
  begin(op, op.getRhs());
  if (callsForTiles(kernel, threads))
    return callSolve(op);
  TileType rhs = tileType(op.getRhs());
  int64_t n = rhs.getShape()[0];
  int64_t columns = rhs.getRank() == 2 ? rhs.getShape()[1] : 1;
  Value result = op.getResult();
  auto coefficient = [&](Value i, Value j) {
    return element(op.getMatrix(),
                   op.getTransposed() ? Values{j, i} : Values{i, j});
  };
  auto at = [&](Value i, Value c) {
    return rhs.getRank() == 2 ? Values{i, c} : Values{i};
  };
  // Backwards if the matrix that is solved with is upper.
  bool backwards = bool(op.getUpper()) != bool(op.getTransposed());
  auto row = [&](Value i) { return backwards ? sub(number(n - 1), i) : i; };
  loop(n, [&](Value step) {
    Value j = row(step);
    Value diagonal = coefficient(j, j);
    share(ArrayRef<int64_t>(columns), [&](ValueRange c) {
      Value x = builtin("div", {load(result, at(j, c[0])), diagonal});
      store(result, at(j, c[0]), x);
    });
    barrier();
    auto update = [&](Value i, Value c) {
      Value x = load(result, at(j, c)), old = load(result, at(i, c));
      Value product = builtin("mul", {coefficient(i, j), x});
      store(result, at(i, c), builtin("sub", {old, product}));
    };
    // Rows that are left, each with all columns.
    Value begin = mul(add(step, number(1)), number(columns));
    if (threads > 1)
      begin = add(begin, thread);
    loop(begin, number(n * columns), number(threads), {},
         [&](Value e, ValueRange) {
           Values place = unravel(e, {n, columns});
           update(row(place[0]), place[1]);
           return Values();
         });
    barrier();
  });
}

void TileLowering::lowerDiagAdd(TileDiagAddOp op) {
  begin(op, op.getTile());
  share(tileType(op.getDiagonal()).getShape(), [&](ValueRange i) {
    Value old = load(op.getResult(), {i[0], i[0]});
    Value sum = builtin("add", {old, element(op.getDiagonal(), i)});
    store(op.getResult(), {i[0], i[0]}, sum);
  });
}

} // namespace warp::tiles
