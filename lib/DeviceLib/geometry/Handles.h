//===- Handles.h - Memory behind handles of geometry ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A handle that is not, or no longer, one of the right kind finds nothing; that
// of another device is not even looked at.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_HANDLES_H
#define WARP_DEVICELIB_GEOMETRY_HANDLES_H

#include "Tree.h"
#include "Volume.h"

#include "DeviceLib/Prototypes.h"

namespace warp::geometry {
namespace {

/// As lib/Geometry/Slots.h has them.
constexpr int generationShift = 49, deviceShift = 58;
constexpr u64 slotSize = 256;

/// As include/warp/Launch.h has it.
struct ArrayDescriptor {
  const void *data, *grad;
  i32 shape[4], strides[4], rank, flags;
};

/// The contents of a slot without a handle: an empty tree.
constexpr Tree noTree{0, nullptr, nullptr, 1, 0};
constexpr ArrayDescriptor noArray{nullptr, nullptr, {}, {}, 1, 0};
constexpr struct {
  Tree tree;
  ArrayDescriptor arrays[3];
  TreeExtras extras;
} noMesh{noTree, {noArray, noArray, noArray}, {nullptr, nullptr, 0, 0}};
static_assert(__builtin_offsetof(decltype(noMesh), extras) == extrasOffset);

/// A grid of one cell with no points (lib/Geometry/HashGrid.cpp).
constexpr i32 noPoints[2] = {0, 0};
constexpr struct {
  u64 tag;
  i32 cells[3], points;
  f64 inverse;
  ArrayDescriptor starts, order, groups;
} noGrid{0,       {1, 1, 1}, 0, 0, {noPoints, nullptr, {2}, {4}, 1, 0},
         noArray, noArray};

/// A volume without voxels whose values and transform are zero.
alignas(32) constexpr u8 nothing[768] = {};
constexpr VolumeSlot noVolume{0, nothing, nothing, nothing, 0,  0, 0, 0,
                              0, 0,       0,       0,       0,  0, 0, 0,
                              0, 1,       nothing, nullptr, {}, {}};

/// The slot of a live handle of a kind that is for this device, or null.
const void *slotOf(u64 id, u64 kind) {
  u64 address = id & ((u64(1) << generationShift) - 1);
#ifdef WARP_GPU
  bool isHere = (id >> deviceShift & 31) != 0;
#else
  bool isHere = (id >> deviceShift & 31) == 0;
#endif
  if (!isHere || address < 4096 || address % slotSize)
    return nullptr;
  auto *tag = reinterpret_cast<const u64 *>(address);
  return *tag == (id >> generationShift << 8 | kind) ? tag : nullptr;
}

const VolumeSlot &volumeOf(u64 id) {
  const void *slot = slotOf(id, kindOfVolume);
  return slot ? *static_cast<const VolumeSlot *>(slot) : noVolume;
}

const Tree &treeOf(u64 id, u64 kind) {
  const void *slot = slotOf(id, kind);
  return slot ? *static_cast<const Tree *>(slot) : noTree;
}

/// The contents of a tree from `treeOf`.
const TreeExtras &extrasOf(const Tree &tree) {
  const Tree *whole = &tree == &noTree ? &noMesh.tree : &tree;
  return *reinterpret_cast<const TreeExtras *>(
      reinterpret_cast<const u8 *>(whole) + extrasOffset);
}

/// The node that a query of a tree from `treeOf` begins at: its root for -1.
/// -1 if there is no such node.
i32 startOf(const Tree &tree, i32 root) {
  if (root == -1)
    return 0;
  return u32(root) < u32(extrasOf(tree).nodeCount) ? root : -1;
}

} // namespace
} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_HANDLES_H
