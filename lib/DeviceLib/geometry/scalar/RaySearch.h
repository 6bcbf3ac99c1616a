//===- RaySearch.h - Where a ray meets a mesh, by one thread of a GPU -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds what wide/RaySearch.h finds: triangles are tested with the same
// roundings. Nodes are only passed by, so that slabs are multiplied and added
// at once, a little wider. What stays of a node is kept as keys with the node's
// number; where it leads is read again if it is not behind the hit by then.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_RAYSEARCH_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_RAYSEARCH_H

#include "../Ray.h"
#include "Steps.h"

namespace warp::geometry::scalar {

class RaySearch {
public:
  RaySearch(const Tree &tree, const Ray &ray, f32 limit, bool any)
      : nodes((Bytes)tree.nodes), blocks((Bytes)tree.blocks), any(any),
        rests(nodes) {
    hit.t = limit;
    setReach();
    f32 shear[3] = {ray.shearX, ray.shearY, ray.shearZ};
    int axes[3] = {ray.kx, ray.ky, ray.kz};
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      int k = axes[i];
      start[i] = pick(ray.start, k);
      this->shear[i] = shear[i];
      component[i] = k * int(sizeof(Floats));
      // Where a ray does not move, slabs around it last very long.
      bool isAtRest = ray.direction[i] == 0;
      inverse[i] = isAtRest ? 0x1p90f : roughInverse(ray.direction[i]);
      f32 at = -ray.start[i] * inverse[i];
      // The product was rounded, and so will be the sum.
      f32 slack = __builtin_elementwise_abs(at) * 0x1p-22f;
      slack += isAtRest ? 0x1p66f : 0;
      first[i] = at - slack;
      last[i] = at + slack;
      nearer[i] = (inverse[i] < 0 ? 3 + i : i) * int(sizeof(Floats));
    }
  }

  RayHit run(i32 root) {
    rests.search(
        root, [this](i32 node) { return enter(node); },
        [this](i32 block) {
          visit(block);
          return !any || hit.face < 0;
        });
    hit.u /= weights;
    hit.v /= weights;
    return hit;
  }

  bool leavesThroughFront() const { return weights < 0; }

private:
  /// Bounds are rounded, and those of ties are to be seen.
  void setReach() {
    reach = lower(hit.t * 1.000002f, 0x1.fffffep127f);
    rests.farthest = __builtin_bit_cast(u32, reach) | 7;
  }

  /// Leaves the children that are met for later, but the nearest, which it
  /// gives.
  i32 enter(i32 index) {
    Bytes node = nodes + i64(index) * i64(sizeof(Node));
    Links links(node);
    u32 met = 0;
    f32 entry[width];
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      Four enters[3], leaves[3];
#pragma unroll
      for (int i = 0; i < 3; ++i) {
        enters[i] = load<Four>(node + nearer[i] + 16 * half);
        int further = (2 * i + 3) * int(sizeof(Floats)) - nearer[i];
        leaves[i] = load<Four>(node + further + 16 * half);
      }
#pragma unroll
      for (int lane = 0; lane < 4; ++lane) {
        f32 from = 0, to = reach;
#pragma unroll
        for (int i = 0; i < 3; ++i) {
          from = upper(from, fma(enters[i][lane], inverse[i], first[i]));
          to = lower(to, fma(leaves[i][lane], inverse[i], last[i]));
        }
        int child = 4 * half + lane;
        entry[child] = from;
        // A little later, as `reach` is.
        met |= from <= to * 1.0000015f ? 1u << child : 0;
      }
    }
    met &= links.children();
    if (!met)
      return rests.next();
    // Most often there is one.
    if (!(met & (met - 1)))
      return links.follow(u32(lowestBit(met)));
    u32 key[width];
#pragma unroll
    for (int child = 0; child < width; ++child)
      key[child] = met >> child & 1 ? keyOf(entry[child], child) : noKey;
    sortKeys(key);
#pragma unroll
    for (int i = width - 1; i > 0; --i)
      if (key[i] != noKey)
        rests.leave(key[i], index);
    return links.follow(key[0] & 7);
  }

  void visit(i32 index) {
    Bytes block = blocks + i64(index) * i64(sizeof(TriangleBlock));
#pragma unroll 1
    for (int half = 0; half < 2; ++half, block += 16) {
      Four corner[3][3];
#pragma unroll
      for (int i = 0; i < 3; ++i)
#pragma unroll
        for (int axis = 0; axis < 3; ++axis)
          corner[i][axis] =
              load<Four>(block + component[axis] + 3 * i * int(sizeof(Floats)));
#pragma unroll
      for (int lane = 0; lane < 4; ++lane)
        meet(corner, lane, block);
    }
  }

  /// As meetTriangles.
  void meet(const Four (&corner)[3][3], int lane, Bytes block) {
    f32 x[3], y[3], z[3];
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      z[i] = corner[i][2][lane] - start[2];
      x[i] = fma(-shear[0], z[i], corner[i][0][lane] - start[0]);
      y[i] = fma(-shear[1], z[i], corner[i][1][lane] - start[1]);
    }
    f32 u = differenceOfProducts(x[2], y[1], y[2], x[1]);
    f32 v = differenceOfProducts(x[0], y[2], y[0], x[2]);
    f32 w = differenceOfProducts(x[1], y[0], y[1], x[0]);
    bool isMet = lower(lower(u, v), w) >= 0 || upper(upper(u, v), w) <= 0;
    f32 sum = u + v + w;
    if (!isMet || !(sum != 0))
      return;
    f32 t = fma(u, z[0], fma(v, z[1], w * z[2])) * shear[2] / sum;
    if (!(t >= 0 && t <= hit.t))
      return;
    i32 face = load<i32>(block + 9 * int(sizeof(Floats)) + 4 * lane);
    if (t == hit.t && !(face < hit.face))
      return;
    hit = {face, u, v, t};
    weights = sum;
    setReach();
  }

  Bytes nodes, blocks;
  bool any;
  /// The components of blocks along which the ray is sheared, in bytes; where
  /// the ray starts there.
  i32 component[3];
  f32 start[3], shear[3];
  /// The slabs of nodes: entered at `plane * inverse + first`, left at `plane *
  /// inverse + last`. The planes that are met first, in bytes.
  f32 inverse[3], first[3], last[3];
  i32 nearer[3];
  /// Its weights are to be divided by their sum, whose sign is the side.
  RayHit hit{-1, 0, 0, 0};
  f32 weights = 1;
  f32 reach;
  Rests rests;
};

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_RAYSEARCH_H
