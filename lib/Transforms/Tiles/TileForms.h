//===- TileForms.h - Choose functions of the device library -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TILEFORMS_H
#define WARP_TRANSFORMS_TILES_TILEFORMS_H

#include "TileBuffers.h"

namespace warp::tiles {

/// Marks operations that the device library has functions for on a GPU, and
/// gives matrices that only those read a pitch.
void chooseFunctions(mlir::FunctionOpInterface kernel, int64_t threads);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_TILEFORMS_H
