//===- Scan.cpp - Prefix sums on CUDA -------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Three kernels: the sum of each block's stretch of the sequence, the sums of
// what precedes each stretch (one block), and the results. A sum always has
// the same shape, so that equal input gives equal bits. A stretch is worked
// off in rounds of `tile` elements, four neighbours per thread.
//
// Rows of the grid are the components of vectors.
//
//===----------------------------------------------------------------------===//

#include "Gpu.h"

using namespace gpu;

static constexpr int threads = 256;
static constexpr int warps = threads / warpSize;
static constexpr int perThread = 4;
static constexpr int tile = threads * perThread;

namespace {

template <typename T> struct Quad {
  T at[perThread];
};

/// A component of the sequence, from the first element of a stretch.
template <typename T> struct Stretch {
  const char *in;
  char *out;
  int64_t inStride, outStride;
  int64_t count;
  /// Neighbours can be moved at once.
  bool packed;

  Quad<T> load(int64_t first) const {
    using Wide = T __attribute__((ext_vector_type(perThread)));
    Quad<T> quad;
    if (packed && first + perThread <= count)
      return __builtin_bit_cast(
          Quad<T>, *reinterpret_cast<const Wide *>(in + first * sizeof(T)));
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      quad.at[i] =
          first + i < count
              ? *reinterpret_cast<const T *>(in + (first + i) * inStride)
              : T(0);
    return quad;
  }

  void store(int64_t first, const Quad<T> &quad) const {
    using Wide = T __attribute__((ext_vector_type(perThread)));
    if (packed && first + perThread <= count) {
      *reinterpret_cast<Wide *>(out + first * sizeof(T)) =
          __builtin_bit_cast(Wide, quad);
      return;
    }
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      if (first + i < count)
        *reinterpret_cast<T *>(out + (first + i) * outStride) = quad.at[i];
  }
};

} // namespace

/// The sum of `value` over the threads before this one, and over all.
template <typename T> static T sumBefore(T value, T &total) {
  WARP_SHARED T sums[warps];
  T own = sumOfLanes(value);
  int warp = thread() / warpSize;
  meet();
  if (lane() == warpSize - 1)
    sums[warp] = own;
  meet();
  T before = 0;
  total = 0;
#pragma unroll
  for (int i = 0; i < warps; ++i) {
    if (i == warp)
      before = total;
    total += sums[i];
  }
  T previous = fromBefore(own, 1);
  return lane() == 0 ? before : before + previous;
}

template <typename T>
static Stretch<T> stretchOf(const void *in, int64_t inStride, void *out,
                            int64_t outStride, int64_t count, int64_t length) {
  int64_t first = block() * length;
  int64_t left = count - first;
  Stretch<T> stretch;
  stretch.inStride = inStride;
  stretch.outStride = outStride;
  stretch.in =
      static_cast<const char *>(in) + first * inStride + blockRow() * sizeof(T);
  stretch.out =
      static_cast<char *>(out) + first * outStride + blockRow() * sizeof(T);
  stretch.count = left < length ? left : length;
  uint64_t places = reinterpret_cast<uint64_t>(stretch.in) |
                    reinterpret_cast<uint64_t>(stretch.out);
  stretch.packed = inStride == sizeof(T) && outStride == sizeof(T) &&
                   places % (perThread * sizeof(T)) == 0;
  return stretch;
}

template <typename T>
static void sumStretch(const void *in, int64_t inStride, int64_t count,
                       int64_t length, T *sums) {
  Stretch<T> stretch =
      stretchOf<T>(in, inStride, nullptr, inStride, count, length);
  stretch.packed =
      inStride == sizeof(T) &&
      reinterpret_cast<uint64_t>(stretch.in) % (perThread * sizeof(T)) == 0;
  T sum = 0;
  // The loads of several rounds wait for memory together.
  constexpr int ahead = 16 / sizeof(T);
  for (int64_t first = 0; first < stretch.count; first += ahead * tile) {
    Quad<T> quads[ahead];
#pragma unroll
    for (int i = 0; i < ahead; ++i)
      quads[i] = stretch.load(first + i * tile + thread() * perThread);
#pragma unroll
    for (int i = 0; i < ahead; ++i) {
      const Quad<T> &quad = quads[i];
      sum += (quad.at[0] + quad.at[1]) + (quad.at[2] + quad.at[3]);
    }
  }
  T total;
  sumBefore(sum, total);
  if (thread() == 0)
    sums[blockRow() * blocks() + block()] = total;
}

/// One block per component, for at most `tile` sums.
template <typename T> static void sumSums(T *sums, int count) {
  sums += blockRow() * count;
  Stretch<T> stretch{reinterpret_cast<char *>(sums),
                     reinterpret_cast<char *>(sums),
                     sizeof(T),
                     sizeof(T),
                     count,
                     false};
  int first = thread() * perThread;
  Quad<T> quad = stretch.load(first);
  T total, sum = 0;
  T before =
      sumBefore((quad.at[0] + quad.at[1]) + (quad.at[2] + quad.at[3]), total);
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    T own = quad.at[i];
    quad.at[i] = before + sum;
    sum += own;
  }
  stretch.store(first, quad);
}

template <typename T>
static void scanStretch(const void *in, int64_t inStride, void *out,
                        int64_t outStride, int64_t count, int64_t length,
                        const T *sums, int inclusive) {
  Stretch<T> stretch =
      stretchOf<T>(in, inStride, out, outStride, count, length);
  T before = sums[blockRow() * blocks() + block()];
  Quad<T> next = stretch.load(thread() * perThread);
  for (int64_t first = 0; first < stretch.count; first += tile) {
    int64_t mine = first + thread() * perThread;
    Quad<T> quad = next;
    // `out` may be `in`, but what comes next is not written yet.
    next = stretch.load(mine + tile);
    T own = 0, total;
    Quad<T> sum;
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      T with = own + quad.at[i];
      sum.at[i] = inclusive ? with : own;
      own = with;
    }
    T start = before + sumBefore(own, total);
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      sum.at[i] += start;
    stretch.store(mine, sum);
    before += total;
  }
}

#define WARP_SCAN(name, T)                                                     \
  WARP_KERNEL(threads, 4)                                                      \
  void scan_sum_##name(const void *in, int64_t inStride, int64_t count,        \
                       int64_t length, T *sums) {                              \
    sumStretch<T>(in, inStride, count, length, sums);                          \
  }                                                                            \
  WARP_KERNEL(threads, 4) void scan_sums_##name(T *sums, int count) {          \
    sumSums<T>(sums, count);                                                   \
  }                                                                            \
  WARP_KERNEL(threads, 4)                                                      \
  void scan_write_##name(const void *in, int64_t inStride, void *out,          \
                         int64_t outStride, int64_t count, int64_t length,     \
                         const T *sums, int inclusive) {                       \
    scanStretch<T>(in, inStride, out, outStride, count, length, sums,          \
                   inclusive);                                                 \
  }

WARP_SCAN(u32, uint32_t)
WARP_SCAN(u64, uint64_t)
WARP_SCAN(f32, float)
WARP_SCAN(f64, double)
