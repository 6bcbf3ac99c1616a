//===- TileAttributes.h - Layouts of tiles ----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_TILEATTRIBUTES_H
#define WARPDIALECT_TILEATTRIBUTES_H

#include "WarpDialect/WarpOps.h"

#include "WarpDialect/WarpTileEnums.h.inc"
#define GET_ATTRDEF_CLASSES
#include "WarpDialect/WarpTileAttributes.h.inc"

namespace warp {

namespace attr {
/// On an operation that gives tiles: their `TileLayoutAttr`.
constexpr llvm::StringLiteral layout = "warp.layout";
/// On an operation on tiles: its `TileFunctionAttr`.
constexpr llvm::StringLiteral function = "warp.function";
} // namespace attr

/// Verifies `warp.layout` and `warp.function`.
mlir::LogicalResult verifyTileAttribute(mlir::Operation *op,
                                        mlir::NamedAttribute attribute);

} // namespace warp

#endif // WARPDIALECT_TILEATTRIBUTES_H
