//===- TileFactors.cpp - Cholesky factors ---------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lanes of a warp have a row each, in registers, of as many columns as a panel
// has. A column that is reached goes to the lanes by way of shared memory,
// where four numbers are read at once. Panels one after the other, looking
// left: what columns before a panel take from it, its diagonal block, the rows
// below. Groups of rows are shared by the warps of the block.
//
// Rows are reduced as those of L D L^T: a step needs no root, and no lane's
// quotient but its own. Pivots below the least normal number are no pivots.
//
//===----------------------------------------------------------------------===//

#include "TileMatrices.h"

namespace {

/// A smaller value is no pivot.
constexpr float leastPivot = 1.17549435e-38f;
constexpr double leastDoublePivot = 2.2250738585072014e-308;

/// 1 / x of a pivot, to the last bit.
WARP_INLINE float inverseOfPivot(float x) {
  float y = flushedReciprocal(x);
  return x >= leastPivot ? y : __builtin_nanf("");
}
WARP_INLINE double inverseOfPivot(double x) {
  return x >= leastDoublePivot ? 1 / x : __builtin_nan("");
}

/// The inverse of a pivot's root: one step of Newton's method.
WARP_INLINE float inverseOfRoot(float x) {
  float y = flushedReciprocalRoot(x);
  y = x >= leastPivot ? y : __builtin_nanf("");
  float near = x * y;
  return __builtin_fmaf(0.5f * y, __builtin_fmaf(-near, y, 1.0f), y);
}
WARP_INLINE double inverseOfRoot(double x) {
  return x >= leastDoublePivot ? 1 / __builtin_elementwise_sqrt(x)
                               : __builtin_nan("");
}

/// Columns of a panel without their quotients, row by row, and the inverse
/// roots of its pivots.
template <class T, int width> struct Panel {
  u64 place;

  WARP_INLINE Shared<T> *column(int j) const {
    return shared<T>(place) + j * width;
  }
  WARP_INLINE Shared<T> *inverses() const { return column(width); }
};

/// Eliminates the columns of a panel from a lane's row. The diagonal block
/// makes the panel's columns on the way; its pivots come by shuffles, so that
/// quotients are there when the columns are.
template <class T, int width>
WARP_INLINE void eliminate(T (&a)[width], const Panel<T, width> &panel,
                           bool isDiagonal, i32 lane) {
  using Four = FourOf<T>;
  bool gives = isDiagonal && lane < width;
#pragma unroll
  for (int j = 0; j < width; ++j) {
    T pivot = isDiagonal ? shuffle(a[j], j) : T(panel.column(j)[j]);
    if (gives)
      panel.column(j)[lane] = a[j];
    T ratio = -a[j] * inverseOfPivot(pivot);
    syncWarp();
#pragma unroll
    for (int k = j / 4 * 4; k < width; k += 4) {
      if (k + 3 <= j)
        continue;
      Four others = *(Shared<Four> *)(panel.column(j) + k);
#pragma unroll
      for (int i = 0; i < 4; ++i)
        if (k + i > j)
          a[k + i] = fma(ratio, T(others[i]), a[k + i]);
    }
  }
  if (gives)
    panel.inverses()[lane] = inverseOfRoot(panel.column(lane)[lane]);
  syncWarp();
#pragma unroll
  for (int k = 0; k < width; k += 4) {
    Four over = *(Shared<Four> *)(panel.inverses() + k);
#pragma unroll
    for (int i = 0; i < 4; ++i)
      a[k + i] *= over[i];
  }
}

template <class T, int width> struct Factor : Panels<width> {
  using Four = FourOf<T>;
  MatrixOf<T> to, from;
  Panel<T, width> panel;

  using Panels<width>::n, Panels<width>::has;

  /// A row of the panel that begins at a column, less the columns before it.
  /// The part is beyond the matrix is a unit matrix, or whatever else: nobody
  /// needs it.
  WARP_INLINE void take(T (&a)[width], i32 i, i32 first) const {
    // A lane without a row reads the last one, which its own warp writes.
    i32 row = i < n ? i : n - 1;
#pragma unroll
    for (int k = 0; k < width; k += 4) {
      Four values = {0, 0, 0, 0};
      if (n % 4 == 0) {
        if (has(first + k))
          values = from.four(row, first + k);
      } else {
#pragma unroll
        for (int j = 0; j < 4; ++j)
          if (has(first + k + j))
            values[j] = *from.at(row, first + k + j);
      }
#pragma unroll
      for (int j = 0; j < 4; ++j)
        a[k + j] = has(i) && has(first + k + j) ? values[j]
                   : i == first + k + j         ? T(1)
                                                : T(0);
    }
#pragma clang loop unroll(disable)
    for (i32 j = 0; j < first; j += 4) {
      Four own = to.four(row, j);
#pragma unroll
      for (int k = 0; k < width; ++k) {
        Four other = to.four(has(first + k) ? first + k : 0, j);
#pragma unroll
        for (int q = 0; q < 4; ++q)
          a[k] = fma(T(-own[q]), T(other[q]), a[k]);
      }
    }
  }

  /// The lower triangle of it; zeros beyond.
  WARP_INLINE void give(const T (&a)[width], i32 i, i32 first) const {
    if (i >= n)
      return;
#pragma unroll
    for (int k = 0; k < width; k += 4) {
      Four values;
#pragma unroll
      for (int j = 0; j < 4; ++j)
        values[j] = first + k + j <= i ? a[k + j] : T(0);
      if (n % 4 == 0) {
        if (has(first + k))
          to.setFour(i, first + k, values);
        continue;
      }
#pragma unroll
      for (int j = 0; j < 4; ++j)
        if (has(first + k + j))
          *to.at(i, first + k + j) = values[j];
    }
  }

  WARP_INLINE void eliminateRows(i32 begin, i32 first, bool isDiagonal,
                                 i32 lane) const {
    T a[width];
    take(a, begin + lane, first);
    eliminate(a, panel, isDiagonal, lane);
    give(a, begin + lane, first);
  }

  WARP_INLINE void run(i32 threads) const {
    i32 thread = threadNumber();
    auto [warp, lane, warps] = Position::of(thread, threads);
    if (n <= width) {
      if (warp == 0)
        eliminateRows(0, 0, true, lane);
      return;
    }
#pragma clang loop unroll(disable)
    for (i32 first = 0; first < n; first += width) {
      // The first turn is that of the diagonal block.
      i32 groups = (n - first - 1) / warpSize;
      i32 turns = 1 + (groups + warps - 1) / warps;
#pragma clang loop unroll(disable)
      for (i32 turn = 0; turn < turns; ++turn) {
        i32 group = turn == 0 ? warp : 1 + (turn - 1) * warps + warp;
        if (turn == 0 ? warp == 0 : group <= groups)
          eliminateRows(first + group * warpSize, first, turn == 0, lane);
        if (turn == 0)
          syncBlock(threads);
      }
      this->clearAbove(to, first, thread, threads);
      syncBlock(threads);
    }
  }
};

} // namespace

#define WARP_FACTOR(suffix, T, width)                                          \
  WARP_TILES warp_tile_factor_##suffix##_##width(                              \
      u64 to, i32 toRow, i32 toColumn, u64 from, i32 fromRow, i32 fromColumn,  \
      u64 scratch, i32 n, i32 threads, void *) {                               \
    Factor<T, width>{                                                          \
        {n}, {to, toRow, toColumn}, {from, fromRow, fromColumn}, {scratch}}    \
        .run(threads);                                                         \
  }
WARP_FACTOR(f32, float, 8)
WARP_FACTOR(f32, float, 16)
WARP_FACTOR(f64, double, 8)
WARP_FACTOR(f64, double, 16)
