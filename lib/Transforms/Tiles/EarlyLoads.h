//===- EarlyLoads.h - Hoisting of independent loads -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_EARLYLOADS_H
#define WARP_TRANSFORMS_TILES_EARLYLOADS_H

#include "TileBuffers.h"

namespace warp::tiles {

/// Moves loads into registers of GPU threads, and what says where updates of
/// arrays lie, to where the block has computed little yet.
void hoistLoads(mlir::FunctionOpInterface kernel, int64_t threads);

/// Moves stores of constants on GPUs behind all that does not need them.
void sinkConstants(mlir::FunctionOpInterface kernel);

/// The first operation before which the old elements of an update may be
/// loaded, if no other block touches them; the update itself if there is none.
mlir::Operation *findEarliest(TileAccessOp update);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_EARLYLOADS_H
