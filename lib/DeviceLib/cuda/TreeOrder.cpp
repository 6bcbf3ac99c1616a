//===- TreeOrder.cpp - Primitive order of BVH builds, on CUDA -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A hierarchy's shape follows from its number of primitives; what is built is
// their order. `tree_see` finds centers and bounds. Then primitives are halved
// (TreeHalves.cpp), or `tree_key` numbers them along a Hilbert curve, by which
// they are sorted (Sort.cpp).
//
//===----------------------------------------------------------------------===//

#include "Tree.h"

using namespace gpu;
using namespace tree;

using treeShape::headWords, treeShape::skippedAt, treeShape::threads,
    treeShape::wrongAt;
static constexpr int digits = 256;

//===----------------------------------------------------------------------===//
// Centers and bounds
//===----------------------------------------------------------------------===//

/// The head gets bounds, and what is wrong.
WARP_KERNEL(threads, 4)
void tree_see(Primitives all, Quad *centers, uint32_t *head) {
  WARP_SHARED uint32_t whole[6];
  if (thread() < 6)
    whole[thread()] = 0;
  syncThreads();
  Box box = nothing();
  uint32_t skipped = 0;
  for (int64_t i = int64_t(block()) * threads + thread(); i < all.count;
       i += int64_t(blocks()) * threads) {
    float corner[3][3];
    auto state = all.read(int(i), corner);
    Quad center{__builtin_nanf(""), 0, 0,
                __builtin_bit_cast(float, int32_t(i))};
    if (state == Primitives::Proper) {
      Box own = all.finiteBoundsOf(corner);
      for (int axis = 0; axis < 3; ++axis)
        center[axis] = 0.5f * own.low[axis] + 0.5f * own.high[axis];
      box.include(own);
    } else {
      ++skipped;
      if (state == Primitives::WrongIndex)
        raiseGlobal(&head[wrongAt], uint32_t(all.count - i));
    }
    centers[i] = center;
  }
  box.uniteLanes(1, warpSize);
  if (lane() == 0)
    raiseBounds(whole, box, raiseShared);
  if (skipped)
    __scoped_atomic_fetch_add(&head[skippedAt], skipped, __ATOMIC_RELAXED,
                              __MEMORY_SCOPE_DEVICE);
  syncThreads();
  if (thread() < 6 && whole[thread()])
    raiseGlobal(&head[thread()], whole[thread()]);
}

/// A power of two that brings the extent near 1, as lib/Geometry/Scale.cpp
/// has it.
static float scaleOf(const float (&low)[3], const float (&high)[3]) {
  double size = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double a = low[axis], b = high[axis];
    double far = __builtin_fabs(a) > __builtin_fabs(b) ? __builtin_fabs(a)
                                                       : __builtin_fabs(b);
    size = b - a > size ? b - a : size;
    size = far * 0x1p-20 > size ? far * 0x1p-20 : size;
  }
  if (!(size > 0))
    return 1;
  int exponent = int(__builtin_bit_cast(uint64_t, size) >> 52) - 1023;
  exponent = exponent < -126 ? -126 : exponent > 126 ? 126 : exponent;
  return __builtin_bit_cast(float, uint32_t(127 - exponent) << 23);
}

/// Writes the scale, the first face with a wrong index, and how many are never
/// found.
WARP_KERNEL(32, 1)
void tree_report(const uint32_t *head, int count, float *scale, int *found,
                 int *shown) {
  float low[3], high[3];
  bool isThere = readBounds(head, low, high);
  if (thread() != 0)
    return;
  *scale = isThere ? scaleOf(low, high) : 1;
  found[0] = count - int(head[wrongAt]);
  found[1] = int(head[skippedAt]);
  if (shown)
    for (int i = 0; i < 2; ++i)
      shown[i] = found[i];
}

//===----------------------------------------------------------------------===//
// Along the curve
//===----------------------------------------------------------------------===//

/// The place on a Hilbert curve through a grid of 2^bits cells along each axis
/// of a cell (Skilling, "Programming the Hilbert curve", 2004).
static uint32_t alongCurve(uint32_t (&x)[3], int bits) {
  for (uint32_t q = 1u << (bits - 1); q > 1; q >>= 1) {
    uint32_t p = q - 1;
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      uint32_t t = (x[0] ^ x[i]) & p;
      x[i] ^= x[i] & q ? 0 : t;
      x[0] ^= x[i] & q ? p : t;
    }
  }
  x[1] ^= x[0];
  x[2] ^= x[1];
  uint32_t t = 0;
  for (uint32_t q = 1u << (bits - 1); q > 1; q >>= 1)
    t ^= x[2] & q ? q - 1 : 0;
  uint32_t result = 0;
  for (int bit = bits - 1; bit >= 0; --bit)
#pragma unroll
    for (int i = 0; i < 3; ++i)
      result = result << 1 | ((x[i] ^ t) >> bit & 1);
  return result;
}

/// Keys of `3 * bits` bits, the order at first, and how often each digit of 8
/// bits occurs.
WARP_KERNEL(threads, 4)
void tree_key(const Quad *centers, int count, int bits, uint32_t *keys,
              int *order, uint32_t *head) {
  WARP_SHARED uint32_t counts[4 * digits];
  for (int i = 0; i < 4; ++i)
    counts[i * digits + thread()] = 0;
  syncThreads();
  float low[3], high[3], extent = 0;
  readBounds(head, low, high);
  for (int axis = 0; axis < 3; ++axis)
    extent = upper(extent, 0.5f * high[axis] - 0.5f * low[axis]);
  float cells = float(1 << bits), fine = cells / upper(extent, 1e-37f);
  uint32_t last = (1u << 3 * bits) - 1;
  for (int64_t i = int64_t(block()) * threads + thread(); i < count;
       i += int64_t(blocks()) * threads) {
    Quad center = centers[i];
    uint32_t key = last;
    if (center[0] == center[0]) {
      uint32_t cell[3];
      for (int axis = 0; axis < 3; ++axis) {
        float at = (0.5f * center[axis] - 0.5f * low[axis]) * fine;
        cell[axis] = uint32_t(lower(upper(at, 0), cells - 1));
      }
      key = alongCurve(cell, bits);
      key = key < last ? key : last - 1;
    }
    keys[i] = key;
    order[i] = int(i);
    for (int pass = 0; pass < 4; ++pass)
      __scoped_atomic_fetch_add(
          &counts[pass * digits + (key >> 8 * pass & 255)], 1u,
          __ATOMIC_RELAXED, __MEMORY_SCOPE_WRKGRP);
  }
  syncThreads();
  for (int i = 0; i < 4; ++i)
    if (uint32_t value = counts[i * digits + thread()])
      __scoped_atomic_fetch_add(&head[headWords + i * digits + thread()], value,
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
}
