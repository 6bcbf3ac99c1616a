//===- Transforms.cpp - Model of Fourier transforms -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Models.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Methods
//===----------------------------------------------------------------------===//

namespace {

/// How rows of a tile are transformed.
enum class FftMethod {
  /// In stages; lengths are powers of two.
  Stages,
  /// As a product with a chirp, in stages of at least twice the length.
  Chirps,
  /// Every sum by itself.
  Sums
};

} // namespace

/// Shorter ones are summed as fast, and more on a GPU than its memory has room
/// for beside other tiles.
constexpr int64_t longestSums = 16, mostChirpBytes = 24 << 10;

/// The length of the stages.
static int64_t getFftLength(TileFftOp op, FftMethod method) {
  int64_t n = tileType(op.getTile()).getShape().back();
  return method == FftMethod::Chirps ? llvm::PowerOf2Ceil(2 * n - 1) : n;
}

/// Rows, a chirp, and what stages of those need.
static int64_t getChirpBytes(TileFftOp op, int64_t threads) {
  TileType type = tileType(op.getTile());
  int64_t length = getFftLength(op, FftMethod::Chirps);
  int64_t rows = type.getNumElements() / type.getShape().back();
  int64_t staged = callsForTiles(op, threads) ? 3 : rows;
  return (rows + 1 + staged) * length * getByteSize(type.getElementType());
}

static FftMethod getFftMethod(TileFftOp op, int64_t threads) {
  int64_t n = tileType(op.getTile()).getShape().back();
  if (llvm::isPowerOf2_64(n))
    return FftMethod::Stages;
  bool fits = callsForTiles(op, threads) ||
              getChirpBytes(op, threads) <= mostChirpBytes;
  return n > longestSums && fits ? FftMethod::Chirps : FftMethod::Sums;
}

static int64_t getFftBytes(TileFftOp op, int64_t threads) {
  TileType type = tileType(op.getTile());
  switch (getFftMethod(op, threads)) {
  case FftMethod::Chirps:
    return getChirpBytes(op, threads);
  case FftMethod::Stages:
    if (callsForTiles(op, threads))
      return 3 * type.getShape().back() * getByteSize(type.getElementType());
    return getTileBytes(type);
  case FftMethod::Sums:
    return getTileBytes(type);
  }
  llvm_unreachable("no such method");
}

/// Elements of a thread: the fewest with which the block has a row.
static int64_t getOwnElements(TileFftOp op, int64_t threads) {
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape().back();
  if (!getElementScalar(type.getElementType()).isF32() || n < 4 ||
      getFftMethod(op, threads) != FftMethod::Stages)
    return 0;
  for (int64_t own : {4, 8, 16})
    if (own <= n && n / own <= threads)
      return own;
  return 0;
}

static int64_t getWarpBytes(TileFftOp op, int64_t threads) {
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape().back(), lanes = n / getDeviceVariant(op);
  int64_t rows = std::min(type.getNumElements() / n, threads / lanes);
  return lanes == 1 ? 0 : rows * (n + n / 8) * 8;
}

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

namespace {

struct TransformLowering : TileLowering {
  using TileLowering::TileLowering;
  void lower(TileFftOp op);
  void byWarps(TileFftOp op);

private:
  Value twiddle(Type real, Value step, int64_t period, bool inverse);
  Value complexMul(Value a, Value b);
  int transform(std::array<Value, 2> memory, int64_t rows, int64_t n,
                bool inverse);
  void byStages(TileFftOp op);
  void byChirps(TileFftOp op);
  void bySums(TileFftOp op);
};

} // namespace

/// exp(-2 pi i step / period), or its inverse.
Value TransformLowering::twiddle(Type real, Value step, int64_t period,
                                 bool inverse) {
  constexpr double turn = 6.283185307179586476925;
  Value angle = builtin(
      "mul", {cast(step, real),
              constant(real, (inverse ? turn : -turn) / double(period))});
  return ConstructOp::create(
      b, loc, VecType::get(b.getContext(), 2, real),
      ValueRange{builtin("cos", angle), builtin("sin", angle)});
}

