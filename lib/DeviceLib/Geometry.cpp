//===- Geometry.cpp - Searches that kernels call --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One function per row of the table in lib/Dialect/LibraryOps.cpp. A handle
// that is not, or no longer, one of the right kind finds nothing; that of
// another device is not even looked at.
//
//===----------------------------------------------------------------------===//

#include "geometry/Crossings.h"
#include "geometry/Exports.h"
#include "geometry/Overlap.h"
#include "geometry/Predicates.h"
#include "geometry/Search.h"
#include "geometry/Shares.h"
#include "geometry/Sign.h"
#include "geometry/Volume.h"
#include "geometry/Winding.h"
#ifndef __NVPTX__
#include "geometry/wide/VolumeCells.h"
#endif

using namespace warp::geometry;

namespace {

/// As lib/Geometry/Slots.h and include/warp/Handle.h have them.
constexpr int generationShift = 49, deviceShift = 58;
constexpr u64 slotSize = 256;
constexpr u64 kindOfGrid = 1, kindOfBvh = 2, kindOfMesh = 3, kindOfVolume = 4;

/// As include/warp/Launch.h has it.
struct ArrayDescriptor {
  const void *data, *grad;
  i32 shape[4], strides[4], rank, flags;
};

/// What a slot is without a handle: an empty tree.
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
#ifdef __NVPTX__
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

/// What belongs to a tree from `treeOf`.
const TreeExtras &extrasOf(const Tree &tree) {
  const Tree *whole = &tree == &noTree ? &noMesh.tree : &tree;
  return *reinterpret_cast<const TreeExtras *>(
      reinterpret_cast<const u8 *>(whole) + extrasOffset);
}

} // namespace

/// Where a handle's slot is, or one that has nothing.
WARP_GEOMETRY warp_slot(u64 id, i32 kind, u64 *result) {
  const void *slot = slotOf(id, u64(kind));
  const void *none = &noMesh;
  if (u64(kind) == kindOfGrid)
    none = &noGrid;
  if (u64(kind) == kindOfVolume)
    none = &noVolume;
  *result = reinterpret_cast<u64>(slot ? slot : none);
}

WARP_GEOMETRY warp_mesh_closest(u64 mesh, f32 x, f32 y, f32 z, f32 maxDist,
                                ClosestPoint *result) {
  *result = findClosest(treeOf(mesh, kindOfMesh), {x, y, z}, maxDist, 0);
}

WARP_GEOMETRY warp_mesh_furthest(u64 mesh, f32 x, f32 y, f32 z, f32 minDist,
                                 ClosestPoint *result) {
  *result = findFurthest(treeOf(mesh, kindOfMesh), {x, y, z}, minDist);
}

WARP_GEOMETRY warp_mesh_side(u64 mesh, f32 x, f32 y, f32 z, f32 *result) {
  *result = sideByRays(treeOf(mesh, kindOfMesh), {x, y, z});
}

/// The closest point and its side by normals.
struct SignedPoint {
  ClosestPoint point;
  f32 sign;
};

WARP_GEOMETRY warp_mesh_closest_signed(u64 mesh, f32 x, f32 y, f32 z,
                                       f32 maxDist, f32 epsilon,
                                       SignedPoint *result) {
  const Tree &tree = treeOf(mesh, kindOfMesh);
  BlockLane place{0, 0};
  ClosestPoint found = findClosest(tree, {x, y, z}, maxDist, 0, &place);
  *result = {found, 0};
  if (found.face >= 0)
    result->sign = sideByNormal(
        tree, {x, y, z}, found,
        static_cast<const TriangleBlock *>(tree.blocks)[place.block],
        place.lane, epsilon);
}

WARP_GEOMETRY_ONCE warp_mesh_ray(u64 mesh, f32 x, f32 y, f32 z, f32 dx, f32 dy,
                                 f32 dz, f32 maxT, i32 root, RayHit *result) {
  *result = castRay(treeOf(mesh, kindOfMesh), {x, y, z}, {dx, dy, dz}, maxT,
                    root < 0 ? 0 : root);
}

WARP_GEOMETRY_ONCE warp_mesh_ray_any(u64 mesh, f32 x, f32 y, f32 z, f32 dx,
                                     f32 dy, f32 dz, f32 maxT, i32 root,
                                     i32 *result) {
  *result = castRay(treeOf(mesh, kindOfMesh), {x, y, z}, {dx, dy, dz}, maxT,
                    root < 0 ? 0 : root, /*any=*/true)
                .face >= 0;
}

WARP_GEOMETRY warp_mesh_ray_count(u64 mesh, f32 x, f32 y, f32 z, f32 dx, f32 dy,
                                  f32 dz, i32 root, i32 *result) {
  *result = countCrossings(treeOf(mesh, kindOfMesh), {x, y, z}, {dx, dy, dz},
                           root < 0 ? 0 : root);
}

WARP_GEOMETRY warp_mesh_side_parity(u64 mesh, f32 x, f32 y, f32 z, i32 rays,
                                    f32 spread, f32 *result) {
  *result = sideByParity(treeOf(mesh, kindOfMesh), {x, y, z}, rays, spread);
}

