//===- Products.cpp - Models of products and diagonals --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Accumulators.h"
#include "Models.h"

#include "KernelFunction.h"
#include "Transforms/Launch/UnrollLoop.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

namespace {

/// How the device library gets the operands of a product.
struct ProductOperands {
  explicit ProductOperands(TileMatmulOp op);

  /// The type of sums.
  mlir::Type sum;
  int64_t depth;
  bool copiesA, copiesB;
  /// To the next row and column, in the order that the product has them.
  std::array<int64_t, 2> a, b;
  /// Scratch memory for copies, and for a result that is rounded in the end.
  int64_t bytes;
};

struct ProductLowering : TileLowering {
  using TileLowering::TileLowering;
  void lower(TileMatmulOp op);
  void addDiagonal(TileDiagAddOp op);

private:
  void call(TileMatmulOp op);
};

} // namespace

ProductOperands::ProductOperands(TileMatmulOp op) {
  Type out = tileType(op.getResult()).getElementType();
  sum = getByteSize(out) == 2 ? Float32Type::get(op.getContext()) : out;
  depth = tileType(op.getA()).getShape()[!op.getTransposeA()];
  bytes = 0;
  auto elements = [&](Value tile) {
    return tileType(tile).getNumElements() * getByteSize(sum);
  };
  auto place = [&](Value tile, bool transposed, bool needsRows,
                   std::array<int64_t, 2> &steps) {
    std::optional<Strided> strided = getStrided(tile);
    bool copies = !strided || tileType(tile).getElementType() != sum ||
                  (needsRows && strided->steps[!transposed] != 1);
    if (copies) {
      steps = {tileType(tile).getShape()[!transposed], 1};
      bytes += elements(tile);
    } else {
      steps = {strided->steps[transposed], strided->steps[!transposed]};
    }
    return copies;
  };
  copiesA = place(op.getA(), op.getTransposeA(), false, a);
  copiesB = place(op.getB(), op.getTransposeB(), true, b);
  if (out != sum)
    bytes += elements(op.getResult());
}

/// Factors that a thread loads at a time.
constexpr int64_t mostCopies = 32;

