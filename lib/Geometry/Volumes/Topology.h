//===- Topology.h - NanoVDB topology of a list of tiles ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Tiles of 8^3 voxels are sorted by the nodes that they lie in, so that every
// level of nodes is a run; masks and tables of a level follow from the places
// of its children.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_VOLUMES_TOPOLOGY_H
#define WARP_LIB_GEOMETRY_VOLUMES_TOPOLOGY_H

#include "Layout.h"

namespace warp::geometry {

struct Int3 {
  int32_t at[3];
};

/// The place of a child in a node with 2^bits along each axis, of coordinates
/// in units of the child.
inline uint32_t cellOf(const Int3 &v, int shift, int bits) {
  uint32_t mask = (1u << bits) - 1, cell = 0;
  for (int32_t x : v.at)
    cell = cell << bits | (uint32_t(x >> shift) & mask);
  return cell;
}

struct VoxelTopology {
  /// The tiles that some voxels lie in, which may repeat.
  explicit VoxelTopology(const std::vector<Int3> &voxels);

  /// The lowest voxels of leaves, lower nodes and upper nodes, sorted.
  std::vector<Int3> leaves, lowers, uppers;
  /// The parent of each leaf and of each lower node.
  std::vector<uint32_t> lowerOf, upperOf;
  /// The leaf of each of the voxels.
  std::vector<uint32_t> leafOf;
};

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_VOLUMES_TOPOLOGY_H
