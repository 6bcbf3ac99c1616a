//===- TileColumnSolves.cpp - Triangular systems, a right side per thread -===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Substitution with right sides in registers: a thread has whole columns, and
// all threads read the same elements of the matrix, which shared memory gives
// to all at once. No thread needs what another one computes, so there is no
// barrier and no shuffle in the chain of steps. Rows come in blocks of `width`;
// blocks before are subtracted from memory, where the thread itself has put
// them. TileSubstitutions.cpp has one or two right sides per warp instead.
//
//===----------------------------------------------------------------------===//

#include "TileMatrices.h"

namespace {

/// How four elements of the matrix lie that are read at once.
enum class Fours { along, across, none };

/// The system as a lower triangle: backwards, rows and columns are numbered
/// from the last one.
template <class T, int width, bool backwards, Fours fours>
struct ColumnSubstitution {
  using Four = FourOf<T>;
  MatrixOf<T> matrix;
  Shared<T> *sides;
  i32 n, columns;

  WARP_INLINE i32 place(i32 i) const { return backwards ? n - 1 - i : i; }
  WARP_INLINE bool has(i32 i) const { return n % width == 0 || i < n; }
  WARP_INLINE Shared<T> *side(i32 i, i32 c) const {
    return sides + (place(i) * columns + c);
  }

  /// Elements (i, j) to (i, j + 3), or to (i + 3, j).
  WARP_INLINE Four four(i32 i, i32 j) const {
    constexpr bool across = fours == Fours::across;
    if constexpr (fours == Fours::none) {
      return {*matrix.at(place(i), place(j)), *matrix.at(place(i), place(j + 1)),
              *matrix.at(place(i), place(j + 2)),
              *matrix.at(place(i), place(j + 3))};
    } else {
      i32 row = place(i) - (backwards && across ? 3 : 0);
      i32 column = place(j) - (backwards && !across ? 3 : 0);
      Four values = *(Shared<Four> *)matrix.at(row, column);
      return backwards ? Four{values[3], values[2], values[1], values[0]}
                       : values;
    }
  }

  /// Subtracts known[q] times column j + q of the matrix from a block of rows.
  WARP_INLINE void subtract(T (&x)[width], const T (&known)[4], i32 first,
                            i32 j) const {
    if constexpr (fours == Fours::across) {
#pragma unroll
      for (int q = 0; q < 4; ++q)
#pragma unroll
        for (int r = 0; r < width; r += 4) {
          if (!has(first + r))
            continue;
          Four m = four(first + r, j + q);
#pragma unroll
          for (int p = 0; p < 4; ++p)
            x[r + p] = fma(T(-m[p]), known[q], x[r + p]);
        }
    } else {
#pragma unroll
      for (int r = 0; r < width; ++r) {
        if (!has(first + r))
          continue;
        Four m = four(first + r, j);
#pragma unroll
        for (int q = 0; q < 4; ++q)
          x[r] = fma(T(-m[q]), known[q], x[r]);
      }
    }
  }

  /// Solves the diagonal block; `over`: a lane's inverse of the diagonal.
  WARP_INLINE void solveBlock(T (&x)[width], T over, i32 first) const {
    if constexpr (fours == Fours::across) {
#pragma unroll
      for (int j = 0; j < width; ++j) {
        x[j] *= shuffle(over, j);
#pragma unroll
        for (int r = j / 4 * 4; r < width; r += 4) {
          if (r + 3 <= j || !has(first + r))
            continue;
          Four m = four(first + r, first + j);
#pragma unroll
          for (int p = 0; p < 4; ++p)
            if (r + p > j)
              x[r + p] = fma(T(-m[p]), x[j], x[r + p]);
        }
      }
    } else {
#pragma unroll
      for (int r = 0; r < width; ++r) {
#pragma unroll
        for (int j = 0; j < r; j += 4) {
          if (!has(first + r))
            continue;
          if constexpr (fours == Fours::none) {
#pragma unroll
            for (int q = 0; q < 4; ++q)
              if (j + q < r)
                x[r] = fma(
                    T(-*matrix.at(place(first + r), place(first + j + q))),
                    x[j + q], x[r]);
            continue;
          }
          Four m = four(first + r, first + j);
#pragma unroll
          for (int q = 0; q < 4; ++q)
            if (j + q < r)
              x[r] = fma(T(-m[q]), x[j + q], x[r]);
        }
        x[r] *= shuffle(over, r);
      }
    }
  }

  /// Columns for the lanes of a warp from one on; a lane without one computes
  /// the last one, too, and does not keep it.
  WARP_INLINE void solve(i32 begin, i32 lane) const {
    i32 c = begin + lane;
    bool keeps = c < columns;
    c = keeps ? c : columns - 1;
#pragma clang loop unroll(disable)
    for (i32 first = 0; first < n; first += width) {
      i32 own = place(lane < width && has(first + lane) ? first + lane : first);
      T over = inverse(*matrix.at(own, own)), x[width];
#pragma unroll
      for (int r = 0; r < width; ++r)
        x[r] = has(first + r) ? T(*side(first + r, c)) : T(0);
#pragma clang loop unroll(disable)
      for (i32 j = 0; j < first; j += 4) {
        T known[4];
#pragma unroll
        for (int q = 0; q < 4; ++q)
          known[q] = *side(j + q, c);
        subtract(x, known, first, j);
      }
      solveBlock(x, over, first);
      if (keeps)
#pragma unroll
        for (int r = 0; r < width; ++r)
          if (has(first + r))
            *side(first + r, c) = x[r];
    }
  }

  WARP_INLINE void run(i32 threads) const {
    auto [warp, lane, warps] = Position::of(threadNumber(), threads);
#pragma clang loop unroll(disable)
    for (i32 begin = warp * warpSize; begin < columns;
         begin += warps * warpSize)
      solve(begin, lane);
  }
};

template <class T, int width, bool backwards>
WARP_INLINE void solveColumns(u64 sides, const MatrixOf<T> &matrix, i32 n,
                              i32 columns, i32 threads) {
  Shared<T> *first = shared<T>(sides);
  if (n % 4 == 0 && matrix.column == 1 && matrix.row % 4 == 0)
    ColumnSubstitution<T, width, backwards, Fours::along>{matrix, first, n,
                                                          columns}
        .run(threads);
  else if (n % 4 == 0 && matrix.row == 1 && matrix.column % 4 == 0)
    ColumnSubstitution<T, width, backwards, Fours::across>{matrix, first, n,
                                                           columns}
        .run(threads);
  else
    ColumnSubstitution<T, width, backwards, Fours::none>{matrix, first, n,
                                                         columns}
        .run(threads);
}

} // namespace

#define WARP_COLUMN_SOLVE(suffix, T, width)                                    \
  WARP_TILES warp_tile_solve_columns_##suffix##_##width(                       \
      u64 sides, u64 matrix, i32 row, i32 column, i32 n, i32 columns,          \
      i32 backwards, i32 threads, void *) {                                    \
    if (backwards)                                                             \
      solveColumns<T, width, true>(sides, {matrix, row, column}, n, columns,   \
                                   threads);                                   \
    else                                                                       \
      solveColumns<T, width, false>(sides, {matrix, row, column}, n, columns,  \
                                    threads);                                  \
  }
WARP_COLUMN_SOLVE(f32, float, 8)
WARP_COLUMN_SOLVE(f32, float, 16)
WARP_COLUMN_SOLVE(f64, double, 8)
WARP_COLUMN_SOLVE(f64, double, 16)
