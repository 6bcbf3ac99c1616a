//===- TileFactors.cpp - Cholesky factors and triangular systems ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lanes of a warp have a row each, in registers, of as many columns as a panel
// has. A column that is done goes to the lanes by way of the block's memory,
// where four numbers are read at once. Panels one after the other, looking
// left: what columns before a panel take from it, its diagonal block, the rows
// below. Groups of rows are shared by the warps of the block.
//
//===----------------------------------------------------------------------===//

#include "TileMatrices.h"

namespace {

/// The root of a number, to the last bit but one, and its inverse: one step of
/// Newton's method each. The root of what is not positive is NaN.
WARP_INLINE float root(float x, float &over) {
  float y;
  asm("rsqrt.approx.f32 %0, %1;" : "=f"(y) : "f"(x));
  y = x > 0 ? y : __builtin_nanf("");
  over = __builtin_fmaf(0.5f * y, __builtin_fmaf(-(x * y), y, 1.0f), y);
  float near = x * over;
  return __builtin_fmaf(0.5f * over, __builtin_fmaf(-near, near, x), near);
}

/// Columns of a panel, row by row, and the inverses of its diagonal.
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
#pragma unroll
  for (int j = 0; j < width; ++j) {
    if (isDiagonal) {
      float over, diagonal = root(fromLane(a[j], j), over);
      a[j] = lane == j ? diagonal : a[j] * over;
      if (lane < width)
        panel.column(j)[lane] = a[j];
      if (lane == 0)
        panel.inverses()[j] = over;
      meetLanes();
    } else {
      a[j] *= panel.inverses()[j];
    }
#pragma unroll
    for (int k = (j + 1) / 4 * 4; k < width; k += 4) {
      Four others = *(Shared<Four> *)(panel.column(j) + k);
#pragma unroll
      for (int i = 0; i < 4; ++i)
        if (k + i > j)
          a[k + i] = __builtin_fmaf(-a[j], others[i], a[k + i]);
    }
  }
}

