//===- TileScratch.cpp - What operations on tiles need on the way ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "TileScratch.h"

#include "TileForms.h"

#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::tiles {

static int64_t bytesOf(Value tile) { return getTileBytes(tileType(tile)); }

//===----------------------------------------------------------------------===//
// Products
//===----------------------------------------------------------------------===//

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

//===----------------------------------------------------------------------===//
// Fourier transforms
//===----------------------------------------------------------------------===//

/// Shorter ones are summed as fast, and more on a GPU than its memory has room
/// for beside other tiles.
constexpr int64_t longestSums = 16, mostChirpBytes = 24 << 10;

int64_t getFftLength(TileFftOp op, FftMethod method) {
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

FftMethod getFftMethod(TileFftOp op, int64_t threads) {
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

//===----------------------------------------------------------------------===//
// All
//===----------------------------------------------------------------------===//

int64_t getSortedElements(TileSortOp op) {
  return llvm::PowerOf2Ceil(tileType(op.getKeys()).getNumElements());
}

int64_t getRowsBytes(TileType matrix) {
  constexpr int64_t vector = 64;
  int64_t row = llvm::alignTo(
      matrix.getShape()[0] * getByteSize(matrix.getElementType()), vector);
  return row * row / getByteSize(matrix.getElementType());
}

int64_t getScratchBytes(Operation *op, int64_t threads) {
  if (op->hasAttr(attr::form))
    return getFormBytes(op, threads);
  if (auto fft = dyn_cast<TileFftOp>(op))
    return getFftBytes(fft, threads);
  if (auto sort = dyn_cast<TileSortOp>(op)) {
    // Keys of 8 bytes and positions of 4; merging goes to a second memory.
    int64_t count = tileType(sort.getKeys()).getNumElements();
    return callsForTiles(op, threads) ? 20 * count
                                      : 12 * getSortedElements(sort);
  }
  if (callsForTiles(op, threads)) {
    if (auto product = dyn_cast<TileMatmulOp>(op))
      return ProductOperands(product).bytes;
    if (auto factor = dyn_cast<TileCholeskyOp>(op))
      return getRowsBytes(tileType(factor.getTile()));
    if (auto adjoint = dyn_cast<TileCholeskyAdjointOp>(op))
      return 2 * getRowsBytes(tileType(adjoint.getFactor())) +
             (getStrided(adjoint.getFactor()) ? 0
                                              : bytesOf(adjoint.getFactor()));
    if (auto solve = dyn_cast<TileSolveOp>(op))
      return getStrided(solve.getMatrix()) ? 0 : bytesOf(solve.getMatrix());
    return 0;
  }
  if (threads == 1)
    return 0;
  // One value per thread, and for positions of extrema another one.
  if (isa<TileReduceOp, TileArgReduceOp, TileScanOp, TileFoldOp>(op)) {
    Type element = tileType(op->getOperand(0)).getElementType();
    return threads * (getByteSize(element) + 8);
  }
  return 0;
}

} // namespace warp::tiles
