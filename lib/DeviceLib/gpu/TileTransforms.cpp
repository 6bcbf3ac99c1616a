//===- TileTransforms.cpp - Fourier transforms of the rows of a tile ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lengths are powers of two. A thread has `radix` elements of a row in
// registers and transforms them; then threads exchange elements through the
// shared memory (Stockham's order, as in cpu/TileTransforms.cpp):
//
//   y[q + s (r p + k)] = w^(k p s) sum over j of e^(-2 pi i j k / r)
//                        x[q + s p + j n / r]
//
// for q < s and p < n / (r s), with w = e^(-2 pi i / n). In the exchange eight
// elements are followed by a gap, so that those of a warp lie in different
// banks. A thread computes the first of the powers of w. The inverse has real
// and imaginary parts swapped.
//
//===----------------------------------------------------------------------===//

#include "Tiles.h"

extern "C" void __nv_sincospif(float, float *, float *);

namespace {

using Complex = Vec<float, 2>;

WARP_INLINE Complex times(Complex a, Complex b) {
  return {__builtin_fmaf(a.x, b.x, -a.y * b.y),
          __builtin_fmaf(a.x, b.y, a.y * b.x)};
}
/// Times -i.
WARP_INLINE Complex turned(Complex a) { return {a.y, -a.x}; }

/// In place; element k of the result at place k.
template <int radix> struct Butterfly;
template <> struct Butterfly<2> {
  WARP_INLINE static void run(Complex *x) {
    Complex a = x[0], b = x[1];
    x[0] = a + b;
    x[1] = a - b;
  }
};
template <> struct Butterfly<4> {
  WARP_INLINE static void run(Complex *x) {
    Complex even = x[0] + x[2], left = x[0] - x[2];
    Complex odd = x[1] + x[3], right = turned(x[1] - x[3]);
    x[0] = even + odd;
    x[1] = left + right;
    x[2] = even - odd;
    x[3] = left - right;
  }
};
/// The transforms of even elements and of odd ones, rotated by their place.
template <int radix> struct Butterfly {
  static constexpr int half = radix / 2;

  /// cos of pi / 8 times the place, for sixteenths of a turn.
  WARP_INLINE static constexpr float cosine(int eighths) {
    constexpr float values[] = {1.0f,          0.923879533f, 0.707106781f,
                                0.382683432f,  0.0f,         -0.382683432f,
                                -0.707106781f, -0.923879533f};
    return values[eighths];
  }
  WARP_INLINE static constexpr float sine(int eighths) {
    return eighths < 4 ? cosine(4 - eighths) : cosine(eighths - 4);
  }
  WARP_INLINE static void run(Complex *x) {
    Complex even[half], odd[half];
#pragma unroll
    for (int k = 0; k < half; ++k) {
      even[k] = x[2 * k];
      odd[k] = x[2 * k + 1];
    }
    Butterfly<half>::run(even);
    Butterfly<half>::run(odd);
#pragma unroll
    for (int k = 0; k < half; ++k) {
      int eighths = k * 16 / radix;
      Complex other =
          eighths == 0 ? odd[k]
          : eighths == 4
              ? turned(odd[k])
              : times(odd[k], Complex{cosine(eighths), -sine(eighths)});
      x[k] = even[k] + other;
      x[k + half] = even[k] - other;
    }
  }
};

/// Rows in memory, packed, or with gaps in the exchange.
struct Row {
  Shared<Complex> *at;
  bool hasGaps;

