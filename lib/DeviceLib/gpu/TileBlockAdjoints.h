//===- TileBlockAdjoints.h - Adjoints of diagonal blocks --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The cotangent of a Cholesky factor. With the cotangent D' of a block L, that
// of what it was computed from is the lower triangle, the diagonal halved, of G
// = L^-T P L^-1, where P is symmetric and has the lower triangle of L^T D'.
// Lanes of a warp have a column each.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GPU_TILEBLOCKADJOINTS_H
#define WARP_DEVICELIB_GPU_TILEBLOCKADJOINTS_H

#include "TileMatrices.h"

namespace {

/// The following elements are loaded when these are computed, not before:
/// registers are few.
template <int width> WARP_INLINE void launderAll(float (&x)[width]) {
#pragma unroll
  for (int i = 0; i < width; i += 8)
    launderEight(x + i);
}

template <int width> struct BlockAdjoint : Panels<width> {
  Matrix bar, factor;
  /// A column per row of a block, then the symmetric sum of its cotangent.
  u64 scratch;

  using Panels<width>::n, Panels<width>::has;

  WARP_INLINE Shared<float> *rowOf(int j) const {
    return shared<float>(scratch) + j * width;
  }

  /// Four elements up to the diagonal of row i of the factor of a block. The
  /// part is beyond the matrix is a unit matrix.
  WARP_INLINE Four factorFour(i32 first, int i, int k) const {
    bool exists = has(first + i);
    if (n % 4 == 0 && exists)
      return factor.four(first + i, first + k);
    Four values;
#pragma unroll
    for (int q = 0; q < 4; ++q)
      values[q] = !exists      ? float(k + q == i)
                  : k + q <= i ? *factor.at(first + i, first + k + q)
                               : 0.0f;
    return values;
  }

  /// L^-T times a column that a thread has.
  WARP_INLINE void substitute(float (&x)[width], i32 first) const {
#pragma unroll
    for (int i = width - 1; i >= 0; --i) {
#pragma unroll
      for (int k = i / 4 * 4; k >= 0; k -= 4) {
        Four row = factorFour(first, i, k);
        if (k + 4 > i)
          x[i] *= inverse(row[i - k]);
#pragma unroll
        for (int q = 0; q < 4; ++q)
          if (k + q < i)
            x[k + q] = __builtin_fmaf(-row[q], x[i], x[k + q]);
      }
      if (i % 2 == 0)
        launderAll(x);
    }
  }

  /// A column, when all lanes have written.
  WARP_INLINE void exchange(float (&x)[width], i32 own) const {
    syncWarp();
#pragma unroll
    for (int i = 0; i < width; ++i)
      x[i] = rowOf(i)[own];
    syncWarp();
  }

  /// The block that begins at a row, whose columns lanes have: the part that
  /// they have of the cotangent gives G, which is left in shared memory,
  /// too.
  WARP_INLINE void reverseBlock(float (&a)[width], i32 first, i32 lane) const {
    bool writes = lane < width;
    i32 own = writes ? lane : 0;
    float x[width];
#pragma unroll
    for (int k = 0; k < width; ++k)
      x[k] = 0;
#pragma unroll
    for (int i = 0; i < width; ++i) {
#pragma unroll
      for (int k = 0; k <= i; k += 4) {
        Four row = factorFour(first, i, k);
#pragma unroll
        for (int q = 0; q < 4; ++q)
          if (k + q <= i)
            x[k + q] = __builtin_fmaf(row[q], a[i], x[k + q]);
      }
      if (i % 2 == 1)
        launderAll(x);
    }
#pragma unroll
    for (int k = 0; k < width; ++k)
      if (writes && k >= lane) {
        rowOf(k)[lane] = x[k];
        rowOf(lane)[k] = x[k];
      }
    exchange(x, own);
    // From both sides.
#pragma clang loop unroll(disable)
    for (int side = 0; side < 2; ++side) {
      substitute(x, first);
      if (writes)
#pragma unroll
        for (int i = 0; i < width; i += 4)
          *(Shared<Four> *)(rowOf(lane) + i) =
              Four{x[i], x[i + 1], x[i + 2], x[i + 3]};
      exchange(x, own);
    }
    if (!writes || !has(first + lane))
      return;
#pragma unroll
    for (int i = 0; i < width; ++i)
      if (has(first + i))
        *bar.at(first + i, first + lane) = i > lane    ? x[i]
                                           : i == lane ? 0.5f * x[i]
                                                       : 0.0f;
  }
};

} // namespace

#endif // WARP_DEVICELIB_GPU_TILEBLOCKADJOINTS_H
