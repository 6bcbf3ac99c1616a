//===- TileSquares.h - Squares of a matrix in registers ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As many rows as a vector has elements, a vector each.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_TILESQUARES_H
#define WARP_DEVICELIB_CPU_TILESQUARES_H

#include "Tiles.h"

namespace {

template <class T> struct Square {
  static constexpr int size = lanes<T>;
  Vec<T> rows[size];

  /// From a row-major matrix; what is beyond `height` and `width` is zero.
  __attribute__((always_inline)) void read(const T *from, i64 pitch, i64 height,
                                           i64 width) {
    T padded[size * size];
    if (height < size || width < size) {
      for (i64 r = 0; r < size; ++r)
        store(padded + r * size,
              r < height ? load(from + r * pitch, width) : Vec<T>(0));
      from = padded;
      pitch = size;
    }
#pragma unroll
    for (int r = 0; r < size; ++r)
      rows[r] = load(from + r * pitch);
  }
  __attribute__((always_inline)) void write(T *to, i64 pitch, i64 height,
                                            i64 width) const {
    T padded[size * size];
    bool isPart = height < size || width < size;
    T *first = isPart ? padded : to;
    i64 step = isPart ? size : pitch;
#pragma unroll
    for (int r = 0; r < size; ++r)
      store(first + r * step, rows[r]);
    if (isPart)
      for (i64 r = 0; r < height; ++r)
        store(to + r * pitch, load(padded + r * size), width);
  }
  __attribute__((always_inline)) void transpose() {
#pragma unroll
    for (int stage = 1; stage < size; stage *= 2) {
      Square old = *this;
#pragma unroll
      for (int i = 0; i < size / 2; ++i)
#pragma unroll
        for (int l = 0; l < size; ++l) {
          Vec<T> a = old.rows[i], b = old.rows[i + size / 2];
          rows[2 * i][l] = l % 2 ? b[l / 2] : a[l / 2];
          rows[2 * i + 1][l] =
              l % 2 ? b[size / 2 + l / 2] : a[size / 2 + l / 2];
        }
    }
  }
  /// What is above the diagonal, or below it, becomes zero.
  __attribute__((always_inline)) void clear(bool above) {
#pragma unroll
    for (int r = 0; r < size; ++r)
#pragma unroll
      for (int l = 0; l < size; ++l)
        if (above ? l > r : l < r)
          rows[r][l] = 0;
  }
};

/// Calls `work` for the rows of blocks: first row and how many there are.
template <class T, class Work> inline void overBlocks(i64 n, const Work &work) {
  for (i64 i = 0; i < n; i += lanes<T>)
    work(i, n - i < lanes<T> ? n - i : i64(lanes<T>));
}

} // namespace

#endif // WARP_DEVICELIB_CPU_TILESQUARES_H
