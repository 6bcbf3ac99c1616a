//===- LowerTilesAlgebra.cpp - Products, factors, transforms --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
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
  Type type = tileType(op.getResult()).getElementType();
  bool isNarrow = type.getIntOrFloatBitWidth() == 16;
  if (threads == 1 && !isNarrow && !op.getTransposeB() &&
      type == tileType(op.getA()).getElementType() &&
      type == tileType(op.getB()).getElementType())
    return lowerRows(op);
  lowerProducts(op);
}

/// Element by element.
void TileLowering::lowerProducts(TileMatmulOp op) {
  TileType type = tileType(op.getResult()), a = tileType(op.getA());
  Type out = type.getElementType();
  Type sum = out.getIntOrFloatBitWidth() == 16 ? Type(b.getF32Type()) : out;
  int64_t depth = a.getShape()[!op.getTransposeA()];
  auto at = [&](Value tile, bool transposed, Value i, Value j) {
    return cast(element(tile, transposed ? Values{j, i} : Values{i, j}), sum);
  };
  share(type.getShape(), [&](ValueRange ij) {
    Value total = loop(
        number(0), number(depth), number(1), constant(sum, 0),
        [&](Value k, ValueRange sums) -> Values {
          Value x = at(op.getA(), op.getTransposeA(), ij[0], k);
          Value y = at(op.getB(), op.getTransposeB(), k, ij[1]);
          return {builtin("add", {sums[0], builtin("mul", {x, y})})};
        })[0];
    if (op.getAlpha())
      total = builtin("mul", {total, cast(op.getAlpha(), sum)});
    if (op.getC()) {
      Value c = cast(element(op.getC(), ij), sum);
      if (op.getBeta())
        c = builtin("mul", {c, cast(op.getBeta(), sum)});
      total = builtin("add", {total, c});
    }
    store(op.getResult(), ij, cast(total, out));
  });
}

/// Row by row: a multiple of a row of b is added, in vectors.
void TileLowering::lowerRows(TileMatmulOp op) {
  TileType type = tileType(op.getResult()), a = tileType(op.getA());
  int64_t columns = type.getShape()[1];
  int64_t depth = a.getShape()[!op.getTransposeA()];
  Value result = op.getResult();
  loop(type.getShape()[0], [&](Value i) {
    loop(columns, [&](Value j) {
      Value first = op.getC() ? element(op.getC(), {i, j})
                              : constant(type.getElementType(), 0);
      if (op.getC() && op.getBeta())
        first = builtin("mul", {first, op.getBeta()});
      store(result, {i, j}, first);
    });
    loop(depth, [&](Value k) {
      Value x =
          element(op.getA(), op.getTransposeA() ? Values{k, i} : Values{i, k});
      if (op.getAlpha())
        x = builtin("mul", {x, op.getAlpha()});
      loop(columns, [&](Value j) {
        Value y = element(op.getB(), {k, j});
        Value old = load(result, {i, j});
        store(result, {i, j}, builtin("add", {old, builtin("mul", {x, y})}));
      });
    });
  });
}

//===----------------------------------------------------------------------===//
// Factors
//===----------------------------------------------------------------------===//