Value TransformLowering::complexMul(Value x, Value y) {
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

void TransformLowering::lower(TileFftOp op) {
  switch (getFftMethod(op, threads)) {
  case FftMethod::Stages:
    return byStages(op);
  case FftMethod::Chirps:
    return byChirps(op);
  case FftMethod::Sums:
    return bySums(op);
  }
}

void TransformLowering::byWarps(TileFftOp op) {
  begin(op, op.getTile());
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape().back();
  Value tile = memoryOf(op.getResult()), scratch = tile;
  if (int64_t bytes = getWarpBytes(op, threads))
    scratch = arrayAt(scratchOf(op), bytes / 8, type.getElementType());
  callVariant("transform", op,
              {addressOf(tile), addressOf(scratch),
               number(type.getNumElements() / n), number(n),
               number(op.getInverse())});
}

//===----------------------------------------------------------------------===//
// Stages
//===----------------------------------------------------------------------===//

/// Transforms rows in `memory[0]`, by way of `memory[1]`; returns which of the
/// two has the result. Stockham's order: each stage reads one memory and
/// writes the other, so that no reversal of bits is needed.
int TransformLowering::transform(std::array<Value, 2> memory, int64_t rows,
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

void TransformLowering::byStages(TileFftOp op) {
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
void TransformLowering::byChirps(TileFftOp op) {
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
void TransformLowering::bySums(TileFftOp op) {
  TileType type = tileType(op.getTile());
  ArrayRef<int64_t> shape = type.getShape();
  int64_t n = shape.back(), count = type.getNumElements();
  Type pair = type.getElementType();
  Value kept = arrayAt(scratchOf(op), count, pair);
  share(shape, [&](ValueRange at) {
    StoreOp::create(b, loc, element(op.getTile(), at), kept, linear(shape, at));
  });
  barrier();
  share(shape, [&](ValueRange at) {
    Value place = linear(shape, at);
    Value row = sub(place, at.back());
    Value sum =
        loop(number(0), number(n), number(1), zero(pair),
             [&](Value j, ValueRange sums) -> Values {
               // Reduced first: large multiples of an angle are inexact.
               Value step =
                   arith::RemUIOp::create(b, loc, mul(j, at.back()), number(n));
               Value x = LoadOp::create(b, loc, pair, kept, add(row, j));
               Value turned = complexMul(x, twiddle(getElementScalar(pair),
                                                    step, n, op.getInverse()));
               return {builtin("add", {sums[0], turned})};
             })[0];
    store(op.getResult(), at, sum);
  });
}

//===----------------------------------------------------------------------===//
// Model
//===----------------------------------------------------------------------===//

namespace {

struct FftModel : TileModel<FftModel, TileFftOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {0};
  }
  TileFunction getDeviceFunction(Operation *op, int64_t threads) const {
    TileFunction function;
    function.variant = getOwnElements(cast<TileFftOp>(op), threads);
    return function;
  }
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    auto fft = cast<TileFftOp>(op);
    return op->hasAttr(warp::attr::function) ? getWarpBytes(fft, threads)
                                             : getFftBytes(fft, threads);
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto fft = cast<TileFftOp>(op);
    TransformLowering own(lowering.state);
    op->hasAttr(warp::attr::function) ? own.byWarps(fft) : own.lower(fft);
  }
  /// The other transform.
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto fft = cast<TileFftOp>(op);
    if (Value g = reverse.take())
      reverse.give(fft.getTile(),
                   TileFftOp::create(reverse.b, reverse.loc, g.getType(), g,
                                     reverse.unit(!fft.getInverse())));
    return success();
  }
};

} // namespace

void attachTransforms(MLIRContext &context) {
  TileFftOp::attachInterface<FftModel>(context);
}

} // namespace warp::tiles
