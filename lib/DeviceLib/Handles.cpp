//===- Handles.cpp - Addresses of handle slots ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "geometry/Handles.h"
#include "geometry/Exports.h"

using namespace warp::geometry;

/// The slot of a handle, or one that has nothing.
WARP_GEOMETRY warp_slot(u64 id, i32 kind, u64 *result) {
  const void *slot = slotOf(id, u64(kind));
  const void *none = &noMesh;
  if (u64(kind) == kindOfHashGrid)
    none = &noGrid;
  if (u64(kind) == kindOfVolume)
    none = &noVolume;
  *result = reinterpret_cast<u64>(slot ? slot : none);
}

/// The node that holds a group of a Mesh or Bvh, or -1.
WARP_GEOMETRY warp_group_root(u64 id, i32 group, i32 *result) {
  const Tree &mesh = treeOf(id, kindOfMesh);
  const TreeExtras &extras =
      extrasOf(mesh.nodes ? mesh : treeOf(id, kindOfBvh));
  i32 low = 0, high = extras.groupCount;
  while (low < high) {
    i32 middle = low + (high - low) / 2;
    if (extras.groups[middle] < group)
      low = middle + 1;
    else
      high = middle;
  }
  bool isThere = low < extras.groupCount && extras.groups[low] == group;
  *result = isThere ? extras.groups[extras.groupCount + low] : -1;
}
