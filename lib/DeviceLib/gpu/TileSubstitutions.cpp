//===- TileSubstitutions.cpp - Triangular systems -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Columns of the right side are shared by the warps of a block; lanes have
// every 32nd row of one. A row of a block is divided by its diagonal before the
// block is solved, so that a step waits for nothing but the number before.
// With more right sides than warps TileColumnSolves.cpp is faster.
//
//===----------------------------------------------------------------------===//

#include "TileMatrices.h"

namespace {

template <class T, int rows, bool backwards> struct Substitution {
  MatrixOf<T> matrix;
  i32 n, lane;
  T over[rows];
  /// Rows, or the first one where there is none.
  i32 own[rows];

  WARP_INLINE void start() {
#pragma unroll
    for (int r = 0; r < rows; ++r) {
      i32 i = r * warpSize + lane;
      own[r] = i < n ? i : 0;
      over[r] = inverse(*matrix.at(own[r], own[r]));
    }
  }

  /// True if a block's numbers count for rows r, one block or more away.
  WARP_INLINE static constexpr bool counts(int r, int block) {
    return backwards ? r < block : r > block;
  }

  /// Number j of a block, for the others.
  WARP_INLINE void step(T (&x)[rows], const T (&m)[rows], int block,
                        i32 j) const {
    T known = shuffle(x[block], j);
    T next = fma(m[block] * over[block], T(-known), x[block]);
    x[block] = (backwards ? lane < j : lane > j) ? next : x[block];
#pragma unroll
    for (int r = 0; r < rows; ++r)
      if (counts(r, block))
        x[r] = fma(m[r], T(-known), x[r]);
  }
  WARP_INLINE void stepOne(T (&x)[rows], int block, i32 j) const {
    T m[rows];
#pragma unroll
    for (int r = 0; r < rows; ++r)
      if (r == block || counts(r, block))
        m[r] = *matrix.at(own[r], block * warpSize + j);
    step(x, m, block, j);
  }
  WARP_INLINE void stepFour(T (&x)[rows], int block, i32 j) const {
    FourOf<T> fours[rows];
#pragma unroll
    for (int r = 0; r < rows; ++r)
      if (r == block || counts(r, block))
        fours[r] = matrix.four(own[r], block * warpSize + j);
#pragma unroll
    for (int step = 0; step < 4; ++step) {
      int q = backwards ? 3 - step : step;
      T m[rows];
#pragma unroll
      for (int r = 0; r < rows; ++r)
        if (r == block || counts(r, block))
          m[r] = fours[r][q];
      this->step(x, m, block, j + q);
    }
  }

  WARP_INLINE void solveBlock(T (&x)[rows], int block) const {
    i32 count =
            n - block * warpSize < warpSize ? n - block * warpSize : warpSize,
        fours = count / 4;
    x[block] *= over[block];
    if (backwards)
#pragma clang loop unroll(disable)
      for (i32 j = count - 1; j >= fours * 4; --j)
        stepOne(x, block, j);
#pragma clang loop unroll(disable)
    for (i32 four = 0; four < fours; ++four)
      stepFour(x, block, 4 * (backwards ? fours - 1 - four : four));
    if (!backwards)
#pragma clang loop unroll(disable)
      for (i32 j = fours * 4; j < count; ++j)
        stepOne(x, block, j);
  }

  WARP_INLINE void solve(Shared<T> *side, i32 columns) const {
    T x[rows];
    // For a lane without a row another one writes the first.
#pragma unroll
    for (int r = 0; r < rows; ++r)
      x[r] = r * warpSize + lane < n ? T(side[own[r] * columns]) : T(0);
#pragma unroll
    for (int step = 0; step < rows; ++step)
      solveBlock(x, backwards ? rows - 1 - step : step);
#pragma unroll
    for (int r = 0; r < rows; ++r)
      if (r * warpSize + lane < n)
        side[own[r] * columns] = x[r];
  }

  WARP_INLINE static void run(u64 sides, const MatrixOf<T> &matrix, i32 n,
                              i32 columns, i32 threads) {
    auto [warp, lane, warps] = Position::of(threadNumber(), threads);
    Substitution own{matrix, n, lane, {}, {}};
    own.start();
#pragma clang loop unroll(disable)
    for (i32 c = warp; c < columns; c += warps)
      own.solve(shared<T>(sides) + c, columns);
  }
};

} // namespace

#define WARP_SUBSTITUTE(suffix, T, rows)                                       \
  WARP_TILES warp_tile_substitute_##suffix##_##rows(                           \
      u64 sides, u64 matrix, i32 row, i32 column, i32 n, i32 columns,          \
      i32 backwards, i32 threads, void *) {                                    \
    if (backwards)                                                             \
      Substitution<T, rows, true>::run(sides, {matrix, row, column}, n,        \
                                       columns, threads);                      \
    else                                                                       \
      Substitution<T, rows, false>::run(sides, {matrix, row, column}, n,       \
                                        columns, threads);                     \
  }
WARP_SUBSTITUTE(f32, float, 1)
WARP_SUBSTITUTE(f32, float, 2)
WARP_SUBSTITUTE(f32, float, 4)
WARP_SUBSTITUTE(f64, double, 1)
WARP_SUBSTITUTE(f64, double, 2)
WARP_SUBSTITUTE(f64, double, 4)
