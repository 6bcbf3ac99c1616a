//===- Meshes.cpp - Mesh queries ------------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "geometry/Crossings.h"
#include "geometry/Exports.h"
#include "geometry/Handles.h"
#include "geometry/Search.h"
#include "geometry/Sign.h"
#include "geometry/Winding.h"

using namespace warp::geometry;

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
  const Tree &tree = treeOf(mesh, kindOfMesh);
  *result = castRay(tree, {x, y, z}, {dx, dy, dz}, maxT, startOf(tree, root));
}

WARP_GEOMETRY_ONCE warp_mesh_ray_any(u64 mesh, f32 x, f32 y, f32 z, f32 dx,
                                     f32 dy, f32 dz, f32 maxT, i32 root,
                                     i32 *result) {
  const Tree &tree = treeOf(mesh, kindOfMesh);
  *result = castRay(tree, {x, y, z}, {dx, dy, dz}, maxT, startOf(tree, root),
                    /*any=*/true)
                .face >= 0;
}

WARP_GEOMETRY warp_mesh_ray_count(u64 mesh, f32 x, f32 y, f32 z, f32 dx, f32 dy,
                                  f32 dz, i32 root, i32 *result) {
  const Tree &tree = treeOf(mesh, kindOfMesh);
  *result = countCrossings(tree, {x, y, z}, {dx, dy, dz}, startOf(tree, root));
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
