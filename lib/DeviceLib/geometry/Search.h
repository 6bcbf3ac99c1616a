//===- Search.h - Closest points and first hits of a mesh -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Threads of GPUs go through a tree with scalars, processors with vectors; both
// test triangles with the same roundings and find the same.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SEARCH_H
#define WARP_DEVICELIB_GEOMETRY_SEARCH_H

#ifdef WARP_GPU
#include "scalar/ClosestSearch.h"
#include "scalar/RaySearch.h"
#else
#include "wide/ClosestSearch.h"
#include "wide/RaySearch.h"
#endif

namespace warp::geometry {

#ifdef WARP_GPU
using scalar::ClosestSearch;
using scalar::RaySearch;
#else
using wide::ClosestSearch;
using wide::RaySearch;
#endif

/// The place of the closest triangle.
struct BlockLane {
  i32 block, lane;
};

/// The closest point within less than `maxDist` of p; face -1 if there is none.
template <class Search = ClosestSearch>
inline ClosestPoint findClosest(const Tree &tree, Point<f32> p, f32 maxDist,
                                i32 root, BlockLane *place = nullptr) {
  ClosestPoint result{-1, 0, 0};
  if (!tree.nodes)
    return result;
  f32 bound = maxDist * tree.scale;
  Point<f32> at{p.x * tree.scale, p.y * tree.scale, p.z * tree.scale};
  // A distance below zero finds nothing; its square would. That of a tiny one
  // must not vanish.
  f32 squared = bound > 0 ? greatest(bound * bound, 1e-37f) : 0;
  Search search(tree, at, squared);
  result.face = search.run(root);
  if (result.face < 0)
    return result;
  if (place)
    *place = {search.block, search.lane};
  const TriangleBlock &block =
      static_cast<const TriangleBlock *>(tree.blocks)[search.block];
  auto corner = [&](int i) -> Point<f64> {
    return {f64(block.vertex[i][0][search.lane]) - at.x,
            f64(block.vertex[i][1][search.lane]) - at.y,
            f64(block.vertex[i][2][search.lane]) - at.z};
  };
  OnTriangle<f64> point = closestOnTriangle(corner(0), corner(1), corner(2));
  // On the edge between the other two it is 0, but for what they are rounded.
  f64 first = 1.0 - point.second - point.third;
  result.u = first < 1e-14 ? 0 : f32(first);
  result.v = f32(point.second);
  return result;
}

/// The first hit with 0 <= t < maxT, in units of the direction's length; face
/// -1 if there is none, as from node -1.
template <class Search = RaySearch>
inline RayHit castRay(const Tree &tree, Point<f32> start, Point<f32> direction,
                      f32 maxT, i32 root, bool any = false) {
  RayHit none{-1, 0, 0, 0};
  if (!tree.nodes || root < 0)
    return none;
  Ray ray(tree, start, direction);
  if (!ray.isValid || !(maxT > 0))
    return none;
  f32 limit = ray.toTree(maxT);
  RayHit hit = Search(tree, ray, limit, any).run(root);
  if (hit.face < 0)
    return none;
  hit.t = ray.toUser(hit.t);
  return hit;
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_SEARCH_H
