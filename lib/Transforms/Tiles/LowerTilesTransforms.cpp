//===- LowerTilesTransforms.cpp - Fourier transforms ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::tiles {

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
  switch (getFftMethod(op, threads)) {
  case FftMethod::Stages:
    return lowerFftStages(op);
  case FftMethod::Chirps:
    return lowerFftChirps(op);
  case FftMethod::Sums:
    return lowerFftSums(op);
  }
}

//===----------------------------------------------------------------------===//
// Stages
//===----------------------------------------------------------------------===//

/// Of rows in `memory[0]`, by way of `memory[1]`; where the result is says the
/// number that is returned. Stockham's order: each stage reads one memory and
/// writes the other, so that no reversal of bits is needed.
int TileLowering::transform(std::array<Value, 2> memory, int64_t rows,
                            int64_t n, bool inverse) {
  auto type = cast<ArrayType>(memory[0].getType());
  Type pair = type.getElementType(), real = getElementScalar(pair);
  if (callsForTiles(kernel, threads)) {
    callLibrary("warp_tile_fft", real,
                {addressOf(memory[0]), addressOf(memory[0]),
                 addressOf(memory[1]), number(rows), number(n),
                 number(inverse)});
    return 0;
  }
  int from = 0;
  auto read = [&](Value index) -> Value {
    return LoadOp::create(b, loc, pair, memory[from], index);
  };
  // Before stage s there are 2^s transforms interleaved.
  for (int64_t stride = 1, half = n / 2; half > 0; stride *= 2, half /= 2) {
    share({rows, half, stride}, [&](ValueRange at) {
      Value row = mul(at[0], number(n));
      Value p = at[1], q = at[2];
      Value source = add(row, add(q, mul(p, number(stride))));
      Value x = read(source), y = read(add(source, number(stride * half)));
      Value target = add(row, add(q, mul(p, number(2 * stride))));
      Value difference = builtin("sub", {x, y});
      Value turned =
          complexMul(difference, twiddle(real, p, 2 * half, inverse));
      StoreOp::create(b, loc, builtin("add", {x, y}), memory[1 - from], target);
      StoreOp::create(b, loc, turned, memory[1 - from],
                      add(target, number(stride)));
    });
    barrier();
    from = 1 - from;
  }
  return from;
}

void TileLowering::lowerFftStages(TileFftOp op) {
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape().back(), count = type.getNumElements();
  bool calls = callsForTiles(kernel, threads);
  int64_t room = calls ? 3 * n : count;
  std::array<Value, 2> memory{
      memoryOf(op.getResult()),
      arrayAt(scratchOf(op), room, type.getElementType())};
  // After an odd number of stages the result is in the other memory.
  bool swaps = !calls && llvm::Log2_64(n) % 2;
  if (swaps)
    std::swap(memory[0], memory[1]);
  if (swaps || !op->hasAttr(attr::inPlace)) {
    share(type.getShape(), [&](ValueRange indices) {
      StoreOp::create(b, loc, element(op.getTile(), indices), memory[0],
                      linear(type.getShape(), indices));
    });
    barrier();
  }
  transform(memory, count / n, n, op.getInverse());
}

//===----------------------------------------------------------------------===//
// Any length
//===----------------------------------------------------------------------===//

/// As jk = (j^2 + k^2 - (k - j)^2) / 2, with c(j) = exp(-pi i j^2 / n): the
/// product of x and c is convolved with the conjugate of c, which stages do,
/// and multiplied by c.
/// L. Bluestein, A linear filtering approach to the computation of discrete
/// Fourier transform, 1970.
void TileLowering::lowerFftChirps(TileFftOp op) {
  TileType type = tileType(op.getTile());
  ArrayRef<int64_t> shape = type.getShape();
  int64_t n = shape.back(), rows = type.getNumElements() / n;
  int64_t m = getFftLength(op, FftMethod::Chirps);
  Type pair = type.getElementType(), real = getElementScalar(pair);
  int64_t offset = scratchOf(op), bytes = m * getByteSize(pair);
  bool inverse = op.getInverse();
  // j^2 reduced first: large multiples of an angle are inexact.
  auto chirp = [&](Value j, bool conjugate) {
    Value wide = arith::ExtUIOp::create(b, loc, b.getI64Type(), j);
    Value square = arith::MulIOp::create(b, loc, wide, wide);
    Value period =
        arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(2 * n));
    Value step = arith::RemUIOp::create(b, loc, square, period);
    return twiddle(real, arith::TruncIOp::create(b, loc, i32, step), 2 * n,
                   inverse != conjugate);
  };
  int64_t staged = (callsForTiles(kernel, threads) ? 3 : rows) * m;
  Value work = arrayAt(offset, rows * m, pair);
  Value filter = arrayAt(offset + rows * bytes, m, pair);
  Value other = arrayAt(offset + (rows + 1) * bytes, staged, pair);
  auto at = [&](Value row, Value j) { return add(mul(row, number(m)), j); };
  share({rows, m}, [&](ValueRange rj) {
    Value inside = less(rj[1], number(n));
    Value made = ifHolds(inside, pair, [&]() -> Value {
      Value flat = add(mul(rj[0], number(n)), rj[1]);
      return complexMul(element(op.getTile(), unravel(flat, shape)),
                        chirp(rj[1], false));
    });
    StoreOp::create(b, loc, made, work, at(rj[0], rj[1]));
  });
  share({m}, [&](ValueRange j) {
    Value back = sub(number(m), j[0]);
    Value distance = arith::MinSIOp::create(b, loc, j[0], back);
    Value made = ifHolds(less(distance, number(n)), pair,
                         [&] { return chirp(distance, true); });
    StoreOp::create(b, loc, made, filter, j[0]);
  });
  barrier();
  std::array<Value, 2> places{work, other}, filters{filter, other};
  auto run = [&](std::array<Value, 2> &memory, int64_t rows, bool inverse) {
    if (transform(memory, rows, m, inverse))
      std::swap(memory[0], memory[1]);
  };
  run(filters, 1, false);
  // Stages of the rows need the memory that the filter may be in now.
  if (filters[0] == other) {
    share({m}, [&](ValueRange j) {
      Value value = LoadOp::create(b, loc, pair, other, j[0]);
      StoreOp::create(b, loc, value, filter, j[0]);
    });
    barrier();
  }
  run(places, rows, false);
  share({rows, m}, [&](ValueRange rj) {
    Value x = LoadOp::create(b, loc, pair, places[0], at(rj[0], rj[1]));
    Value y = LoadOp::create(b, loc, pair, filter, rj[1]);
    StoreOp::create(b, loc, complexMul(x, y), places[0], at(rj[0], rj[1]));
  });
  barrier();
  run(places, rows, true);
  share({rows, n}, [&](ValueRange rk) {
    Value x = LoadOp::create(b, loc, pair, places[0], at(rk[0], rk[1]));
    Value made = builtin("mul", {complexMul(x, chirp(rk[1], false)),
                                 constant(real, 1.0 / double(m))});
    Value flat = add(mul(rk[0], number(n)), rk[1]);
    store(op.getResult(), unravel(flat, shape), made);
  });
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
