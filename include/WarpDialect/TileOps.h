//===- TileOps.h - Operations on tiles --------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_TILEOPS_H
#define WARPDIALECT_TILEOPS_H

#include "WarpDialect/TileAttributes.h"
#include "WarpDialect/TileTypes.h"
#include "WarpDialect/WarpOps.h"

#include "llvm/Support/ErrorHandling.h"

namespace warp {

namespace autodiff {
class TileReverse;
} // namespace autodiff
namespace tiles {
class TileLowering;
} // namespace tiles

/// The threads that read elements of an operand.
enum class TileRead {
  /// Any thread, any number of times.
  Any,
  /// Any thread, each element once.
  Once,
  /// Its owner, once.
  Own
};

/// A function of the device library that computes an operation on a GPU.
struct TileFunction {
  /// The ending of its name: columns, rows or elements of a thread; 0 if there
  /// is no function for the operation.
  int64_t variant = 0;
  /// The operand that it reads as a matrix with a pitch.
  std::optional<unsigned> matrix;
  /// The result is such a matrix.
  bool givesMatrix = false;
  /// Rows of a matrix that it factors, and registers that a thread needs.
  int64_t rows = 0, registers = 0;
};

} // namespace warp

#include "WarpDialect/WarpTileInterfaces.h.inc"
#define GET_OP_CLASSES
#include "WarpDialect/WarpTileOps.h.inc"

namespace warp {

/// True if an operation takes or gives a tile.
bool isTileOp(mlir::Operation *op);
/// The type of a reduced tile: one element, or one less dimension.
TileType getReducedType(TileType tile, std::optional<int64_t> axis,
                        mlir::Type element);

/// Type of the part of an element that a path of `warp.tile_set` leads to; null
/// if it leads nowhere.
mlir::Type getPartType(mlir::Type element, mlir::ArrayAttr path);

} // namespace warp

#endif // WARPDIALECT_TILEOPS_H
