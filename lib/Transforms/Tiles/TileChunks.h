//===- TileChunks.h - Neighbours of one thread ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TILECHUNKS_H
#define WARP_TRANSFORMS_TILES_TILECHUNKS_H

#include "TileBuffers.h"

namespace warp::tiles {

/// Lets threads of a GPU kernel that only streams tiles treat four elements next
/// to each other, which 16 bytes hold: one access instead of four.
void chooseChunks(mlir::FunctionOpInterface kernel, int64_t threads);

/// Elements next to each other that a thread treats in loops over that shape.
int64_t getChunk(mlir::Operation *kernel, llvm::ArrayRef<int64_t> shape,
                 int64_t threads);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_TILECHUNKS_H
