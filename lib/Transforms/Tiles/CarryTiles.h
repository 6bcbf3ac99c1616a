//===- CarryTiles.h - Carried tiles as values of threads --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_CARRYTILES_H
#define WARP_TRANSFORMS_TILES_CARRYTILES_H

#include "TileBuffers.h"

namespace warp::tiles {

/// Lets loops and branches carry values of threads in place of tiles that have
/// one element per thread.
void carryTiles(mlir::FunctionOpInterface kernel, int64_t threads);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_CARRYTILES_H
