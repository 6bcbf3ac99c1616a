//===- TileFactorAdjoints.cpp - Cotangents of Cholesky factors ------------===//
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

#include "TileBlockAdjoints.h"

namespace {

template <int width> struct FactorAdjoint : BlockAdjoint<width> {
  i32 threads;

  using Block = BlockAdjoint<width>;
  using Block::bar, Block::factor, Block::n, Block::has, Block::rowOf;

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
    this->substitute(a, first);
#pragma unroll
    for (int j = 0; j < width; j += 4)
      bar.setFour(row, first + j, Four{a[j], a[j + 1], a[j + 2], a[j + 3]});
  }

  /// The change of a thread's column of a block's rows, to the left of it.
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
        this->reverseBlock(a, 0, lane);
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
      syncBlock(threads);
      if (warp == 0) {
        float a[width];
        take(a, bar, first, first + own);
        subtractRows(a, first, first + own);
        this->reverseBlock(a, first, lane);
      }
      syncBlock(threads);
#pragma clang loop unroll(disable)
      for (i32 task = group; task < block * (blocks - block); task += groups) {
        i32 column = u32(task) % u32(block) * width + place;
        i32 row = first + u32(task) / u32(block) * width;
        if (row == first)
          subtractBeside(first, column);
        else
          subtractBelow(first, row, column);
      }
      this->clearAbove(bar, first, thread, threads);
      syncBlock(threads);
    }
  }
};

} // namespace

#define WARP_FACTOR_ADJOINT(width)                                             \
  WARP_TILES warp_tile_differentiate_factor_##width(                           \
      u64 to, i32 toRow, i32 toColumn, u64 from, i32 fromRow, i32 fromColumn,  \
      u64 scratch, i32 n, i32 threads, void *) {                               \
    FactorAdjoint<width>{                                                      \
        {{n}, {to, toRow, toColumn}, {from, fromRow, fromColumn}, scratch},    \
        threads}                                                               \
        .run();                                                                \
  }
WARP_FACTOR_ADJOINT(8)
WARP_FACTOR_ADJOINT(16)
