//===- TileFactorAdjoints.cpp - What a matrix does to its Cholesky factor -===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Iain Murray, Differentiation of the Cholesky decomposition, 2016, section 4:
// in place of the cotangent of the factor, blocks of columns from the last to
// the first. With the block's rows D and R to the left of it, and the rows
// below, C and B to the left of it:
//
//   C' = C' D^-1,   B' -= C' R,   D' -= C'^T C,
//   D' = that of a block,   R' -= C'^T B + (D' + D'^T) R
//
// Threads have a column each, in registers, as many as a block is wide, and
// multiply it with rows that they all read, four numbers at once; in the
// quotient they have a row.
//
//===----------------------------------------------------------------------===//

#include "TileMatrices.h"

namespace {

template <int width> struct FactorAdjoint {
  Matrix bar, factor;
  i32 n;
  /// A column per row of a block, then the symmetric sum of its cotangent.
  u64 scratch;
  i32 threads;

  WARP_INLINE Shared<float> *rowOf(int j) const {
    return shared<float>(scratch) + j * width;
  }

  /// Whether there is a row, which is known of whole blocks.
  WARP_INLINE bool has(i32 i) const { return n % width == 0 || i < n; }

  /// A column of a matrix; what is beyond its rows is zero.
  WARP_INLINE void take(float (&a)[width], const Matrix &from, i32 row,
                        i32 column) const {
#pragma unroll
    for (int i = 0; i < width; ++i)
      a[i] = has(row + i) && has(column) ? *from.at(row + i, column) : 0.0f;
  }

  /// a -= x^T y, where row q of x begins at `row`, and y is the lane's.
  WARP_INLINE static void subtract(float (&a)[width], Shared<float> *row,
                                   float y) {
#pragma unroll
    for (int i = 0; i < width; i += 4) {
      Four x = *(Shared<Four> *)(row + i);
#pragma unroll
      for (int q = 0; q < 4; ++q)
        a[i + q] = __builtin_fmaf(-x[q], y, a[i + q]);
    }
  }
  WARP_INLINE static void subtract(float (&a)[width], const Matrix &x, i32 row,
                                   i32 column, float y) {
#pragma unroll
    for (int i = 0; i < width; i += 4) {
      Four four = x.four(row, column + i);
#pragma unroll
      for (int q = 0; q < 4; ++q)
        a[i + q] = __builtin_fmaf(-four[q], y, a[i + q]);
    }
  }

  /// Of the block that begins at a row, whose columns lanes have. What is
  /// beyond the matrix is a unit matrix with a cotangent of zero.
  WARP_INLINE void reverseBlock(float (&a)[width], i32 first, i32 lane) const {
    float l[width];
    take(l, factor, first, first + (lane < width ? lane : 0));
    bool exists = lane < width && has(first + lane);
    float over =
        exists ? inverse(*factor.at(first + lane, first + lane)) : 1.0f;
#pragma unroll
    for (int j = width - 1; j >= 0; --j) {
      // The column without its quotient, for those before it.
      if (lane == j)
#pragma unroll
        for (int i = j / 4 * 4; i < width; i += 4)
          *(Shared<Four> *)(rowOf(j) + i) =
              Four{a[i], a[i + 1], a[i + 2], a[i + 3]};
      meetLanes();
      float below[width], sums[4] = {0, 0, 0, 0};
#pragma unroll
      for (int i = j / 4 * 4; i < width; i += 4) {
        Four column = *(Shared<Four> *)(rowOf(j) + i);
#pragma unroll
        for (int q = 0; q < 4; ++q) {
          below[i + q] = column[q];
          if (i + q > j)
            sums[q] = __builtin_fmaf(column[q], l[i + q], sums[q]);
        }
      }
      float sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
      float overDiagonal = fromLane(over, j);
      float diagonal = fromLane(__builtin_fmaf(-sum, over, a[j]) * over, j);
      bool isBefore = lane < j;
      float own = isBefore ? l[j] : 0.0f, ratio = own * overDiagonal;
      float change = __builtin_fmaf(sum, overDiagonal, diagonal * own);
      if (isBefore)
        a[j] -= change;
#pragma unroll
      for (int i = j + 1; i < width; ++i)
        a[i] = __builtin_fmaf(-below[i], ratio, a[i]);
      if (lane == j)
        a[j] = 0.5f * diagonal;
    }
#pragma unroll
    for (int i = 0; i < width; ++i)
      a[i] = i > lane ? a[i] * over : i == lane ? a[i] : 0.0f;
    if (!exists)
      return;
#pragma unroll
    for (int i = 0; i < width; ++i)
      if (has(first + i))
        *bar.at(first + i, first + lane) = a[i];
  }

  /// C' D^-1 of a thread's row.
  WARP_INLINE void divide(i32 first, i32 row) const {
    float a[width];
#pragma unroll
    for (int j = 0; j < width; j += 4) {
      Four values = bar.four(row, first + j);
#pragma unroll
      for (int q = 0; q < 4; ++q)
        a[j + q] = values[q];
    }
#pragma unroll
    for (int j = width - 1; j >= 0; --j) {
#pragma unroll
      for (int k = j / 4 * 4; k >= 0; k -= 4) {
        Four others = factor.four(first + j, first + k);
        if (k + 4 > j)
          a[j] *= inverse(others[j - k]);
#pragma unroll
        for (int q = 0; q < 4; ++q)
          if (k + q < j)
            a[k + q] = __builtin_fmaf(-a[j], others[q], a[k + q]);
      }
    }
#pragma unroll
    for (int j = 0; j < width; j += 4)
      bar.setFour(row, first + j, Four{a[j], a[j + 1], a[j + 2], a[j + 3]});
  }

  /// What a thread's column of a block's rows, to the left of it, gets from it.
  WARP_INLINE void subtractBeside(i32 first, i32 column) const {
    float a[width];
    take(a, bar, first, column);
    i32 count = n - first < width ? n - first : width;
#pragma clang loop unroll(disable)
    for (i32 q = 0; q < count; ++q)
      subtract(a, rowOf(q), *factor.at(first + q, column));
#pragma clang loop unroll(disable)
    for (i32 q = first + width; q < n; ++q)
      subtract(a, bar, q, first, *factor.at(q, column));
#pragma unroll
    for (int i = 0; i < width; ++i)
      if (has(first + i))
        *bar.at(first + i, column) = a[i];
  }

  /// And of rows below it.
  WARP_INLINE void subtractBelow(i32 first, i32 row, i32 column) const {
    float a[width];
    take(a, bar, row, column);
#pragma clang loop unroll(disable)
    for (i32 k = 0; k < width; k += 4) {
      float y[4];
#pragma unroll
      for (int q = 0; q < 4; ++q)
        y[q] = *factor.at(first + k + q, column);
#pragma unroll
      for (int i = 0; i < width; ++i) {
        Four x = bar.four(has(row + i) ? row + i : first, first + k);
#pragma unroll
        for (int q = 0; q < 4; ++q)
          a[i] = __builtin_fmaf(-x[q], y[q], a[i]);
      }
    }
#pragma unroll
    for (int i = 0; i < width; ++i)
      if (has(row + i))
        *bar.at(row + i, column) = a[i];
  }

  WARP_INLINE void run() const {
    i32 thread = threadNumber();
    auto [warp, lane, warps] = Position::of(thread, threads);
    i32 own = lane < width ? lane : 0;
    i32 blocks = (n + width - 1) / width;
    if (n <= width) {
      if (warp == 0) {
        float a[width];
        take(a, bar, 0, own);
        reverseBlock(a, 0, lane);
      }
      return;
    }
    // As many threads as a block has columns.
    i32 group = u32(thread) / width, groups = threads / width;
    i32 place = u32(thread) % width;
#pragma clang loop unroll(disable)
    for (i32 block = blocks - 1; block >= 0; --block) {
      i32 first = block * width;
#pragma clang loop unroll(disable)
      for (i32 row = first + width + thread; row < n; row += threads)
        divide(first, row);
      meet(threads);
      if (warp == 0) {
        float a[width];
        take(a, bar, first, first + own);
#pragma clang loop unroll(disable)
        for (i32 q = first + width; q < n; ++q)
          subtract(a, bar, q, first, *factor.at(q, first + own));
        reverseBlock(a, first, lane);
        meetLanes();
        // Twice the diagonal, which is half.
        if (lane < width)
#pragma unroll
          for (int i = 0; i < width; ++i)
            rowOf(i)[lane] = i == lane ? 2 * a[i] : a[i];
        meetLanes();
        if (lane < width)
#pragma unroll
          for (int i = 0; i < width; ++i)
            if (i > lane)
              rowOf(lane)[i] = a[i];
      }
      meet(threads);
#pragma clang loop unroll(disable)
      for (i32 task = group; task < block * (blocks - block); task += groups) {
        i32 column = u32(task) % u32(block) * width + place;
        i32 row = first + u32(task) / u32(block) * width;
        if (row == first)
          subtractBeside(first, column);
        else
          subtractBelow(first, row, column);
      }
      // Rows above have zeros there.
#pragma clang loop unroll(disable)
      for (i32 e = thread; e < first * width; e += threads)
        if (has(first + i32(u32(e) % width)))
          *bar.at(u32(e) / width, first + i32(u32(e) % width)) = 0;
      meet(threads);
    }
  }
};

} // namespace

#define WARP_FACTOR_ADJOINT(width)                                             \
  WARP_TILES warp_tile_differentiate_factor_##width(                           \
      u64 to, i32 toRow, i32 toColumn, u64 from, i32 fromRow, i32 fromColumn,  \
      u64 scratch, i32 n, i32 threads, void *) {                               \
    FactorAdjoint<width>{{to, toRow, toColumn},                                \
                         {from, fromRow, fromColumn},                          \
                         n,                                                    \
                         scratch,                                              \
                         threads}                                              \
        .run();                                                                \
  }
WARP_FACTOR_ADJOINT(8)
WARP_FACTOR_ADJOINT(16)
