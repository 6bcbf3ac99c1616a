//===- TileDoubleProducts.cpp - Products in double precision --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// By the matrix instructions of compute capability 9.0, which round each of
// their sums as a fused multiply-add does: twice as many of these as threads
// make by themselves.
//
//===----------------------------------------------------------------------===//

#include "TileSums.h"

namespace {

/// Four elements of the depth of 16 x 8 sums, of which a thread has one in two
/// rows, eight apart, and in a column.
WARP_INLINE void multiplyFragment(double *sum, double upper, double lower,
                                  double column) {
  asm("mma.sync.aligned.m16n8k4.row.col.f64.f64.f64.f64 {%0, %1, %2, %3}, "
      "{%4, %5}, {%6}, {%0, %1, %2, %3};"
      : "+d"(sum[0]), "+d"(sum[1]), "+d"(sum[2]), "+d"(sum[3])
      : "d"(upper), "d"(lower), "d"(column));
}

/// A thread's elements of a factor, every eighth row or column.
template <bool along, int n>
WARP_INLINE void read(double (&to)[n], u64 from, i32 pitch, i32 first, i32 k) {
#pragma unroll
  for (int i = 0; i < n; ++i) {
    i32 place = first + i * 8;
    to[i] = shared<double>(from)[along ? place * pitch + k : k * pitch + place];
  }
}

template <int R, int C, bool aAlong, bool bAlong>
WARP_INLINE void multiplyDoubles(u64 sums, u64 a, u64 b, i32 m, i32 n,
                                 i32 depth, i32 aPitch, i32 bPitch,
                                 bool subtracts) {
  using Layout = Warps<R, C, double>;
  Layout layout(m, n, threadNumber());
  double sum[Layout::slots];
  double *kept = own<double>(sums);
#pragma unroll
  for (int i = 0; i < Layout::slots; ++i)
    sum[i] = kept[i];
  i32 across = layout.lane / 4, along = layout.lane % 4;
#pragma clang loop unroll_count(2)
  for (i32 k = 0; k < depth; k += 4) {
    double x[R / 8], y[C / 8];
    read<aAlong>(x, a, aPitch, layout.firstRow + across, k + along);
    read<bAlong>(y, b, bPitch, layout.firstColumn + across, k + along);
#pragma unroll
    for (int i = 0; i < R / 16; ++i)
#pragma unroll
      for (int j = 0; j < C / 8; ++j)
        multiplyFragment(sum + (i * (C / 8) + j) * 4, x[2 * i], x[2 * i + 1],
                         subtracts ? -y[j] : y[j]);
  }
#pragma unroll
  for (int i = 0; i < Layout::slots; ++i)
    kept[i] = sum[i];
}

} // namespace

#define WARP_DOUBLES(R, C)                                                     \
  WARP_LAYOUT(f64_mma_##R##x##C, Warps<R, C, double>)                          \
  WARP_PRODUCT(f64_##R##x##C##_kk, multiplyDoubles, R, C, true, true)          \
  WARP_PRODUCT(f64_##R##x##C##_kn, multiplyDoubles, R, C, true, false)         \
  WARP_PRODUCT(f64_##R##x##C##_mk, multiplyDoubles, R, C, false, true)         \
  WARP_PRODUCT(f64_##R##x##C##_mn, multiplyDoubles, R, C, false, false)

WARP_DOUBLES(64, 32)
WARP_DOUBLES(32, 32)
WARP_DOUBLES(32, 16)
WARP_DOUBLES(16, 32)
WARP_DOUBLES(16, 16)
