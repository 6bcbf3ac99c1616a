//===- Reductions.h - Reductions by the threads of a block ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_REDUCTIONS_H
#define WARP_TRANSFORMS_TILES_REDUCTIONS_H

#include "LowerTiles.h"

namespace warp::tiles {

struct ReductionLowering : TileLowering {
  using TileLowering::TileLowering;
  /// Gives the position of an extremum if `positions`.
  void reduce(mlir::Operation *op, TileReduction kind, Value tile,
              std::optional<int64_t> axis, bool positions);
  /// The element that changes nothing, or loses against all others.
  Value worst(TileReduction kind, mlir::Type type);
  /// Values, and with a second one their positions; the lower position wins.
  Values combine(TileReduction kind, ValueRange best, ValueRange next);

private:
  Value isBetter(TileReduction kind, Value candidate, Value best, bool orEqual);
  Values overWarps(mlir::Operation *op, TileReduction kind, Values sums,
                   int64_t part = 0);
  Values overBlock(mlir::Operation *op, TileReduction kind, Values sums);
  void reduceOrdered(mlir::Operation *op, TileReduction kind, Value tile,
                     bool positions);
};

/// Scratch memory of a reduction: one value per thread, and for positions of
/// extrema another one.
int64_t getPartialBytes(mlir::Operation *op, int64_t threads);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_REDUCTIONS_H