  WARP_INLINE Shared<Complex> &operator[](i32 i) const {
    return at[hasGaps ? i + i / 8 : i];
  }
};

/// One pass with `own / radix` butterflies of a thread.
template <int own, int radix>
WARP_INLINE void transform(Complex (&x)[own], i32 n, i32 stride, i32 place,
                           i32 lanes) {
#pragma unroll
  for (int b = 0; b < own / radix; ++b) {
    Complex y[radix];
#pragma unroll
    for (int j = 0; j < radix; ++j)
      y[j] = x[b + j * (own / radix)];
    Butterfly<radix>::run(y);
    i32 p = u32(place + b * lanes) / u32(stride);
    if (stride * radix < n) {
      Complex w[radix];
      float sine, cosine;
      __nv_sincospif(-2.0f * float(p * stride) / float(n), &sine, &cosine);
      w[1] = {cosine, sine};
#pragma unroll
      for (int k = 2; k < radix; ++k)
        w[k] = times(w[k / 2], w[k - k / 2]);
#pragma unroll
      for (int k = 1; k < radix; ++k)
        y[k] = times(y[k], w[k]);
    }
#pragma unroll
    for (int k = 0; k < radix; ++k)
      x[b + k * (own / radix)] = y[k];
  }
}

template <int own, int radix>
WARP_INLINE void give(const Complex (&x)[own], const Row &to, i32 stride,
                      i32 place, i32 lanes, bool swaps) {
#pragma unroll
  for (int b = 0; b < own / radix; ++b) {
    i32 i = place + b * lanes;
    i32 p = u32(i) / u32(stride), q = u32(i) % u32(stride);
#pragma unroll
    for (int k = 0; k < radix; ++k) {
      Complex y = x[b + k * (own / radix)];
      to[q + stride * (radix * p + k)] = swaps ? Complex{y.y, y.x} : y;
    }
  }
}

template <int own> struct Rows {
  u64 tile, scratch;
  i32 n, threads;
  bool swaps;

  /// The last pass, which has what is left of the length.
  template <int radix>
  WARP_INLINE void finish(Complex (&x)[own], i32 stride, i32 place, i32 lanes,
                          const Row &to) const {
    transform<own, radix>(x, n, stride, place, lanes);
    give<own, radix>(x, to, stride, place, lanes, swaps);
  }

  /// A row, by `lanes` threads. Threads without one only join the barriers.
  WARP_INLINE void run(i32 row, i32 group, i32 place, bool exists) const {
    i32 lanes = n / own;
    Row packed{shared<Complex>(tile) + row * n, false};
    Row gaps{shared<Complex>(scratch) + group * (n + n / 8), true};
    Complex x[own];
    if (exists)
#pragma unroll
      for (int j = 0; j < own; ++j) {
        Complex value = packed[place + j * lanes];
        x[j] = swaps ? Complex{value.y, value.x} : value;
      }
    i32 stride = 1;
#pragma clang loop unroll(disable)
    for (; stride * own < n; stride *= own) {
      if (exists)
        transform<own, own>(x, n, stride, place, lanes);
      // Before it is written again, all have read it.
      if (stride > 1)
        syncBlock(threads);
      if (exists)
        give<own, own>(x, gaps, stride, place, lanes, false);
      syncBlock(threads);
      if (exists)
#pragma unroll
        for (int j = 0; j < own; ++j)
          x[j] = gaps[place + j * lanes];
    }
    if (!exists)
      return;
    i32 left = n / stride;
    if (left == own)
      finish<own>(x, stride, place, lanes, packed);
    else if (own > 8 && left == 8)
      finish<own / 2>(x, stride, place, lanes, packed);
    else if (own > 4 && left == 4)
      finish<4>(x, stride, place, lanes, packed);
    else
      finish<2>(x, stride, place, lanes, packed);
  }

  WARP_INLINE void runAll(i32 rows) const {
    i32 thread = threadNumber(), lanes = n / own, groups = threads / lanes;
    i32 group = u32(thread) / u32(lanes), place = u32(thread) % u32(lanes);
#pragma clang loop unroll(disable)
    for (i32 first = 0; first < rows; first += groups) {
      i32 row = first + group;
      bool exists = group < groups && row < rows;
      run(exists ? row : 0, group, place, exists);
      if (first + groups < rows)
        syncBlock(threads);
    }
  }
};

} // namespace

#define WARP_TRANSFORM(own)                                                    \
  WARP_TILES warp_tile_transform_##own(u64 tile, u64 scratch, i32 rows, i32 n, \
                                       i32 isInverse, i32 threads, void *) {   \
    Rows<own>{tile, scratch, n, threads, isInverse != 0}.runAll(rows);         \
  }
WARP_TRANSFORM(4)
WARP_TRANSFORM(8)
WARP_TRANSFORM(16)
