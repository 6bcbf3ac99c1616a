//===- Quantised.h - Grids of quantised voxels ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Types Fp4, Fp8 and Fp16 have as many bits, FpN has 1, 2, 4, 8 or 16 in each
// leaf. A voxel is its number times the leaf's quantum, plus the leaf's
// minimum. All but the leaves is as in a grid of floats, which they become.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_VOLUMES_QUANTISED_H
#define WARP_LIB_GEOMETRY_VOLUMES_QUANTISED_H

#include "warp/VoxelGrids.h"

namespace warp::geometry {

/// The grids of some bytes, one behind the other; the same if none is of few
/// bits. Throws if a grid is damaged.
GridBytes expandGrids(const GridBytes &grids);

/// One behind the other.
GridBytes joinGrids(const std::vector<GridBytes> &parts);

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_VOLUMES_QUANTISED_H
