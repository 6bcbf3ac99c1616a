//===- LowerTilesLibrary.cpp - Functions for whole tiles on CPUs ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A function of the device library gets addresses in the block's memory. An
// operand that does not lie there as the function needs it is copied first.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "WarpDialect/LibraryOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;

namespace warp::tiles {

Value TileLowering::addressOf(Value memory) {
  return PointerOp::create(b, loc, b.getIntegerType(64, false), memory);
}

void TileLowering::callLibrary(const Twine &name, Type real, ValueRange args) {
  std::string symbol = name.str();
  if (real)
    symbol += real.isF32() ? "_f32" : "_f64";
  LibraryCallOp::create(b, loc, TypeRange(), b.getStringAttr(symbol), args);
}

int64_t TileLowering::scratchOf(Operation *op) {
  return op->getAttrOfType<IntegerAttr>(attr::scratch).getInt();
}

/// Elements of a matrix in the order of its rows, or columns if it is
/// transposed, as another type, from `offset` of the block's memory on.
Value TileLowering::copyTo(int64_t offset, Value tile, Type type,
                           bool transposed) {
  TileType from = tileType(tile);
  SmallVector<int64_t> shape(from.getShape());
  if (transposed)
    std::swap(shape[0], shape[1]);
  Value memory = arrayAt(offset, from.getNumElements(), type);
  // Rows that are columns of what lies in memory.
  std::optional<Strided> strided = getStrided(tile);
  if (strided && from.getElementType() == type && from.getRank() == 2) {
    ArrayRef<int64_t> steps = strided->steps;
    int64_t across = transposed ? steps[1] : steps[0];
    if (across == 1 && shape[1] > 1) {
      callLibrary("warp_tile_turn", type,
                  {addressOf(memory), addressOf(memoryOf(strided->memory)),
                   number(shape[1]), number(shape[0]),
                   number(transposed ? steps[0] : steps[1])});
      return memory;
    }
  }
  share(shape, [&](ValueRange ij) {
    Value value = element(tile, transposed ? Values{ij[1], ij[0]} : Values(ij));
    StoreOp::create(b, loc, cast(value, type), memory, linear(shape, ij));
  });
  return memory;
}

void TileLowering::callProduct(TileMatmulOp op) {
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

void TileLowering::callCholesky(TileCholeskyOp op) {
  TileType type = tileType(op.getTile());
  Value result = op.getResult(), from = op.getTile();
  if (getStrided(from) && getStrided(from)->memory == from) {
    from = memoryOf(from);
  } else {
    share(type.getShape(),
          [&](ValueRange ij) { store(result, ij, element(op.getTile(), ij)); });
    from = memoryOf(result);
  }
  Value scratch =
      arrayAt(scratchOf(op), type.getNumElements(), type.getElementType());
  callLibrary("warp_tile_cholesky", type.getElementType(),
              {addressOf(memoryOf(result)), addressOf(from), addressOf(scratch),
               number(type.getShape()[0]), number(op.getUpper())});
}

/// A square matrix where it lies, with its steps, or a copy `behind` bytes into
/// the scratch memory of an operation.
Strided TileLowering::matrixFor(Operation *op, Value tile, int64_t behind) {
  if (std::optional<Strided> found = getStrided(tile))
    return {memoryOf(found->memory), found->steps};
  TileType type = tileType(tile);
  Value copy = copyTo(scratchOf(op) + behind, tile, type.getElementType(),
                      /*transposed=*/false);
  return {copy, {type.getShape()[0], 1}};
}

void TileLowering::callCholeskyAdjoint(TileCholeskyAdjointOp op) {
  TileType type = tileType(op.getFactor());
  int64_t n = type.getShape()[0];
  auto [memory, steps] = matrixFor(op, op.getFactor(), 2 * getRowsBytes(type));
  Value scratch =
      arrayAt(scratchOf(op),
              2 * getRowsBytes(type) / getByteSize(type.getElementType()),
              type.getElementType());
  callLibrary("warp_tile_cholesky_adjoint", type.getElementType(),
              {addressOf(memoryOf(op.getResult())), addressOf(memory),
               addressOf(scratch), number(steps[0]), number(steps[1]),
               number(n), number(op.getUpper())});
}

void TileLowering::callSolve(TileSolveOp op) {
  TileType rhs = tileType(op.getRhs()), type = tileType(op.getMatrix());
  int64_t n = rhs.getShape()[0];
  auto [memory, steps] = matrixFor(op, op.getMatrix(), 0);
  if (op.getTransposed())
    std::swap(steps[0], steps[1]);
  bool backwards = bool(op.getUpper()) != bool(op.getTransposed());
  callLibrary("warp_tile_solve", type.getElementType(),
              {addressOf(memoryOf(op.getResult())), addressOf(memory),
               number(n), number(rhs.getNumElements() / n), number(steps[0]),
               number(steps[1]), number(backwards)});
}

} // namespace warp::tiles
