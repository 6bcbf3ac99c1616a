//===- Grid.h - GPU grids of launches ---------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRID_H
#define WARP_LIB_RUNTIME_GRID_H

#include "warp/Kernel.h"

#include <climits>
#include <cstdint>

namespace warp {

struct Extent {
  int64_t x = 1, y = 1, z = 1;

  int64_t count() const { return x * y * z; }
};

/// Limits of a device on grids and blocks.
struct DeviceLimits {
  int64_t gridX = INT32_MAX, gridYZ = 65535;
  int64_t blockZ = 64;
};

/// Blocks of a launch, and threads of a block.
struct Grid {
  Extent blocks, block;

  int64_t threads() const { return blocks.count() * block.count(); }
  bool fits(const DeviceLimits &limits) const {
    return blocks.x <= limits.gridX && blocks.y <= limits.gridYZ &&
           blocks.z <= limits.gridYZ;
  }
};

/// Threads of a launch that has several indices for some: in all, if each index
/// had the threads that `splitReduction` gives it only once.
int64_t coarsenedThreads(const Schedule &schedule, const LaunchDim &dim);

/// The grid of a launch by blocks of so many threads. `flat`: the code counts
/// threads along one axis. The result may not fit the device.
Grid gridFor(const Schedule &schedule, const LaunchDim &dim, int blockDim,
             bool flat, const DeviceLimits &limits = {});

/// True if one grid axis per dimension can express a launch.
bool fitsGrid(const LaunchDim &dim, int blockDim);

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRID_H
