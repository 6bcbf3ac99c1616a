//===- TreeOrder.cpp - Orders primitives for a hierarchy, on CUDA ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A hierarchy's shape follows from its number of primitives; what is built is
// their order. `tree_see` finds centers and bounds, `tree_key` numbers the
// centers along a Hilbert curve, and they are sorted by that (Sort.cpp). Then
// `tree_halve` halves them by the medians of their centers along the widest
// axis of what they bound: a block does so for 4096 elements in shared memory.
// Where there are more primitives, elements are runs of 128, or of 128^2,
// along the curve (`tree_runs`), and 32 of them are the 4096 of the next step.
//
//===----------------------------------------------------------------------===//

#include "Tree.h"

using namespace gpu;
using namespace tree;

static constexpr int threads = 256;
static constexpr int digits = 256;
/// Words before the counts of digits: bounds, wrong faces, skipped.
static constexpr int wrongAt = 6, skippedAt = 7, headWords = 8;

/// Floats as numbers of the same order, all greater than 0.
static uint32_t ordered(float x) {
  uint32_t bits = __builtin_bit_cast(uint32_t, x);
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}
static float unordered(uint32_t bits) {
  return __builtin_bit_cast(float, bits >> 31 ? bits & 0x7fffffffu : ~bits);
}

static void raise(uint32_t *word, uint32_t value) {
  __scoped_atomic_fetch_max(word, value, __ATOMIC_RELAXED,
                            __MEMORY_SCOPE_DEVICE);
}

//===----------------------------------------------------------------------===//
// Centers and bounds
//===----------------------------------------------------------------------===//

/// Bounds go to the head as numbers that only grow: upper corners, and lower
/// ones with the sign turned.
WARP_KERNEL(threads, 4)
void tree_see(Primitives all, Quad *centers, uint32_t *head) {
  WARP_SHARED uint32_t whole[6];
  if (thread() < 6)
    whole[thread()] = 0;
  meet();
  Box box = nothing();
  uint32_t skipped = 0;
  for (int64_t i = int64_t(block()) * threads + thread(); i < all.count;
       i += int64_t(blocks()) * threads) {
    float corner[3][3];
    auto state = all.read(int(i), corner);
    Quad center{__builtin_nanf(""), 0, 0, 0};
    if (state == Primitives::Proper) {
      Box own = all.boundsOf(corner);
      for (int axis = 0; axis < 3; ++axis)
        center[axis] = 0.5f * own.low[axis] + 0.5f * own.high[axis];
      box.include(own);
    } else {
      ++skipped;
      if (state == Primitives::WrongIndex)
        raise(&head[wrongAt], uint32_t(all.count - i));
    }
    centers[i] = center;
  }
  box.uniteLanes(1, warpSize);
  if (lane() == 0 && box.low[0] <= box.high[0])
    for (int axis = 0; axis < 3; ++axis) {
      __scoped_atomic_fetch_max(&whole[axis], ordered(box.high[axis]),
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_WRKGRP);
      __scoped_atomic_fetch_max(&whole[3 + axis], ordered(-box.low[axis]),
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_WRKGRP);
    }
  if (skipped)
    __scoped_atomic_fetch_add(&head[skippedAt], skipped, __ATOMIC_RELAXED,
                              __MEMORY_SCOPE_DEVICE);
  meet();
  if (thread() < 6 && whole[thread()])
    raise(&head[thread()], whole[thread()]);
}

