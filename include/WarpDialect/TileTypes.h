//===- TileTypes.h - Tiles --------------------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_TILETYPES_H
#define WARPDIALECT_TILETYPES_H

#include "WarpDialect/WarpTypes.h"

#define GET_TYPEDEF_CLASSES
#include "WarpDialect/WarpTileTypes.h.inc"

#endif // WARPDIALECT_TILETYPES_H
