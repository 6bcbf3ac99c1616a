//===- Factors.h - Cholesky factors and triangular solves -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One body for blocks of any number of threads, element types and memory. A
// `Team` has the number of this thread, the number of threads, and a `barrier`.
// Faster bodies for single cases: cpu/TileFactors.cpp (one thread, vectors) and
// gpu/TileFactors.cpp (f32 of up to 128 rows, in registers of warps).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_TILES_FACTORS_H
#define WARP_DEVICELIB_TILES_FACTORS_H

namespace tiles {

/// Element (i, j) is at i * row + j * column. The transpose of an upper
/// triangle is a lower one, so that one code does for both.
template <class Pointer> struct Matrix {
  Pointer first;
  int row, column;

  __attribute__((always_inline)) auto &operator()(int i, int j) const {
    return first[i * row + j * column];
  }
};

template <class T>
__attribute__((always_inline)) inline T fma(T x, T y, T sum) {
  return __builtin_elementwise_fma(x, y, sum);
}

/// The lower triangle L of L L^T, zeros above; may be in place. Left-looking:
/// column j from those before it. Every thread computes the diagonal; the rest
/// of a column is shared.
template <class T, class Team, class Out, class In>
__attribute__((always_inline)) inline void
factor(const Team &team, const Out &out, const In &in, int n) {
  auto rest = [&](int i, int j) {
    T sum = in(i, j);
    for (int k = 0; k < j; ++k)
      sum = fma(T(-out(i, k)), T(out(j, k)), sum);
    return sum;
  };
  for (int j = 0; j < n; ++j) {
    T square = rest(j, j);
    // The root of what is not positive is NaN, and so is what follows.
    T diagonal =
        __builtin_elementwise_sqrt(square > 0 ? square : T(__builtin_nan("")));
    // In place, all have to have read it.
    team.barrier();
    if (team.thread == 0)
      out(j, j) = diagonal;
    for (int i = j + 1 + team.thread; i < n; i += team.threads) {
      out(i, j) = rest(i, j) / diagonal;
      out(j, i) = 0;
    }
    team.barrier();
  }
}

/// Turns the cotangent of a factor into that of the matrix, in place: columns
/// from the last to the first; what a column of the factor was computed from
/// gets its part. Iain Murray, Differentiation of the Cholesky decomposition,
/// 2016.
template <class T, class Team, class Out, class In>
__attribute__((always_inline)) inline void
factorAdjoint(const Team &team, const Out &bar, const In &factor, int n) {
  for (int j = n - 1; j >= 0; --j) {
    T over = 1 / factor(j, j);
    // The inner product of column k of the factor and column j of the bar.
    auto common = [&](int k) {
      T sum = 0;
      for (int i = j + 1; i < n; ++i)
        sum = fma(T(bar(i, j)), T(factor(i, k)), sum);
      return sum;
    };
    T diagonal = (bar(j, j) - common(j) * over) * over;
    for (int k = team.thread; k < j; k += team.threads) {
      T own = factor(j, k), ratio = own * over;
      bar(j, k) -= fma(common(k), over, diagonal * own);
      for (int i = j + 1; i < n; ++i)
        bar(i, k) = fma(T(-bar(i, j)), ratio, T(bar(i, k)));
      bar(k, j) = 0;
    }
    // All have read the column.
    team.barrier();
    if (team.thread == 0)
      bar(j, j) = diagonal / 2;
    for (int i = j + 1 + team.thread; i < n; i += team.threads)
      bar(i, j) *= over;
  }
}

/// Solves m x = b in place of b, of `columns` right sides; backwards if m is
/// upper. A row of the solution at a time, which is then subtracted from the
/// others.
template <class T, class Team, class Out, class In>
__attribute__((always_inline)) inline void solve(const Team &team, const Out &x,
                                                 const In &m, int n,
                                                 int columns, bool backwards) {
  auto rowOf = [&](int step) { return backwards ? n - 1 - step : step; };
  for (int step = 0; step < n; ++step) {
    int j = rowOf(step);
    T diagonal = m(j, j);
    for (int c = team.thread; c < columns; c += team.threads)
      x(j, c) /= diagonal;
    team.barrier();
    // Rows that are left, each with all columns.
    for (int e = (step + 1) * columns + team.thread; e < n * columns;
         e += team.threads) {
      int i = rowOf(int(unsigned(e) / columns)), c = int(unsigned(e) % columns);
      x(i, c) = fma(T(-m(i, j)), T(x(j, c)), T(x(i, c)));
    }
    team.barrier();
  }
}

} // namespace tiles

#endif // WARP_DEVICELIB_TILES_FACTORS_H
