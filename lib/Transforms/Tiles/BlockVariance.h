//===- BlockVariance.h - Divergence within a block --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A value differs between threads of a block if it comes from the number of the
// thread, from what a thread loads there, or from an atomic. All threads that
// load at the same index get the same value.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_BLOCKVARIANCE_H
#define WARP_TRANSFORMS_TILES_BLOCKVARIANCE_H

#include "TileBuffers.h"

namespace warp::tiles {

/// All threads of a block do it together. Elements may be read by any of them.
inline bool isCollective(mlir::Operation *op) {
  return mlir::isa<BarrierOp>(op) ||
         (computesTiles(op) && !mlir::isa<TileGetOp>(op));
}

/// Values that may differ between the threads of a block.
class BlockVariance {
public:
  /// True if a block's threads agree on a value that comes from what differs:
  /// the number of the block.
  bool isBlockNumber(mlir::Operation *op) const;
  explicit BlockVariance(mlir::FunctionOpInterface kernel);
  bool contains(mlir::Value value) const { return values.contains(value); }
  bool anyOf(mlir::ValueRange operands) const;

private:
  bool mark(mlir::ValueRange results);
  bool visit(mlir::Operation *op);
  bool visitRegions(mlir::Operation *op);

  size_t rank;
  int64_t threads;
  bool isRagged;
  llvm::DenseSet<mlir::Value> values;
};

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_BLOCKVARIANCE_H
