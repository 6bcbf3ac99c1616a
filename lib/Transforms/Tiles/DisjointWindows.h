//===- DisjointWindows.h - Windows of single blocks ----------- -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_DISJOINTWINDOWS_H
#define WARP_TRANSFORMS_TILES_DISJOINTWINDOWS_H

#include "Analysis/Forms.h"
#include "TileBuffers.h"

#include <optional>

namespace warp::tiles {

/// Along each dimension of the launch: how many elements the window of a thread
/// is from that of the next, if no others touch it; 0 if that is not known.
using DisjointSteps = llvm::SmallVector<int64_t, 4>;

/// The steps of an update: blocks that differ in a dimension with a step touch
/// different elements, in all that the kernel does with the array. None
/// if there is no such dimension. On a CPU a thread is a block, and on a GPU a
/// block has the threads of the last dimension, if that is as long.
std::optional<DisjointSteps> findDisjointSteps(mlir::FunctionOpInterface kernel,
                                               TileAccessOp update);

/// The step c of windows within [c i, c i + c) along an axis, i the index of
/// the thread in a dimension of the launch; 0 if they are not known to be.
int64_t getDisjointStep(const Form &first, int64_t extent, unsigned dim);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_DISJOINTWINDOWS_H
