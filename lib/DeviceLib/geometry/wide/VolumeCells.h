//===- VolumeCells.h - Vectorised voxel cells -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If leaves are dense, the places of a cell's values follow from eight
// numbers of the table of leaves without a branch: a loop that the compiler
// makes one of vectors. Other cells are walked from the root.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_WIDE_VOLUMECELLS_H
#define WARP_DEVICELIB_GEOMETRY_WIDE_VOLUMECELLS_H

#include "../Volume.h"

namespace warp::geometry {

/// Voxels, or those at which cells begin, as many as there are lanes.
struct CellLanes {
  const i32 *x, *y, *z;
  u32 count;

  Voxel operator[](u32 n) const { return {x[n], y[n], z[n]}; }
};

/// A coordinate of a voxel and of the next one: in which leaf of the box of
/// leaves, and which slice of a leaf.
struct LaneAxis {
  u32 leaf[2], slice[2];
  bool isWithin;

  LaneAxis(i32 first, i32 lowest, u32 extent) {
    i32 second = i32(u32(first) + 1);
    leaf[0] = u32((first >> 3) - lowest);
    leaf[1] = u32((second >> 3) - lowest);
    slice[0] = u32(first) & 7;
    slice[1] = u32(second) & 7;
    isWithin = bool(u32(leaf[0] < extent) & u32(leaf[1] < extent));
  }
};

/// Writes the places of the values of voxels by the table of leaves; `unknown`
/// for those that it does not have. Returns whether there are any.
inline bool findValuesByTable(const VolumeSlot &volume, CellLanes voxels,
                              u64 *places) {
  u32 shift = numberShift(volume.type), missing = 0;
  u64 leafSize = volume.leafSize >> shift;
  const u64 start = firstLeaf(volume, volume.type);
  u32 table = volume.leafTable >> shift, value = volume.valueSize >> shift;
  const u32 *numbers = volume.numbers;
  const u32 wide = volume.extent[1], deep = volume.extent[2];
#pragma clang loop vectorize(enable) interleave(disable)
  for (u32 n = 0; n < voxels.count; ++n) {
    i32 i = voxels.x[n], j = voxels.y[n], k = voxels.z[n];
    u32 x = u32((i >> 3) - volume.lowest[0]);
    u32 y = u32((j >> 3) - volume.lowest[1]);
    u32 z = u32((k >> 3) - volume.lowest[2]);
    u32 isThere = u32(x < volume.extent[0]) & u32(y < wide) & u32(z < deep);
    u32 leaf = numbers[isThere ? (x * wide + y) * deep + z : 0];
    isThere &= u32(i32(leaf) >= 0);
    u32 inLeaf = u32((i & 7) << 6 | (j & 7) << 3 | (k & 7));
    places[n] =
        isThere ? start + leaf * leafSize + (table + inLeaf * value) : unknown;
    missing |= isThere ^ 1;
  }
  return missing;
}

inline void findValues(const VolumeSlot &volume, CellLanes voxels,
                       u64 *places) {
  if (volume.numbers && !findValuesByTable(volume, voxels, places))
    return;
  for (u32 n = 0; n < voxels.count; ++n)
    if (!volume.numbers || places[n] == unknown)
      places[n] = findValue(volume, voxels[n]);
}

/// Writes the places of the values of cells, corner by corner, by the table of
/// leaves; `unknown` for the first corner of those that it does not have.
/// Returns whether there are any.
inline bool findCellsByTable(const VolumeSlot &volume, CellLanes cells,
                             u64 *places) {
  u32 shift = numberShift(volume.type), count = cells.count, missing = 0;
  u64 leafSize = volume.leafSize >> shift;
  const u64 start = firstLeaf(volume, volume.type);
  u32 table = volume.leafTable >> shift, value = volume.valueSize >> shift;
  const u32 *numbers = volume.numbers;
  const u32 wide = volume.extent[1], deep = volume.extent[2];
#pragma clang loop vectorize(enable) interleave(disable)
  for (u32 n = 0; n < count; ++n) {
    LaneAxis x(cells.x[n], volume.lowest[0], volume.extent[0]);
    LaneAxis y(cells.y[n], volume.lowest[1], wide);
    LaneAxis z(cells.z[n], volume.lowest[2], deep);
    u32 isThere = u32(x.isWithin) & u32(y.isWithin) & u32(z.isWithin);
    u32 leaves[8], all = 0;
#pragma clang loop unroll(full)
    for (u32 corner = 0; corner < 8; ++corner) {
      u32 row = x.leaf[corner >> 2] * wide + y.leaf[corner >> 1 & 1];
      u32 at = row * deep + z.leaf[corner & 1];
      leaves[corner] = numbers[isThere ? at : 0];
      // No leaf has the highest bit.
      all |= leaves[corner];
    }
    isThere &= u32(i32(all) >= 0);
#pragma clang loop unroll(full)
    for (u32 corner = 0; corner < 8; ++corner) {
      u32 inLeaf = x.slice[corner >> 2] << 6 | y.slice[corner >> 1 & 1] << 3 |
                   z.slice[corner & 1];
      u64 place = start + leaves[corner] * leafSize + (table + inLeaf * value);
      places[corner * count + n] = isThere ? place : unknown;
    }
    missing |= isThere ^ 1;
  }
  return missing;
}

/// Asks memory for the slices x and x + 1 of cells in leaves: all lanes wait
/// for it at once.
inline void prefetchCells(const VolumeSlot &volume, u32 count,
                          const u64 *places) {
  u32 shift = numberShift(volume.type);
  for (u32 n = 0; n < count; ++n) {
    __builtin_prefetch(volume.grid + (places[n] << shift));
    __builtin_prefetch(volume.grid + (places[4 * count + n] << shift));
  }
}

/// The places of the values of cells, corner by corner.
inline void findCells(const VolumeSlot &volume, u32 type, CellLanes cells,
                      u64 *places) {
  if (volume.numbers && !findCellsByTable(volume, cells, places))
    return prefetchCells(volume, cells.count, places);
  for (u32 n = 0; n < cells.count; ++n)
    if (!volume.numbers || places[n] == unknown)
      findCell(volume, type, cells[n], [&](u32 corner, u64 place) {
        places[corner * cells.count + n] = place;
      });
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_WIDE_VOLUMECELLS_H
