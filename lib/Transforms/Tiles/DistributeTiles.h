//===- DistributeTiles.h - Tiles in owners' registers --------- -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_DISTRIBUTETILES_H
#define WARP_TRANSFORMS_TILES_DISTRIBUTETILES_H

#include "TileBuffers.h"

namespace warp::tiles {

/// Marks tiles of GPU kernels of which each thread reads and writes only the
/// elements e, e + B, ... that it treats in loops: they are in registers.
void distributeTiles(mlir::FunctionOpInterface kernel, int64_t threads);

/// Marks what reductions of whole tiles give on GPUs: all threads of the block
/// come to know it, so that it is in a register of each.
void replicateElements(mlir::FunctionOpInterface kernel, int64_t threads);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_DISTRIBUTETILES_H
