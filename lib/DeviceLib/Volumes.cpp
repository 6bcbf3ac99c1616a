//===- Volumes.cpp - Voxel access -----------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "geometry/Exports.h"
#include "geometry/Handles.h"
#ifndef WARP_GPU
#include "geometry/wide/VolumeCells.h"
#endif

using namespace warp::geometry;

WARP_GEOMETRY_PART warp_volume_voxel(u64 id, i32 i, i32 j, i32 k, u64 *result) {
  *result = findValue(volumeOf(id), {i, j, k});
}

WARP_GEOMETRY_PART warp_volume_cell(u64 id, i32 type, i32 i, i32 j, i32 k,
                                    CellPlaces *result) {
  findCell(volumeOf(id), u32(type), {i, j, k},
           [&](u32 corner, u64 place) { result->at[corner] = place; });
}

/// The address where a value may be stored, or 0.
WARP_GEOMETRY warp_volume_place(u64 id, i32 type, i32 i, i32 j, i32 k,
                                u64 *result) {
  const VolumeSlot &volume = volumeOf(id);
  Voxel voxel{i, j, k};
  VoxelPlace place = findVoxel(volume, voxel);
  *result = place.isLeaf && volume.type == u32(type)
                ? reinterpret_cast<u64>(valueAt(volume, place, voxel))
                : 0;
}

WARP_GEOMETRY warp_volume_index(u64 id, i32 i, i32 j, i32 k, i32 *result) {
  const VolumeSlot &volume = volumeOf(id);
  Voxel voxel{i, j, k};
  *result = indexAt(volume, findVoxel(volume, voxel), voxel);
}

WARP_GEOMETRY warp_volume_cell_index(u64 id, i32 i, i32 j, i32 k,
                                     CellIndices *result) {
  const VolumeSlot &volume = volumeOf(id);
  forCorners(volume, {i, j, k}, [&](u32 corner, VoxelPlace place, Voxel at) {
    result->index[corner] = indexAt(volume, place, at);
  });
}

#ifndef WARP_GPU

WARP_GEOMETRY warp_volume_voxel_lanes(u64 id, const i32 *i, const i32 *j,
                                      const i32 *k, i32 lanes, u64 *result) {
  findValues(volumeOf(id), {i, j, k, u32(lanes)}, result);
}

WARP_GEOMETRY warp_volume_cell_lanes(u64 id, i32 type, const i32 *i,
                                     const i32 *j, const i32 *k, i32 lanes,
                                     u64 *result) {
  findCells(volumeOf(id), u32(type), {i, j, k, u32(lanes)}, result);
}

WARP_GEOMETRY warp_volume_index_lanes(u64 id, const i32 *i, const i32 *j,
                                      const i32 *k, i32 lanes, i32 *result) {
  const VolumeSlot &volume = volumeOf(id);
  for (i32 n = 0; n < lanes; ++n) {
    Voxel voxel{i[n], j[n], k[n]};
    result[n] = indexAt(volume, findVoxel(volume, voxel), voxel);
  }
}

WARP_GEOMETRY warp_volume_cell_index_lanes(u64 id, const i32 *i, const i32 *j,
                                           const i32 *k, i32 lanes,
                                           i32 *result) {
  const VolumeSlot &volume = volumeOf(id);
  for (i32 n = 0; n < lanes; ++n)
    forCorners(volume, {i[n], j[n], k[n]},
               [&](u32 corner, VoxelPlace place, Voxel at) {
                 result[corner * u32(lanes) + u32(n)] =
                     indexAt(volume, place, at);
               });
}

#endif
