//===- Volume.h - NanoVDB tree access ---------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A grid is a NanoVDB buffer, version 32: a root with a table of tiles, upper
// nodes of 32^3 children, lower nodes of 16^3, leaves of 8^3 voxels. Offsets
// depend on the type of the values alone; the slot has them, so one function
// serves all types. The host has checked every offset of the buffer.
//
// If leaves are dense the host adds a table of them, so that most voxels are
// found without a walk from the root.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_VOLUME_H
#define WARP_DEVICELIB_GEOMETRY_VOLUME_H

#include "Vectors.h"

#include "DeviceLib/Prototypes.h"

namespace warp::geometry {

/// The slot of a Volume; lib/Geometry/Volumes/Contents.cpp
/// writes it, and kernels that build grids on a device do.
struct VolumeSlot {
  u64 tag;
  const u8 *grid, *root, *leaves;
  /// The type of values, as files number them; tiles of the root.
  u32 type, tiles;
  u64 voxels;
  /// From values in leaves to their gradients, or 0.
  u64 gradient;
  u32 background, rootSize, tileSize, tileValue;
  u32 upperTable, lowerTable, tableStride;
  u32 leafTable, valueSize, leafSize;
  const u8 *leavesEnd;
  /// Numbers of leaves in a box of leaves, x slowest; null without one.
  const u32 *numbers;
  /// The lowest leaf of the box and how many there are, in units of leaves.
  i32 lowest[3];
  u32 extent[3];
};
static_assert(sizeof(VolumeSlot) == 136);

struct Voxel {
  i32 x, y, z;
  /// Its place in its leaf.
  u32 inLeaf() const { return u32((x & 7) << 6 | (y & 7) << 3 | (z & 7)); }
};

/// The address of a value, or of the leaf that holds it.
struct VoxelPlace {
  const u8 *at;
  bool isLeaf;
};

template <class T> T readAt(const u8 *address) {
  return *reinterpret_cast<const T *>(address);
}

constexpr u32 boxSize = 24, flagsSize = 8;

/// A child of an inner node, or the value in its place.
inline VoxelPlace childOf(const u8 *node, u32 n, u32 maskBytes, u32 table,
                          u32 stride) {
  const u8 *children = node + boxSize + flagsSize + maskBytes;
  const u8 *entry = node + table + n * stride;
  bool isChild = children[n >> 3] >> (n & 7) & 1;
  return {isChild ? node + readAt<i64>(entry) : entry, isChild};
}

constexpr u32 noLeaf = 0xffffffff;

/// The leaf of a voxel by the table of leaves, or null.
inline const u8 *findLeaf(const VolumeSlot &volume, Voxel v) {
  u32 x = u32((v.x >> 3) - volume.lowest[0]);
  u32 y = u32((v.y >> 3) - volume.lowest[1]);
  u32 z = u32((v.z >> 3) - volume.lowest[2]);
  if (x >= volume.extent[0] || y >= volume.extent[1] || z >= volume.extent[2])
    return nullptr;
  u32 n = volume.numbers[(x * volume.extent[1] + y) * volume.extent[2] + z];
  return n == noLeaf ? nullptr : volume.leaves + u64(n) * volume.leafSize;
}

inline VoxelPlace findVoxel(const VolumeSlot &volume, Voxel v) {
  if (const u8 *leaf = findLeaf(volume, v))
    return {leaf, true};
  u64 key = u64(u32(v.z) >> 12) | u64(u32(v.y) >> 12) << 21 |
            u64(u32(v.x) >> 12) << 42;
  const u8 *tile = volume.root + volume.rootSize;
  u32 left = volume.tiles;
  while (left && readAt<u64>(tile) != key) {
    tile += volume.tileSize;
    --left;
  }
  if (!left)
    return {volume.root + volume.background, false};
  i64 child = readAt<i64>(tile + 8);
  if (!child)
    return {tile + volume.tileValue, false};
  u32 n =
      u32((v.x & 4095) >> 7 << 10 | (v.y & 4095) >> 7 << 5 | (v.z & 4095) >> 7);
  VoxelPlace lower = childOf(volume.root + child, n, 4096, volume.upperTable,
                             volume.tableStride);
  if (!lower.isLeaf)
    return lower;
  n = u32((v.x & 127) >> 3 << 8 | (v.y & 127) >> 3 << 4 | (v.z & 127) >> 3);
  return childOf(lower.at, n, 512, volume.lowerTable, volume.tableStride);
}

inline const u8 *valueAt(const VolumeSlot &volume, VoxelPlace place, Voxel v) {
  return place.isLeaf
             ? place.at + volume.leafTable + v.inLeaf() * volume.valueSize
             : place.at;
}

/// Types of grids whose voxels have a number in place of a value.
enum : u32 { indexGrid = 19, onIndex = 20, indexMask = 21, onIndexMask = 22 };

constexpr u32 leafMask = 16, leafFirst = 80;

/// The number of a voxel, from 0; -1 without one.
inline i32 indexAt(const VolumeSlot &volume, VoxelPlace place, Voxel v) {
  if (!place.isLeaf)
    return -1;
  u32 n = v.inLeaf();
  if (volume.type < indexGrid || volume.type > onIndexMask)
    return i32(u64(place.at - volume.leaves) / volume.leafSize * 512 + n);
  u64 first = readAt<u64>(place.at + leafFirst);
  if (volume.type == indexGrid || volume.type == indexMask)
    return i32(first + n) - 1;
  auto *mask = reinterpret_cast<const u64 *>(place.at + leafMask);
  u64 bit = u64(1) << (n & 63);
  if (!(mask[n >> 6] & bit))
    return -1;
  for (u32 word = 0; word < n >> 6; ++word)
    first += u64(__builtin_popcountll(mask[word]));
  return i32(first + u64(__builtin_popcountll(mask[n >> 6] & (bit - 1)))) - 1;
}

/// In which directions the cell that starts at a voxel leaves its leaf: bits of
/// the corners there.
inline u32 crossedBy(Voxel v) {
  return u32((v.x & 7) == 7) << 2 | u32((v.y & 7) == 7) << 1 |
         u32((v.z & 7) == 7);
}

/// The place of a value, in numbers of its kind from the grid's first byte on.
/// The kernel language reads them (python/warp/_src/geometry/volumes/cells.py).
/// Tables do not know it of all values.
constexpr u64 unknown = ~u64(0);

/// The logarithm of the size of the numbers in values of a type.
inline u32 numberShift(u32 type) {
  constexpr u32 float64 = 2, int64 = 5, vec3d = 7, vec4d = 18;
  bool isWide =
      type == float64 || type == int64 || type == vec3d || type == vec4d;
  return isWide ? 3 : 2;
}

inline u64 numberAt(const VolumeSlot &volume, VoxelPlace place, Voxel v) {
  return u64(valueAt(volume, place, v) - volume.grid) >>
         numberShift(volume.type);
}

/// The leaves of a cell's corners by the table of leaves, z fastest; false if
/// one is not there. No step depends on another.
inline bool findLeaves(const VolumeSlot &volume, Voxel v, u32 (&leaves)[8]) {
  const i32 from[3] = {v.x, v.y, v.z};
  u32 at[3][2];
  bool isThere = true;
  for (int axis = 0; axis < 3; ++axis) {
    i32 next = i32(u32(from[axis]) + 1);
    at[axis][0] = u32((from[axis] >> 3) - volume.lowest[axis]);
    at[axis][1] = u32((next >> 3) - volume.lowest[axis]);
    u32 last = at[axis][0] > at[axis][1] ? at[axis][0] : at[axis][1];
    isThere &= last < volume.extent[axis];
  }
  if (!isThere)
    return false;
  for (u32 corner = 0; corner < 8; ++corner) {
    u32 row = at[0][corner >> 2] * volume.extent[1] + at[1][corner >> 1 & 1];
    leaves[corner] = volume.numbers[row * volume.extent[2] + at[2][corner & 1]];
    isThere &= leaves[corner] != noLeaf;
  }
  return isThere;
}

/// The corner of a cell that starts at a voxel.
inline Voxel cornerOf(Voxel v, u32 corner) {
  return {i32(u32(v.x) + (corner >> 2)), i32(u32(v.y) + (corner >> 1 & 1)),
          i32(u32(v.z) + (corner & 1))};
}

/// Calls `visit(corner, place, voxel)` for the corners of the cell that starts
/// at a voxel, z fastest; one descent for each leaf that the cell touches.
template <class Visit>
void forCorners(const VolumeSlot &volume, Voxel v, Visit &&visit) {
  u32 crossed = crossedBy(v);
  VoxelPlace places[8];
  for (u32 corner = 0; corner < 8; ++corner) {
    Voxel at = cornerOf(v, corner);
    u32 first = corner & crossed;
    places[corner] = first == corner ? findVoxel(volume, at) : places[first];
    visit(corner, places[corner], at);
  }
}

/// The place at which leaves begin.
inline u64 firstLeaf(const VolumeSlot &volume, u32 type) {
  return u64(volume.leaves - volume.grid) >> numberShift(type);
}

/// The walk from the root is called by kernels on GPUs; the table lookup is
/// inlined into them.
#ifdef WARP_GPU
#define WARP_WALK __attribute__((noinline)) static
#else
#define WARP_WALK inline
#endif

WARP_WALK void walkCell(const VolumeSlot &volume, Voxel v, CellPlaces &places) {
  forCorners(volume, v, [&](u32 corner, VoxelPlace place, Voxel at) {
    places.at[corner] = numberAt(volume, place, at);
  });
}

WARP_WALK u64 walkValue(const VolumeSlot &volume, Voxel v) {
  return numberAt(volume, findVoxel(volume, v), v);
}

/// Calls `put(corner, place)` with the places of the values of a cell, whose
/// type is that of the grid.
template <class Put>
void findCell(const VolumeSlot &volume, u32 type, Voxel v, Put &&put) {
  u32 shift = numberShift(type), leaves[8];
#ifndef WARP_GPU
  // Two of three cells are in one leaf, or in one value of many voxels. Threads
  // of a GPU would wait for the others.
  if (crossedBy(v) == 0) {
    VoxelPlace place = findVoxel(volume, v);
    u64 first = numberAt(volume, place, v);
    u32 step = place.isLeaf ? volume.valueSize >> shift : 0;
    for (u32 corner = 0; corner < 8; ++corner)
      put(corner, first + step * ((corner >> 2) * 64 + (corner >> 1 & 1) * 8 +
                                  (corner & 1)));
    return;
  }
#endif
  if (findLeaves(volume, v, leaves)) {
    u64 size = volume.leafSize >> shift, start = firstLeaf(volume, type);
    for (u32 corner = 0; corner < 8; ++corner) {
      u32 n = cornerOf(v, corner).inLeaf();
      put(corner, start + leaves[corner] * size +
                      ((volume.leafTable + n * volume.valueSize) >> shift));
    }
    return;
  }
  CellPlaces walked;
  walkCell(volume, v, walked);
  for (u32 corner = 0; corner < 8; ++corner)
    put(corner, walked.at[corner]);
}

inline u64 findValue(const VolumeSlot &volume, Voxel v) {
  const u8 *leaf = findLeaf(volume, v);
  return leaf ? numberAt(volume, {leaf, true}, v) : walkValue(volume, v);
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_VOLUME_H