/// Left-looking: column j from those before it. Every thread computes the
/// diagonal; the rest of a column is shared.
void TileLowering::lowerCholesky(TileCholeskyOp op) {
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
    Value diagonal = builtin(
        "sqrt", builtin("where", {isPositive, square, none}));
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

/// A row of the solution at a time, which is then subtracted from the others.
void TileLowering::lowerSolve(TileSolveOp op) {
  begin(op, op.getRhs());
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
  auto row = [&](Value i) {
    return backwards ? sub(number(n - 1), i) : i;
  };
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

//===----------------------------------------------------------------------===//
// Fourier transforms
//===----------------------------------------------------------------------===//

/// exp(-2 pi i step / period), or its inverse.
Value TileLowering::twiddle(Type real, Value step, int64_t period,
                            bool inverse) {
  constexpr double turn = 6.283185307179586476925;
  Value angle = builtin("mul", {cast(step, real),
                                constant(real, (inverse ? turn : -turn) /
                                                   double(period))});
  return ConstructOp::create(
      b, loc, VecType::get(b.getContext(), 2, real),
      ValueRange{builtin("cos", angle), builtin("sin", angle)});
}

Value TileLowering::complexMul(Value x, Value y) {
  auto type = mlir::cast<VecType>(x.getType());
  auto part = [&](Value z, int64_t i) -> Value {
    return ExtractOp::create(b, loc, type.getElementType(), z,
                             constant(b.getIntegerType(32, true), i));
  };
  auto product = [&](int64_t i, int64_t j) {
    return builtin("mul", {part(x, i), part(y, j)});
  };
  return ConstructOp::create(
      b, loc, type,
      ValueRange{builtin("sub", {product(0, 0), product(1, 1)}),
                 builtin("add", {product(0, 1), product(1, 0)})});
}

void TileLowering::lowerFft(TileFftOp op) {
  if (llvm::isPowerOf2_64(tileType(op.getTile()).getShape().back()))
    return lowerFftStages(op);
  lowerFftSums(op);
}

/// Stockham's order: each stage reads one memory and writes the other, so that
/// no reversal of bits is needed.
void TileLowering::lowerFftStages(TileFftOp op) {
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape().back(), count = type.getNumElements();
  Type pair = type.getElementType();
  Type real = getElementScalar(pair);
  Value memory[2] = {
      memoryOf(op.getResult()),
      arrayAt(op->getAttrOfType<IntegerAttr>(attr::scratch).getInt(), count,
              pair)};
  int64_t stages = llvm::Log2_64(n);
  int from = stages % 2;
  if (from || !op->hasAttr(attr::inPlace)) {
    share(type.getShape(), [&](ValueRange indices) {
      StoreOp::create(b, loc, element(op.getTile(), indices), memory[from],
                      linear(type.getShape(), indices));
    });
    barrier();
  }
  auto read = [&](Value index) -> Value {
    return LoadOp::create(b, loc, pair, memory[from], index);
  };
  // Before stage s there are 2^s transforms interleaved.
  for (int64_t stride = 1, half = n / 2; half > 0; stride *= 2, half /= 2) {
    share({count / n, half, stride}, [&](ValueRange at) {
      Value row = mul(at[0], number(n));
      Value p = at[1], q = at[2];
      Value source = add(row, add(q, mul(p, number(stride))));
      Value x = read(source), y = read(add(source, number(stride * half)));
      Value target = add(row, add(q, mul(p, number(2 * stride))));
      Value difference = builtin("sub", {x, y});
      Value turned = complexMul(
          difference, twiddle(real, p, 2 * half, op.getInverse()));
      StoreOp::create(b, loc, builtin("add", {x, y}), memory[1 - from], target);
      StoreOp::create(b, loc, turned, memory[1 - from],
                      add(target, number(stride)));
    });
    barrier();
    from = 1 - from;
  }
}

/// Any length: the sums themselves.
void TileLowering::lowerFftSums(TileFftOp op) {
  TileType type = tileType(op.getTile());
  ArrayRef<int64_t> shape = type.getShape();
  int64_t n = shape.back(), count = type.getNumElements();
  Type pair = type.getElementType();
  Value kept = arrayAt(op->getAttrOfType<IntegerAttr>(attr::scratch).getInt(),
                       count, pair);
  share(shape, [&](ValueRange at) {
    StoreOp::create(b, loc, element(op.getTile(), at), kept, linear(shape, at));
  });
  barrier();
  share(shape, [&](ValueRange at) {
    Value place = linear(shape, at);
    Value row = sub(place, at.back());
    Value sum = loop(
        number(0), number(n), number(1), zero(pair),
        [&](Value j, ValueRange sums) -> Values {
          // Reduced first: large multiples of an angle are inexact.
          Value step = arith::RemUIOp::create(b, loc, mul(j, at.back()),
                                              number(n));
          Value x = LoadOp::create(b, loc, pair, kept, add(row, j));
          Value turned = complexMul(
              x, twiddle(getElementScalar(pair), step, n, op.getInverse()));
          return {builtin("add", {sums[0], turned})};
        })[0];
    store(op.getResult(), at, sum);
  });
}

} // namespace warp::tiles
