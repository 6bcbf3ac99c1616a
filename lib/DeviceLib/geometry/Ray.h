//===- Ray.h - Ray-mesh intersection ----------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Triangles are sheared so that the ray is an axis (Woop, Benthin, Wald,
// "Watertight ray/triangle intersection", JCGT 2(1), 2013). Which side of an
// edge the ray passes is the sign of a difference of products whose sign is
// exact for the sheared corners, and neighbours shear a corner to the same
// bits: no ray slips between them. A ray in a triangle's plane misses it.
//
// Boxes are tested by slabs, a few units in the last place wider (Ize, "Robust
// BVH ray traversal", JCGT 2(2), 2013). An axis along which the ray does not
// move asks whether the origin is within the slab, borders included.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_RAY_H
#define WARP_DEVICELIB_GEOMETRY_RAY_H

#include "Tree.h"

#include "DeviceLib/Prototypes.h"

namespace warp::geometry {

inline f32 powerOfTwo(i32 exponent) {
  return __builtin_bit_cast(f32, u32(exponent + 127) << 23);
}

/// The binary exponent of a positive number, of its least normal one at least.
inline i32 exponentOf(f32 x) {
  i32 exponent = i32(__builtin_bit_cast(u32, x) >> 23 & 0xff) - 127;
  return exponent < -126 ? -126 : exponent;
}

/// That of a power of two that has one.
inline f32 inverseOfPower(f32 power) {
  return __builtin_bit_cast(f32, (254u << 23) - __builtin_bit_cast(u32, power));
}

/// One of three numbers, which may be in registers.
inline f32 pick(const f32 (&from)[3], int k) {
  return k == 0 ? from[0] : k == 1 ? from[1] : from[2];
}

/// A ray in the coordinates of a tree. Its direction is scaled by a power of
/// two so that the largest component is in [1, 2).
struct Ray {
  Point<f32> origin;
  f32 start[3], direction[3], inverse[3];
  int kx, ky, kz;
  f32 shearX, shearY, shearZ;
  /// The user's parameter is `t * first * second` of ours.
  f32 first, second;
  bool isValid;

  Ray(const Tree &tree, Point<f32> from, Point<f32> along) {
    origin = {from.x * tree.scale, from.y * tree.scale, from.z * tree.scale};
    f32 given[3] = {along.x, along.y, along.z};
    f32 from3[3] = {origin.x, origin.y, origin.z};
    f32 size[3];
    for (int i = 0; i < 3; ++i)
      size[i] = __builtin_elementwise_abs(given[i]);
    kz = size[0] > size[1] ? (size[0] > size[2] ? 0 : 2)
                           : (size[1] > size[2] ? 1 : 2);
    f32 largest = pick(size, kz);
    isValid = largest > 0 && largest < infinity && size[0] <= largest &&
              size[1] <= largest && size[2] <= largest;
    i32 exponent = isValid ? exponentOf(largest) : 0;
    // In two steps, as 2^-exponent need not be a float.
    i32 half = exponent / 2;
    f32 down = powerOfTwo(-half), further = powerOfTwo(half - exponent);
    for (int i = 0; i < 3; ++i) {
      start[i] = from3[i];
      direction[i] = given[i] * down * further;
      // So slow that it has no inverse.
      if (!(__builtin_elementwise_abs(direction[i]) >= 0x1p-126f))
        direction[i] = 0;
      // Unused where the ray does not move; GPUs divide by zero slowly.
      inverse[i] = 1 / (direction[i] == 0 ? 1 : direction[i]);
    }
    first = down * inverseOfPower(tree.scale);
    second = further;
    kx = kz == 2 ? 0 : kz + 1;
    ky = kx == 2 ? 0 : kx + 1;
    // Keeps the winding.
    f32 ahead = pick(direction, kz);
    if (ahead < 0) {
      int swap = kx;
      kx = ky;
      ky = swap;
    }
    shearX = pick(direction, kx) / ahead;
    shearY = pick(direction, ky) / ahead;
    shearZ = 1 / ahead;
  }

  f32 toUser(f32 t) const { return t * first * second; }
  f32 toTree(f32 t) const {
    return t * inverseOfPower(first) * inverseOfPower(second);
  }
};

/// Children of a node that the ray may meet before `limit`, and where.
inline u32 meetBoxes(const Node &node, const Ray &ray, f32 limit,
                     Floats &entry) {
  entry = Floats(0);
  Floats leave = Floats(limit);
  Ints within = lanesOf(node.children());
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    Floats low = node.low[axis] - ray.start[axis];
    Floats high = node.high[axis] - ray.start[axis];
    f32 direction = ray.direction[axis], inverse = ray.inverse[axis];
    if (direction == 0) {
      within &= (low <= Floats(0)) & (high >= Floats(0));
      continue;
    }
    entry = greatest(entry, (direction > 0 ? low : high) * inverse);
    leave = least(leave, (direction > 0 ? high : low) * inverse);
  }
  // Each bound is off by 3 roundings at most.
  return bitsOf(within & (entry <= leave * 1.000001f));
}

/// Corners of triangles where the ray is the z axis.
struct ShearedCorners {
  Floats x[3], y[3], z[3];
};

inline ShearedCorners shearCorners(const TriangleBlock &block, const Ray &ray) {
  ShearedCorners to;
#pragma unroll
  for (int i = 0; i < 3; ++i) {
    to.z[i] = block.vertex[i][ray.kz] - ray.start[ray.kz];
    to.x[i] = fma(Floats(-ray.shearX), to.z[i],
                  block.vertex[i][ray.kx] - ray.start[ray.kx]);
    to.y[i] = fma(Floats(-ray.shearY), to.z[i],
                  block.vertex[i][ray.ky] - ray.start[ray.ky]);
  }
  return to;
}

/// The hit of a ray in a block: weights of the first two corners, parameter.
struct Meeting {
  Floats u, v, t;
  /// The sum of the weights before they are normalised: its sign is the side.
  Floats weights;
  Ints isMet;
};

inline Meeting meetTriangles(const TriangleBlock &block, const Ray &ray) {
  auto [x, y, z] = shearCorners(block, ray);
  Floats u = differenceOfProducts(x[2], y[1], y[2], x[1]);
  Floats v = differenceOfProducts(x[0], y[2], y[0], x[2]);
  Floats w = differenceOfProducts(x[1], y[0], y[1], x[0]);
  Floats zero = Floats(0);
  Ints isMet = ((u >= zero) & (v >= zero) & (w >= zero)) |
               ((u <= zero) & (v <= zero) & (w <= zero));
  Floats sum = u + v + w;
  isMet &= sum != zero;
  Floats t = fma(u, z[0], fma(v, z[1], w * z[2])) * ray.shearZ / sum;
  return {u / sum, v / sum, t, sum, isMet & (t >= zero)};
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_RAY_H