void ProductLowering::lower(TileMatmulOp op) {
  if (callsForTiles(kernel, threads))
    return call(op);
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
    // All factors of few sums are on their way before the first is needed.
    if (depth <= mostCopies && type.getNumElements() <= threads &&
        getTarget(kernel).isSimt())
      setCopies(total.getDefiningOp<scf::ForOp>(), depth);
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

/// By the device library, of a CPU.
void ProductLowering::call(TileMatmulOp op) {
  ProductOperands operands(op);
  Type sum = operands.sum;
  int64_t offset = operands.bytes ? scratchOf(op) : 0;
  auto place = [&](Value tile, bool transposed, bool isCopied) {
    if (!isCopied)
      return memoryOf(getStrided(tile)->memory);
    Value memory = copyTo(offset, tile, sum, transposed);
    offset += getTileBytes(
        TileType::get(b.getContext(), tileType(tile).getShape(), sum));
    return memory;
  };
  Value x = place(op.getA(), op.getTransposeA(), operands.copiesA);
  Value y = place(op.getB(), op.getTransposeB(), operands.copiesB);
  Value result = op.getResult(), to;
  bool converts = tileType(result).getElementType() != sum;
  if (converts) {
    to = op.getC() ? place(op.getC(), false, true)
                   : arrayAt(offset, tileType(result).getNumElements(), sum);
  } else {
    if (op.getC())
      begin(op, op.getC());
    to = memoryOf(result);
  }
  auto factor = [&](Value given) {
    return given ? cast(given, sum) : constant(sum, 1);
  };
  ArrayRef<int64_t> shape = tileType(result).getShape();
  callLibrary("warp_tile_product", sum,
              {addressOf(to), addressOf(x), addressOf(y), number(shape[0]),
               number(shape[1]), number(operands.depth), number(operands.a[0]),
               number(operands.a[1]), number(operands.b[0]), number(!op.getC()),
               factor(op.getAlpha()), factor(op.getBeta())});
  if (converts)
    share(shape, [&](ValueRange ij) {
      Value made = LoadOp::create(b, loc, sum, to, linear(shape, ij));
      store(result, ij, cast(made, tileType(result).getElementType()));
    });
}

void ProductLowering::addDiagonal(TileDiagAddOp op) {
  begin(op, op.getTile());
  share(tileType(op.getDiagonal()).getShape(), [&](ValueRange i) {
    Value old = load(op.getResult(), {i[0], i[0]});
    Value sum = builtin("add", {old, element(op.getDiagonal(), i)});
    store(op.getResult(), {i[0], i[0]}, sum);
  });
}

//===----------------------------------------------------------------------===//
// Adjoint
//===----------------------------------------------------------------------===//

namespace {

struct ProductAdjoint : autodiff::TileReverse {
  using TileReverse::TileReverse;
  LogicalResult multiply(TileMatmulOp matmul);
};

} // namespace

static bool isOne(Value factor) {
  auto known = factor.getDefiningOp<ConstantOp>();
  auto number = known ? dyn_cast<FloatAttr>(known.getValue()) : FloatAttr();
  return number && number.getValue().isExactlyValue(1.0);
}

LogicalResult ProductAdjoint::multiply(TileMatmulOp matmul) {
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
    give(matmul.getA(), fit(tx ? TileReverse::multiply(y, g, ty, true, alpha)
                               : TileReverse::multiply(g, y, false, !ty, alpha),
                            matmul.getA()));
  if (wants(matmul.getB()))
    give(matmul.getB(), fit(ty ? TileReverse::multiply(g, x, true, tx, alpha)
                               : TileReverse::multiply(x, g, !tx, false, alpha),
                            matmul.getB()));
  auto inner = [&](Value other, Value scale) {
    Value products = map({g, other}, [&](ValueRange e) {
      return apply(
          "mul",
          {e[0], CastOp::create(b, loc, e[0].getType(), e[1]).getResult()});
    });
    return overThreads(products, autodiff::differentialType(scale.getType()));
  };
  if (matmul.getAlpha() && wants(matmul.getAlpha()))
    give(matmul.getAlpha(),
         inner(TileReverse::multiply(x, y, tx, ty), matmul.getAlpha()));
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

//===----------------------------------------------------------------------===//
// Models
//===----------------------------------------------------------------------===//

namespace {

struct MatmulModel : TileModel<MatmulModel, TileMatmulOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *op) const {
    auto matmul = cast<TileMatmulOp>(op);
    if (matmul.getC() && matmul.getC().getType() == matmul.getType())
      return {2};
    return {};
  }
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    bool calls =
        !op->hasAttr(warp::attr::function) && callsForTiles(op, threads);
    return calls ? ProductOperands(cast<TileMatmulOp>(op)).bytes : 0;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto matmul = cast<TileMatmulOp>(op);
    if (op->hasAttr(warp::attr::function))
      AccumulatorLowering(lowering.state).multiply(matmul);
    else
      ProductLowering(lowering.state).lower(matmul);
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    return ProductAdjoint(reverse.reverse, op).multiply(cast<TileMatmulOp>(op));
  }
};

struct DiagAddModel : TileModel<DiagAddModel, TileDiagAddOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {0};
  }
  void lower(Operation *op, TileLowering &lowering) const {
    ProductLowering(lowering.state).addDiagonal(cast<TileDiagAddOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto add = cast<TileDiagAddOp>(op);
    Value g = reverse.take();
    if (!g)
      return success();
    int64_t n = tileType(add.getDiagonal()).getShape()[0];
    Value positions = reverse.iota(n, n + 1);
    reverse.give(add.getTile(), g);
    reverse.give(add.getDiagonal(),
                 TileGatherOp::create(reverse.b, reverse.loc,
                                      reverse.cotangentType(add.getDiagonal()),
                                      g, positions));
    return success();
  }
};

} // namespace

void attachProducts(MLIRContext &context) {
  TileDiagAddOp::attachInterface<DiagAddModel>(context);
  TileMatmulOp::attachInterface<MatmulModel>(context);
}

} // namespace warp::tiles
