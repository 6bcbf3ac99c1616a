//===- TileMatrices.h - Matrices in shared memory ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Matrices come with the elements from row to row and column to column, so that
// one code does for both triangles.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GPU_TILEMATRICES_H
#define WARP_DEVICELIB_GPU_TILEMATRICES_H

#include "Tiles.h"

namespace {

template <class T> using FourOf = Vec<T, 4>;
using Four = FourOf<float>;

/// The place of a thread in its block. Branches that all lanes of a warp take
/// alike need no second version for lanes that are apart: the assembler sees
/// that of a warp's number which the first lane gives to the others.
struct Position {
  i32 warp, lane, warps;

  WARP_INLINE static Position of(i32 thread, i32 threads) {
    if (threads == warpSize)
      return {0, thread, 1};
    i32 warp = __builtin_bit_cast(
        i32,
        shuffle(__builtin_bit_cast(float, i32(u32(thread) / warpSize)), 0));
    return {warp, i32(u32(thread) % warpSize), threads / warpSize};
  }
};

/// 1 / x, to the last bit.
WARP_INLINE float inverse(float x) { return reciprocal(x); }
WARP_INLINE double inverse(double x) { return 1 / x; }

template <class T> WARP_INLINE T fma(T x, T y, T sum) {
  return __builtin_elementwise_fma(x, y, sum);
}

template <class T> struct MatrixOf {
  using Four = FourOf<T>;
  u64 place;
  i32 row, column;

  WARP_INLINE Shared<T> *at(i32 i, i32 j) const {
    return shared<T>(place) + (i * row + j * column);
  }
  /// Four elements of a row, the first at a multiple of four.
  WARP_INLINE Four four(i32 i, i32 j) const {
    if (column == 1 && row % 4 == 0)
      return *(Shared<Four> *)at(i, j);
    return Four{*at(i, j), *at(i, j + 1), *at(i, j + 2), *at(i, j + 3)};
  }
  WARP_INLINE void setFour(i32 i, i32 j, Four values) const {
    if (column == 1 && row % 4 == 0) {
      *(Shared<Four> *)at(i, j) = values;
      return;
    }
#pragma unroll
    for (int k = 0; k < 4; ++k)
      *at(i, j + k) = values[k];
  }
};
using Matrix = MatrixOf<float>;

/// A square matrix in panels of `width` columns, the last of which may have
/// fewer.
template <int width> struct Panels {
  i32 n;

  /// True if there is a row or column, which is known of whole panels.
  WARP_INLINE bool has(i32 i) const { return n % width == 0 || i < n; }

  /// Rows above the panel that begins at a column have zeros there.
  template <class T>
  WARP_INLINE void clearAbove(const MatrixOf<T> &matrix, i32 first, i32 thread,
                              i32 threads) const {
#pragma clang loop unroll(disable)
    for (i32 e = thread; e < first * width; e += threads) {
      i32 row = u32(e) / width, column = first + i32(u32(e) % width);
      if (has(column))
        *matrix.at(row, column) = 0;
    }
  }
};

} // namespace

#endif // WARP_DEVICELIB_GPU_TILEMATRICES_H
