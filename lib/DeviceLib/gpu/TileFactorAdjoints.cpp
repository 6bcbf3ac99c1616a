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
// Of a block it is the lower triangle, the diagonal halved, of G = L^-T P L^-1,
// where P is symmetric and has the lower triangle of L^T D': G = D' + D'^T.
//
// Threads have a column each, in registers, as many as a block is wide, and
// multiply it with rows that they all read, four numbers at once; in the
// quotient they have a row.
//
//===----------------------------------------------------------------------===//

#include "TileMatrices.h"

namespace {

/// What follows is loaded when these are computed, not before: registers are
/// few.
WARP_INLINE void settle(float *x) {
  asm volatile(""
               : "+f"(x[0]), "+f"(x[1]), "+f"(x[2]), "+f"(x[3]), "+f"(x[4]),
                 "+f"(x[5]), "+f"(x[6]), "+f"(x[7]));
}
template <int width> WARP_INLINE void settleAll(float (&x)[width]) {
#pragma unroll
  for (int i = 0; i < width; i += 8)
    settle(x + i);
}

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

  /// The same of all rows below a block, four at a time: their loads wait
  /// together.
  WARP_INLINE void subtractRows(float (&a)[width], i32 first,
                                i32 column) const {
    i32 rows = n - first - width;
#pragma clang loop unroll(disable)
    for (i32 four = 0; four < rows / 4; ++four) {
      i32 row = first + width + 4 * four;
      float y[4];
#pragma unroll
      for (int q = 0; q < 4; ++q)
        y[q] = *factor.at(row + q, column);
#pragma unroll
      for (int q = 0; q < 4; ++q)
        subtract(a, bar, row + q, first, y[q]);
    }
    if (n % 4 == 0)
      return;
#pragma clang loop unroll(disable)
    for (i32 row = n - rows % 4; row < n; ++row)
      subtract(a, bar, row, first, *factor.at(row, column));
  }

  /// Four elements up to the diagonal of row i of the factor of a block. What
  /// is beyond the matrix is a unit matrix.
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
        settleAll(x);
    }
  }

  /// A column, when all lanes have written.
  WARP_INLINE void exchange(float (&x)[width], i32 own) const {
    meetLanes();
#pragma unroll
    for (int i = 0; i < width; ++i)
      x[i] = rowOf(i)[own];
    meetLanes();
  }

  /// Of the block that begins at a row, whose columns lanes have: what they
  /// have of the cotangent gives G, which is left in the block's memory, too.
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
        settleAll(x);
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
    substitute(a, first);
#pragma unroll
    for (int j = 0; j < width; j += 4)
      bar.setFour(row, first + j, Four{a[j], a[j + 1], a[j + 2], a[j + 3]});
  }

  /// What a thread's column of a block's rows, to the left of it, gets from it.
  WARP_INLINE void subtractBeside(i32 first, i32 column) const {
    float a[width];
    take(a, bar, first, column);
#pragma clang loop unroll(disable)
    for (i32 four = 0; four < width; four += 4) {
      float y[4];
#pragma unroll
      for (int q = 0; q < 4; ++q)
        y[q] =
            has(first + four + q) ? *factor.at(first + four + q, column) : 0.0f;
#pragma unroll
      for (int q = 0; q < 4; ++q)
        subtract(a, rowOf(four + q), y[q]);
    }
    subtractRows(a, first, column);
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
        subtractRows(a, first, first + own);
        reverseBlock(a, first, lane);
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