template <int width> struct Factor {
  Matrix to, from;
  i32 n;
  Panel<width> panel;

  /// A row of the panel that begins at a column, less what is before it. What
  /// is beyond the matrix is a unit matrix.
  WARP_INLINE void take(float (&a)[width], i32 i, i32 first) const {
    bool exists = i < n;
    i32 row = exists ? i : 0;
#pragma unroll
    for (int k = 0; k < width; k += 4) {
      Four values = {0, 0, 0, 0};
      if (n % 4 == 0) {
        if (exists && first + k < n)
          values = from.four(row, first + k);
      } else {
#pragma unroll
        for (int j = 0; j < 4; ++j)
          if (exists && first + k + j < n)
            values[j] = *from.at(row, first + k + j);
      }
#pragma unroll
      for (int j = 0; j < 4; ++j)
        a[k + j] = exists && first + k + j < n ? values[j]
                   : i == first + k + j        ? 1.0f
                                               : 0.0f;
    }
#pragma clang loop unroll(disable)
    for (i32 j = 0; j < first; j += 4) {
      Four own = to.four(row, j);
#pragma unroll
      for (int k = 0; k < width; ++k) {
        Four other = to.four(first + k < n ? first + k : 0, j);
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
        if (first + k < n)
          to.setFour(i, first + k, values);
        continue;
      }
#pragma unroll
      for (int j = 0; j < 4; ++j)
        if (first + k + j < n)
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
    i32 warp = u32(thread) / 32, lane = u32(thread) % 32, warps = threads / 32;
    if (n <= width) {
      if (warp == 0)
        eliminateRows(0, 0, true, lane);
      return;
    }
#pragma clang loop unroll(disable)
    for (i32 first = 0; first < n; first += width) {
      // The first turn is that of the diagonal block.
      i32 groups = (n - first - 1) / 32;
      i32 turns = 1 + (groups + warps - 1) / warps;
#pragma clang loop unroll(disable)
      for (i32 turn = 0; turn < turns; ++turn) {
        i32 group = turn == 0 ? warp : 1 + (turn - 1) * warps + warp;
        if (turn == 0 ? warp == 0 : group <= groups)
          eliminateRows(first + group * 32, first, turn == 0, lane);
        if (turn == 0)
          meet(threads);
      }
      // Rows above have zeros there.
#pragma clang loop unroll(disable)
      for (i32 i = thread; i < first; i += threads)
#pragma clang loop unroll(disable)
        for (i32 k = first; k < first + width && k < n; ++k)
          *to.at(i, k) = 0;
      meet(threads);
    }
  }
};

/// Columns of the right side are shared by warps; lanes have every 32nd row of
/// one.
template <int rows, bool backwards>
WARP_INLINE void solve(u64 sides, const Matrix &matrix, i32 n, i32 columns,
                       i32 threads) {
  i32 thread = threadNumber();
  i32 warp = u32(thread) / 32, lane = u32(thread) % 32, warps = threads / 32;
  float over[rows];
#pragma unroll
  for (int r = 0; r < rows; ++r) {
    i32 i = r * 32 + lane;
    over[r] = i < n ? inverse(*matrix.at(i, i)) : 0.0f;
  }
#pragma clang loop unroll(disable)
  for (i32 c = warp; c < columns; c += warps) {
    Shared<float> *side = shared<float>(sides) + c;
    float x[rows];
#pragma unroll
    for (int r = 0; r < rows; ++r)
      x[r] = r * 32 + lane < n ? side[(r * 32 + lane) * columns] : 0.0f;
#pragma unroll
    for (int step = 0; step < rows; ++step) {
      int block = backwards ? rows - 1 - step : step;
      i32 begin = block * 32;
      i32 count = n - begin < 32 ? n - begin : 32;
#pragma clang loop unroll(disable)
      for (i32 four = 0; four < count; four += 4)
#pragma unroll
        for (int q = 0; q < 4; ++q)
          if (four + q < count) {
            i32 j = backwards ? count - 1 - four - q : four + q;
            float own = x[block] * over[block];
            if (lane == j)
              x[block] = own;
            float known = fromLane(own, j);
#pragma unroll
            for (int r = 0; r < rows; ++r) {
              i32 i = r * 32 + lane;
              bool isLeft = backwards ? i < begin + j : i > begin + j && i < n;
              bool mayBeLeft = backwards ? r <= block : r >= block;
              if (mayBeLeft && isLeft)
                x[r] = __builtin_fmaf(-*matrix.at(i, begin + j), known, x[r]);
            }
          }
    }
#pragma unroll
    for (int r = 0; r < rows; ++r)
      if (r * 32 + lane < n)
        side[(r * 32 + lane) * columns] = x[r];
  }
}

} // namespace

#define WARP_FACTOR(width)                                                     \
  WARP_TILES warp_tile_factor_##width(                                         \
      u64 to, i32 toRow, i32 toColumn, u64 from, i32 fromRow, i32 fromColumn,  \
      u64 scratch, i32 n, i32 threads, void *) {                               \
    Factor<width>{                                                             \
        {to, toRow, toColumn}, {from, fromRow, fromColumn}, n, {scratch}}      \
        .run(threads);                                                         \
  }
WARP_FACTOR(8)
WARP_FACTOR(16)
WARP_FACTOR(32)

#define WARP_SUBSTITUTE(rows)                                                  \
  WARP_TILES warp_tile_substitute_##rows(u64 sides, u64 matrix, i32 row,       \
                                         i32 column, i32 n, i32 columns,       \
                                         i32 backwards, i32 threads, void *) { \
    if (backwards)                                                             \
      solve<rows, true>(sides, {matrix, row, column}, n, columns, threads);    \
    else                                                                       \
      solve<rows, false>(sides, {matrix, row, column}, n, columns, threads);   \
  }
WARP_SUBSTITUTE(1)
WARP_SUBSTITUTE(2)
WARP_SUBSTITUTE(4)
