//===- Neighbours.h - Nearly contiguous accesses of lanes -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_NEIGHBOURS_H
#define WARP_LIB_TRANSFORMS_NEIGHBOURS_H

#include "Analysis/ThreadVariance.h"

namespace warp {

namespace attr {
/// On an access of lanes to elements that may be scattered: it asks first
/// whether they follow each other.
constexpr llvm::StringLiteral neighbours = "warp.neighbours";
} // namespace attr

/// True if elements at these indices follow each other in most vectors of
/// lanes: an index is one of neighbouring threads that is kept within bounds,
/// or starts again after as many threads as a row has elements.
bool areMostlyNeighbours(mlir::ValueRange indices,
                         const ThreadVariance &variance);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_NEIGHBOURS_H
