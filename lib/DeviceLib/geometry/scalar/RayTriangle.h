//===- RayTriangle.h - Ray-triangle intersection ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As meetTriangles of ../Ray.h, with the same roundings.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_RAYTRIANGLE_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_RAYTRIANGLE_H

#include "../Ray.h"
#include "Steps.h"

namespace warp::geometry::scalar {

/// A ray as triangles see it: along the third of its axes.
struct ShearedRay {
  f32 start[3], shear[3];
  /// Offsets in a block of components along its axes, in bytes, of eight bits.
  u32 axes = 0;

  ShearedRay() = default;
  explicit ShearedRay(const Ray &ray)
      : shear{ray.shearX, ray.shearY, ray.shearZ} {
    int from[3] = {ray.kx, ray.ky, ray.kz};
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      start[i] = pick(ray.start, from[i]);
      axes |= u32(from[i]) * sizeof(Floats) << 8 * i;
    }
  }
  /// The offset in a block of a component of a corner.
  u32 place(int corner, int axis) const {
    return (axes >> 8 * axis & 0xff) + 3 * corner * sizeof(Floats);
  }
};

/// On which sides of a triangle's edges a ray passes.
struct RayOnTriangle {
  f32 u, v, w;
  /// For corners along the ray.
  f32 z[3];

  RayOnTriangle(const ShearedRay &ray, const f32 (&corner)[3][3]) {
    f32 x[3], y[3];
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      z[i] = corner[i][2] - ray.start[2];
      x[i] = fma(-ray.shear[0], z[i], corner[i][0] - ray.start[0]);
      y[i] = fma(-ray.shear[1], z[i], corner[i][1] - ray.start[1]);
    }
    u = differenceOfProducts(x[2], y[1], y[2], x[1]);
    v = differenceOfProducts(x[0], y[2], y[0], x[2]);
    w = differenceOfProducts(x[1], y[0], y[1], x[0]);
  }
  f32 sum() const { return u + v + w; }
  bool isMet() const {
    return (lower(lower(u, v), w) >= 0 || upper(upper(u, v), w) <= 0) &&
           sum() != 0;
  }
  f32 parameter(const ShearedRay &ray) const {
    return fma(u, z[0], fma(v, z[1], w * z[2])) * ray.shear[2] / sum();
  }
};

/// Triangles of blocks have numbers: that of the block and the lane.
inline Bytes triangleAt(Bytes blocks, i32 number) {
  return blocks + i64(u32(number) / width) * i64(sizeof(TriangleBlock)) +
         4 * (u32(number) % width);
}
inline i32 faceAt(Bytes triangle) {
  return load<i32>(triangle + 9 * int(sizeof(Floats)));
}
inline RayOnTriangle testTriangle(const ShearedRay &ray, Bytes triangle) {
  f32 corner[3][3];
#pragma unroll
  for (int i = 0; i < 3; ++i)
#pragma unroll
    for (int axis = 0; axis < 3; ++axis)
      corner[i][axis] = load<f32>(triangle + ray.place(i, axis));
  return RayOnTriangle(ray, corner);
}

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_RAYTRIANGLE_H
