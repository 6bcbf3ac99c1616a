//===- Shapes.h - Query shapes of hierarchies -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SHAPES_H
#define WARP_DEVICELIB_GEOMETRY_SHAPES_H

#include "Handles.h"
#include "Overlap.h"

namespace warp::geometry {

/// Calls `use` with a shape in the coordinates of a tree's nodes; -1 if nothing
/// can touch it. Shapes: 0 a box by its corners, 1 a ball by center and radius,
/// 2 a ray by start and direction, up to `limit`, 3 a ball that moves along a
/// ray; these by the bounds of primitives, 4 a ball by the triangles
/// themselves.
template <class Use>
static inline i32 withShape(const Tree &tree, i32 shape, const f32 (&s)[7],
                            f32 limit, Use use) {
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
template <class Use> static inline i32 withTree(u64 id, Use use) {
  const Tree &mesh = treeOf(id, kindOfMesh);
  if (mesh.nodes)
    return use(mesh, static_cast<TriangleBlock *>(nullptr));
  return use(treeOf(id, kindOfBvh), static_cast<BoxBlock *>(nullptr));
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_SHAPES_H