/// What `tree_see` found; false if there is nothing.
static bool readBounds(const uint32_t *head, float (&low)[3],
                       float (&high)[3]) {
  for (int axis = 0; axis < 3; ++axis) {
    high[axis] = unordered(head[axis]);
    low[axis] = -unordered(head[3 + axis]);
  }
  return head[0] != 0;
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

//===----------------------------------------------------------------------===//
// Along the curve
//===----------------------------------------------------------------------===//

/// Where a Hilbert curve through a grid of 2^bits cells along each axis meets a
/// cell (Skilling, "Programming the Hilbert curve", 2004).
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
/// bits occurs. Also writes what is known once all have been seen: the scale,
/// and the first face with a wrong index and how many are never found.
WARP_KERNEL(threads, 4)
void tree_key(const Quad *centers, int count, int bits, uint32_t *keys,
              int *order, uint32_t *head, float *scale, int *found) {
  WARP_SHARED uint32_t counts[4 * digits];
  for (int i = 0; i < 4; ++i)
    counts[i * digits + thread()] = 0;
  meet();
  float low[3], high[3], extent = 0;
  bool isThere = readBounds(head, low, high);
  for (int axis = 0; axis < 3; ++axis)
    extent = upper(extent, 0.5f * high[axis] - 0.5f * low[axis]);
  if (block() == 0 && thread() == 0) {
    *scale = isThere ? scaleOf(low, high) : 1;
    found[0] = count - int(head[wrongAt]);
    found[1] = int(head[skippedAt]);
  }
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
  meet();
  for (int i = 0; i < 4; ++i)
    if (uint32_t value = counts[i * digits + thread()])
      __scoped_atomic_fetch_add(&head[headWords + i * digits + thread()], value,
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
}

//===----------------------------------------------------------------------===//
// Halves
//===----------------------------------------------------------------------===//

static constexpr int run = 128;
static constexpr int runsInChunk = 32;
static constexpr int chunk = run * runsInChunk;
static constexpr int halvers = 1024;
static constexpr int each = chunk / halvers;
static_assert(each == 4);
/// Words hold a place in the chunk below a number along the axis; the greatest
/// is that of what has no center, or is not there.
static constexpr uint32_t placeMask = chunk - 1;
static constexpr uint32_t lastNumber = ~0u / chunk;

/// The mean center of each run of elements, which are `order`ed, or in place:
/// a warp for each.
WARP_KERNEL(threads, 4)
void tree_runs(const Quad *centers, const int *order, int count, Quad *means) {
  int64_t index = int64_t(block()) * (threads / warpSize) + thread() / warpSize;
  if (index * run >= count)
    return;
  Quad sum{0, 0, 0, 0};
#pragma unroll
  for (int i = 0; i < run / warpSize; ++i) {
    int64_t at = index * run + i * warpSize + lane();
    if (at >= count)
      continue;
    Quad center = centers[order ? order[at] : at];
    if (center[0] == center[0])
      sum += Quad{center[0], center[1], center[2], 1} * (1.0f / run);
  }
  for (int mask = 1; mask < warpSize; mask *= 2)
    for (int i = 0; i < 4; ++i)
      sum[i] += fromAcross(sum[i], mask);
  if (lane() == 0) {
    float weight = 1 / sum[3];
    // 0 / 0 without any.
    Quad mean{sum[0] * weight, sum[1] * weight, sum[2] * weight, 0};
    mean[0] = sum[3] > 0 ? mean[0] : __builtin_nanf("");
    means[index] = mean;
  }
}

namespace {
struct Halving {
  /// Of elements, by where they are along the curve; of primitives, by number.
  const Quad *centers;
  /// Primitives along the curve; null for runs.
  const int *order;
  /// Runs of elements as the step before has put them; null at the top.
  const int *coarse;
  /// Elements in their new order.
  int *out;
  int elements;
  /// Segments of so many are not halved.
  int stop;
  /// The last element is an incomplete run, which has to be last.
  int incomplete;
};
} // namespace

/// Sorts the words of segments, of `size` each, in bitonic steps. The pairs of
/// a warp are neighbours, so that warps are on their own where words are near.
static void sortSegments(uint32_t *words, int size) {
  constexpr int near = 2 * warpSize;
  auto exchange = [&](int i, int k) {
    uint32_t a = words[i], b = words[k];
    words[i] = a < b ? a : b;
    words[k] = a < b ? b : a;
  };
  auto wait = [](bool isNear) {
    if (isNear)
      meetWarp();
    else
      meet();
  };
  for (int length = 2; length <= size; length *= 2) {
    int half = length / 2;
    if (length > near)
      meet();
    for (int pair = thread(); pair < chunk / 2; pair += halvers) {
      int first = pair / half * length, offset = pair % half;
      exchange(first + offset, first + length - 1 - offset);
    }
    wait(length <= near);
    for (int step = half / 2; step; step /= 2) {
      for (int pair = thread(); pair < chunk / 2; pair += halvers) {
        int i = 2 * pair - (pair & (step - 1));
        exchange(i, i + step);
      }
      wait(step <= near / 2);
    }
  }
  meet();
}

/// Halves what is in chunks of elements, a block each.
WARP_KERNEL(halvers, 1) void tree_halve(Halving all) {
  WARP_SHARED uint32_t words[chunk];
  WARP_SHARED int sources[chunk];
  WARP_SHARED uint32_t bounds[6 * (chunk / 16)];
  int first = block() * chunk;
  int valid = all.elements - first < chunk ? all.elements - first : chunk;
  int mine = each * thread();
  for (int i = thread(); i < chunk; i += halvers) {
    int source = first + i;
    if (i < valid) {
      if (all.coarse)
        source = all.coarse[block() * runsInChunk + i / run] * run + i % run;
      if (all.order)
        source = all.order[source];
    }
    sources[i] = source;
    words[i] = lastNumber * chunk | i;
  }
  for (int size = chunk; size > all.stop; size /= 2) {
    // All of them are in the first half.
    if (valid <= size / 2)
      continue;
    for (int i = thread(); i < 6 * (chunk / size); i += halvers)
      bounds[i] = 0;
    meet();
    float center[each][3];
    Box box = nothing();
#pragma unroll
    for (int i = 0; i < each; ++i) {
      uint32_t place = words[mine + i] & placeMask;
      bool isFixed = first + int(place) >= all.elements - all.incomplete;
      Quad at{__builtin_nanf(""), 0, 0, 0};
      if (!isFixed)
        at = all.centers[sources[place]];
      for (int axis = 0; axis < 3; ++axis)
        center[i][axis] = at[axis];
      if (at[0] == at[0])
        box.include(center[i]);
    }
    int lanes = size / each < warpSize ? size / each : warpSize;
    box.uniteLanes(1, lanes);
    uint32_t *own = bounds + 6 * (mine / size);
    if (lane() % lanes == 0 && box.low[0] <= box.high[0])
      for (int axis = 0; axis < 3; ++axis) {
        __scoped_atomic_fetch_max(&own[axis], ordered(box.high[axis]),
                                  __ATOMIC_RELAXED, __MEMORY_SCOPE_WRKGRP);
        __scoped_atomic_fetch_max(&own[3 + axis], ordered(-box.low[axis]),
                                  __ATOMIC_RELAXED, __MEMORY_SCOPE_WRKGRP);
      }
    meet();
    float low[3], high[3];
    readBounds(own, low, high);
    int axis = 0;
    float extent = 0.5f * high[0] - 0.5f * low[0];
    for (int i = 1; i < 3; ++i)
      if (float other = 0.5f * high[i] - 0.5f * low[i]; other > extent) {
        axis = i;
        extent = other;
      }
    float start = axis == 0 ? low[0] : axis == 1 ? low[1] : low[2];
    float fine = float(lastNumber - 1) / upper(extent, 1e-37f);
#pragma unroll
    for (int i = 0; i < each; ++i) {
      float x = axis == 0   ? center[i][0]
                : axis == 1 ? center[i][1]
                            : center[i][2];
      uint32_t number = lastNumber;
      if (center[i][0] == center[i][0]) {
        float at = (0.5f * x - 0.5f * start) * fine;
        number = uint32_t(lower(upper(at, 0), float(lastNumber - 1)));
      }
      words[mine + i] = number * chunk | (words[mine + i] & placeMask);
    }
    meet();
    sortSegments(words, size);
  }
  meet();
  for (int i = thread(); i < valid; i += halvers)
    all.out[first + i] = sources[words[i] & placeMask];
}
