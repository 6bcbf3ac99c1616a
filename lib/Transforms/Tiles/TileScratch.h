//===- TileScratch.h - What operations on tiles need on the way -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TILESCRATCH_H
#define WARP_TRANSFORMS_TILES_TILESCRATCH_H

#include "TileBuffers.h"

namespace warp::tiles {

/// Bytes of the block's memory that an operation needs besides its tiles.
int64_t getScratchBytes(mlir::Operation *op, int64_t threads);
/// Of a square matrix in rows, and columns, of whole vectors of a CPU.
int64_t getRowsBytes(TileType matrix);

/// How the device library gets the operands of a product.
struct ProductOperands {
  explicit ProductOperands(TileMatmulOp op);

  /// What is computed with.
  mlir::Type sum;
  int64_t depth;
  bool copiesA, copiesB;
  /// To the next row and column, in the order that the product has them.
  std::array<int64_t, 2> a, b;
  /// Of copies, and of a result that is rounded in the end.
  int64_t bytes;
};

/// How rows of a tile are transformed.
enum class FftMethod {
  /// In stages; lengths are powers of two.
  Stages,
  /// As a product with a chirp, in stages of at least twice the length.
  Chirps,
  /// Every sum by itself.
  Sums
};
FftMethod getFftMethod(TileFftOp op, int64_t threads);
/// The length of the stages.
int64_t getFftLength(TileFftOp op, FftMethod method);

/// Elements that a sorting network has: a power of two.
int64_t getSortedElements(TileSortOp op);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_TILESCRATCH_H
