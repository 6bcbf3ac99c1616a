//===- Tree.h - Shared parts of kernels that build hierarchies --*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Primitives are triangles, or boxes. Their centers are three floats, of which
// the first is NaN if the primitive is never found, and the primitive's number.
//
// Bounds that threads find together are numbers that only grow, from 0 on:
// upper corners, and lower ones with the sign turned.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CUDA_TREE_H
#define WARP_DEVICELIB_CUDA_TREE_H

#include "../gpu/Gpu.h"
#include "LaunchShapes.h"

namespace tree {

using Quad = float __attribute__((ext_vector_type(4)));

constexpr float infinity = __builtin_inff();

inline float lower(float a, float b) { return gpu::minimum(a, b); }
inline float upper(float a, float b) { return gpu::maximum(a, b); }

inline bool isFinite(float x) {
  return (__builtin_bit_cast(uint32_t, x) & 0x7f800000u) != 0x7f800000u;
}

struct Box {
  float low[3], high[3];

  void include(const float *point) {
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = lower(low[axis], point[axis]);
      high[axis] = upper(high[axis], point[axis]);
    }
  }
  void include(const Box &other) {
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = lower(low[axis], other.low[axis]);
      high[axis] = upper(high[axis], other.high[axis]);
    }
  }
  /// With those of lanes up to `lanes`, a power of two, in groups of as many.
  void uniteLanes(int from, int lanes) {
    for (int mask = from; mask < lanes; mask *= 2)
      for (int axis = 0; axis < 3; ++axis) {
        low[axis] = lower(low[axis], gpu::shuffleXor(low[axis], mask));
        high[axis] = upper(high[axis], gpu::shuffleXor(high[axis], mask));
      }
  }
};

/// Floats as numbers of the same order, all greater than 0.
inline uint32_t ordered(float x) {
  uint32_t bits = __builtin_bit_cast(uint32_t, x);
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}
inline float unordered(uint32_t bits) {
  return __builtin_bit_cast(float, bits >> 31 ? bits & 0x7fffffffu : ~bits);
}

using treeShape::boundsWords;

template <class Scope>
inline void raiseBounds(uint32_t *bounds, const Box &box, Scope raise) {
  if (!(box.low[0] <= box.high[0]))
    return;
  for (int axis = 0; axis < 3; ++axis) {
    raise(&bounds[axis], ordered(box.high[axis]));
    raise(&bounds[3 + axis], ordered(-box.low[axis]));
  }
}
/// Within a block's shared memory, and for all.
inline void raiseShared(uint32_t *word, uint32_t value) {
  __scoped_atomic_fetch_max(word, value, __ATOMIC_RELAXED,
                            __MEMORY_SCOPE_WRKGRP);
}
inline void raiseGlobal(uint32_t *word, uint32_t value) {
  __scoped_atomic_fetch_max(word, value, __ATOMIC_RELAXED,
                            __MEMORY_SCOPE_DEVICE);
}
/// False if there is nothing.
inline bool readBounds(const uint32_t *bounds, float (&low)[3],
                       float (&high)[3]) {
  for (int axis = 0; axis < 3; ++axis) {
    high[axis] = unordered(bounds[axis]);
    low[axis] = -unordered(bounds[3 + axis]);
  }
  return bounds[0] != 0;
}

inline Box nothing() {
  return {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
}

/// The source of a hierarchy (include/warp/TreeBuild.h).
struct Primitives {
  /// Points, or lower corners; corners of faces, or upper corners.
  const float *first;
  const void *second;
  int64_t points;
  int32_t count, ofTriangles;

  enum State { Proper, NotFinite, WrongIndex };

  /// The corners of a triangle, or lower and upper corner of a box.
  State read(int i, float (&corner)[3][3]) const {
    bool isFound = true;
    if (ofTriangles) {
      auto *indices = static_cast<const int32_t *>(second) + 3 * int64_t(i);
      for (int k = 0; k < 3; ++k) {
        int32_t at = indices[k];
        if (at < 0 || at >= points)
          return WrongIndex;
        for (int axis = 0; axis < 3; ++axis) {
          corner[k][axis] = first[3 * int64_t(at) + axis];
          isFound &= isFinite(corner[k][axis]);
        }
      }
      return isFound ? Proper : NotFinite;
    }
    auto *uppers = static_cast<const float *>(second);
    for (int axis = 0; axis < 3; ++axis) {
      float low = first[3 * int64_t(i) + axis];
      float high = uppers[3 * int64_t(i) + axis];
      isFound &= low <= high;
      corner[0][axis] = low;
      corner[1][axis] = high;
    }
    return isFound ? Proper : NotFinite;
  }
  int corners() const { return ofTriangles ? 3 : 2; }
  /// The bounds of the corners, times a scale.
  Box boundsOf(const float (&corner)[3][3], float scale = 1) const {
    Box box = nothing();
#pragma unroll
    for (int k = 0; k < 3; ++k)
      for (int axis = 0; axis < 3 && k < corners(); ++axis) {
        box.low[axis] = lower(box.low[axis], corner[k][axis] * scale);
        box.high[axis] = upper(box.high[axis], corner[k][axis] * scale);
      }
    return box;
  }
  /// The same without infinite sides, as `Bounds::finite` of
  /// lib/Geometry/HierarchyBuilder.h has it.
  Box finiteBoundsOf(const float (&corner)[3][3]) const {
    Box box = boundsOf(corner);
    for (int axis = 0; axis < 3; ++axis) {
      float low = box.low[axis], high = box.high[axis];
      float side = isFinite(low) ? low : isFinite(high) ? high : 0;
      box.low[axis] = side;
      box.high[axis] = isFinite(high) ? high : side;
    }
    return box;
  }
};

} // namespace tree

#endif // WARP_DEVICELIB_CUDA_TREE_H
