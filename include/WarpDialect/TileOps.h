//===- TileOps.h - What a block of threads does together --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_TILEOPS_H
#define WARPDIALECT_TILEOPS_H

#include "WarpDialect/TileTypes.h"
#include "WarpDialect/WarpOps.h"

#include "WarpDialect/WarpTileEnums.h.inc"
#define GET_OP_CLASSES
#include "WarpDialect/WarpTileOps.h.inc"

namespace warp {

/// Whether an operation is about tiles: it takes or gives one.
bool isTileOp(mlir::Operation *op);
/// What a reduction of a tile gives: one element, or one less dimension.
TileType getReducedType(TileType tile, std::optional<int64_t> axis,
                        mlir::Type element);

/// Type of the part of an element that a path of `warp.tile_set` leads to; null
/// if it leads nowhere.
mlir::Type getPartType(mlir::Type element, mlir::ArrayAttr path);

} // namespace warp

#endif // WARPDIALECT_TILEOPS_H
