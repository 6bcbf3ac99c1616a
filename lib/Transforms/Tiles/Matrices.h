//===- Matrices.h - Matrices for functions of the device library *- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_MATRICES_H
#define WARP_TRANSFORMS_TILES_MATRICES_H

#include "TileBuffers.h"

namespace warp::tiles {

/// Scratch memory for a matrix that is copied before a function can read it.
inline int64_t getCopyBytes(mlir::Value matrix) {
  return getStrided(matrix) ? 0 : getTileBytes(tileType(matrix));
}

/// True if lanes of one warp can have the rows of a matrix, four each.
inline bool fitsWarp(mlir::Value matrix) {
  constexpr int64_t mostRows = 128;
  return tileType(matrix).getShape()[0] <= mostRows && getStrided(matrix);
}

/// The end of the names of functions for an element type.
inline llvm::StringRef realName(mlir::Value tile) {
  return tileType(tile).getElementType().isF32() ? "f32" : "f64";
}

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_MATRICES_H
