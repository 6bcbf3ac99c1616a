//===- Build.h - NanoVDB grid serialisation ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_VOLUMES_BUILD_H
#define WARP_LIB_GEOMETRY_VOLUMES_BUILD_H

#include "Topology.h"

namespace warp::geometry {

/// A grid of a topology. Voxels of tiles are all active and have the
/// background as their value; `masks` are the active ones of index grids that
/// number those alone, by leaf.
GridBytes fillGrid(const VoxelTopology &topology, const GridRecipe &recipe,
                   const std::vector<LeafHead> *masks = nullptr);

/// The voxels of points, in the order of these.
std::vector<Int3> voxelsOf(const GridPoints &points,
                           const GridTransform &transform);

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_VOLUMES_BUILD_H