WARP_GEOMETRY warp_mesh_side_winding(u64 mesh, f32 x, f32 y, f32 z,
                                     f32 accuracy, f32 threshold, f32 *result) {
  const Tree &tree = treeOf(mesh, kindOfMesh);
  *result = sideByWinding(tree, extrasOf(tree).moments, {x, y, z}, accuracy,
                          threshold);
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

/// What an iterator gives: a primitive or -1, and where it is then.
struct NextOverlap {
  i32 primitive, node, level, block, left;
  u64 lowTrail, highTrail;
};

/// Calls `use` with a shape in the coordinates of a tree's nodes; -1 if nothing
/// can touch it. Shapes: 0 a box by its corners, 1 a ball by center and radius,
/// 2 a ray by start and direction, up to `limit`, 3 a ball that moves along a
/// ray; these by the bounds of primitives, 4 a ball by the triangles
/// themselves.
template <class Use>
static i32 withShape(const Tree &tree, i32 shape, const f32 (&s)[7], f32 limit,
                     Use use) {
  f32 k = tree.scale;
  if (shape == 0)
    return use(BoxShape{{s[0] * k, s[1] * k, s[2] * k},
                        {s[3] * k, s[4] * k, s[5] * k}});
  if (shape == 1 || shape == 4) {
    f32 radius = s[3] * k;
    if (!(radius >= 0))
      return -1;
    SphereShape ball{{s[0] * k, s[1] * k, s[2] * k}, radius * radius};
    return shape == 1 ? use(ball) : use(TriangleSphereShape{ball});
  }
  Ray ray(tree, {s[0], s[1], s[2]}, {s[3], s[4], s[5]});
  if (!ray.isValid)
    return -1;
  f32 end = ray.toTree(limit);
  if (shape == 3)
    return use(CapsuleShape{{ray, end}, greatest(s[6], 0.0f) * k});
  return use(RayShape{ray, end});
}

/// Calls `use` with a tree and a null pointer to its kind of block.
template <class Use> static i32 withTree(u64 id, Use use) {
  const Tree &mesh = treeOf(id, kindOfMesh);
  if (mesh.nodes)
    return use(mesh, static_cast<TriangleBlock *>(nullptr));
  return use(treeOf(id, kindOfBvh), static_cast<BoxBlock *>(nullptr));
}

WARP_GEOMETRY warp_overlap_next(u64 id, i32 shape, f32 a, f32 b, f32 c, f32 d,
                                f32 e, f32 f, f32 g, f32 limit, i32 node,
                                i32 level, i32 block, i32 left, u64 lowTrail,
                                u64 highTrail, NextOverlap *result) {
  const f32 numbers[7] = {a, b, c, d, e, f, g};
  Cursor cursor{node, level, block, u32(left), lowTrail, highTrail, 0};
  auto next = [&]<class Block>(const Tree &tree, Block *) {
    return withShape(tree, shape, numbers, limit, [&](const auto &shape) {
      return nextOverlap<Block>(tree, shape, cursor);
    });
  };
  i32 primitive = withTree(id, next);
  *result = {primitive,        cursor.node,     cursor.level,    cursor.block,
             i32(cursor.left), cursor.lowTrail, cursor.highTrail};
}

/// Where an iterator starts that is one thread's share of a query.
struct OverlapShare {
  i32 node, level, block, left;
  u64 lowTrail, highTrail;
};

WARP_GEOMETRY warp_overlap_share(u64 id, i32 shape, f32 a, f32 b, f32 c, f32 d,
                                 f32 e, f32 f, f32 g, i32 thread, i32 threads,
                                 OverlapShare *result) {
  const f32 numbers[7] = {a, b, c, d, e, f, g};
  Cursor cursor{0, -1, 0, 0, 0, 0, 0};
  withTree(id, [&]<class Block>(const Tree &tree, Block *) {
    return withShape(tree, shape, numbers, infinity, [&](const auto &shape) {
      takeShare<Block>(tree, shape, thread, threads, cursor);
      return 0;
    });
  });
  *result = {cursor.node,      cursor.level,    cursor.block,
             i32(cursor.left), cursor.lowTrail, cursor.highTrail};
}

//===----------------------------------------------------------------------===//
// Volumes
//===----------------------------------------------------------------------===//

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

struct CellIndices {
  i32 index[8];
};

WARP_GEOMETRY warp_volume_cell_index(u64 id, i32 i, i32 j, i32 k,
                                     CellIndices *result) {
  const VolumeSlot &volume = volumeOf(id);
  forCorners(volume, {i, j, k}, [&](u32 corner, VoxelPlace place, Voxel at) {
    result->index[corner] = indexAt(volume, place, at);
  });
}

#ifndef __NVPTX__

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

//===----------------------------------------------------------------------===//
// Predicates
//===----------------------------------------------------------------------===//

WARP_GEOMETRY warp_orient2d(f64 px, f64 py, f64 qx, f64 qy, f64 rx, f64 ry,
                            i32 *result) {
  *result = orient2d({px, py}, {qx, qy}, {rx, ry});
}

WARP_GEOMETRY warp_orient3d(f64 ax, f64 ay, f64 az, f64 bx, f64 by, f64 bz,
                            f64 cx, f64 cy, f64 cz, f64 dx, f64 dy, f64 dz,
                            i32 *result) {
  *result = orient3d({ax, ay, az}, {bx, by, bz}, {cx, cy, cz}, {dx, dy, dz});
}
