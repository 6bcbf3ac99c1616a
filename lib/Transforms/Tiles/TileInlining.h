//===- TileInlining.h - Recomputation of tiles at their uses ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TILEINLINING_H
#define WARP_TRANSFORMS_TILES_TILEINLINING_H

#include "TileBuffers.h"

#include "Analysis/ArrayOrigins.h"

namespace warp::tiles {

/// Decides which tiles are never stored. Decisions on operands
/// count, so operations are asked about in program order.
class TileInlining {
public:
  TileInlining(mlir::FunctionOpInterface kernel, int64_t threads);
  bool shouldInline(mlir::Operation *op) const;

private:
  bool isThreadIndependent(mlir::Operation *op) const;
  bool mayWrite(mlir::Operation *op, mlir::Value array) const;
  bool isUnchangedUntil(mlir::Operation *op, mlir::Operation *user) const;
  bool fits(mlir::Operation *op, mlir::Operation *user, bool isCheap) const;

  int64_t threads;
  ArrayOrigins origins;
};

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_TILEINLINING_H
