//===- GridReads.h - Reads of grid and thread indices -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_GRIDREADS_H
#define WARP_LIB_ANALYSIS_GRIDREADS_H

#include "mlir/IR/Value.h"

#include <optional>

namespace warp {

enum class Axis { x, y, z };

/// The place of a thread in the grid of its launch; a lane id has no axis.
enum class GridValue { threadId, blockId, blockDim, gridDim, laneId };

struct GridRead {
  GridValue value;
  Axis axis;
};

/// The value that is read, with or without a cast from `index`.
std::optional<GridRead> getGridRead(mlir::Value value);

} // namespace warp

#endif // WARP_LIB_ANALYSIS_GRIDREADS_H
