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

/// 1 / x of a pivot, to the last bit.
WARP_INLINE float inverseOfPivot(float x) {
  float y = flushedReciprocal(x);
  return x >= leastPivot ? y : __builtin_nanf("");
}

/// The inverse of a pivot's root: one step of Newton's method.
WARP_INLINE float inverseOfRoot(float x) {
  float y = flushedReciprocalRoot(x);
  y = x >= leastPivot ? y : __builtin_nanf("");
  float near = x * y;
  return __builtin_fmaf(0.5f * y, __builtin_fmaf(-near, y, 1.0f), y);
}

/// Columns of a panel without their quotients, row by row, and the inverse
/// roots of its pivots.
template <int width> struct Panel {
  u64 place;

  WARP_INLINE Shared<float> *column(int j) const {
    return shared<float>(place) + j * width;
  }
  WARP_INLINE Shared<float> *inverses() const { return column(width); }
};

/// Eliminates the columns of a panel from a lane's row. The diagonal block
/// makes the panel's columns on the way.
template <int width>
WARP_INLINE void eliminate(float (&a)[width], const Panel<width> &panel,
                           bool isDiagonal, i32 lane) {
  bool gives = isDiagonal && lane < width;
#pragma unroll
  for (int j = 0; j < width; ++j) {
    if (gives)
      panel.column(j)[lane] = a[j];
    syncWarp();
    float ratio = 0;
#pragma unroll
    for (int k = j / 4 * 4; k < width; k += 4) {
      Four others = *(Shared<Four> *)(panel.column(j) + k);
      if (k <= j)
        ratio = -a[j] * inverseOfPivot(others[j - k]);
#pragma unroll
      for (int i = 0; i < 4; ++i)
        if (k + i > j)
          a[k + i] = __builtin_fmaf(ratio, others[i], a[k + i]);
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

template <int width> struct Factor : Panels<width> {
  Matrix to, from;
  Panel<width> panel;

  using Panels<width>::n, Panels<width>::has;

  /// A row of the panel that begins at a column, less the columns before it.
  /// The part is beyond the matrix is a unit matrix, or whatever else: nobody
  /// needs it.
  WARP_INLINE void take(float (&a)[width], i32 i, i32 first) const {
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
                   : i == first + k + j         ? 1.0f
                                                : 0.0f;
    }
#pragma clang loop unroll(disable)
    for (i32 j = 0; j < first; j += 4) {
      Four own = to.four(row, j);
#pragma unroll
      for (int k = 0; k < width; ++k) {
        Four other = to.four(has(first + k) ? first + k : 0, j);
#pragma unroll
        for (int q = 0; q < 4; ++q)
          a[k] = __builtin_fmaf(-own[q], other[q], a[k]);
      }
    }
  }

  /// The lower triangle of it; zeros beyond.
  WARP_INLINE void give(const float (&a)[width], i32 i, i32 first) const {
    if (i >= n)
      return;
#pragma unroll
    for (int k = 0; k < width; k += 4) {
      Four values;
#pragma unroll
      for (int j = 0; j < 4; ++j)
        values[j] = first + k + j <= i ? a[k + j] : 0.0f;
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
    float a[width];
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

#define WARP_FACTOR(width)                                                     \
  WARP_TILES warp_tile_factor_##width(                                         \
      u64 to, i32 toRow, i32 toColumn, u64 from, i32 fromRow, i32 fromColumn,  \
      u64 scratch, i32 n, i32 threads, void *) {                               \
    Factor<width>{                                                             \
        {n}, {to, toRow, toColumn}, {from, fromRow, fromColumn}, {scratch}}    \
        .run(threads);                                                         \
  }
WARP_FACTOR(8)
WARP_FACTOR(16)
