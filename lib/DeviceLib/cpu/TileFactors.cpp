//===- TileFactors.cpp - Cholesky factors and triangular solves of tiles --===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A row of what is computed stays in registers while the rows before it are
// subtracted (left-looking), so that most of the work is one load and one fma
// per vector.
//
//===----------------------------------------------------------------------===//

#include "Tiles.h"

namespace {

/// Vectors of a row that are computed at a time.
constexpr int width = 4;

/// A row of the factor U of A = U^T U, rows before it known, beyond column
/// `begin`: A[i, c] - sum over k < i of U[k, i] U[k, c].
template <class T>
inline void subtractRows(T *u, i64 n, i64 i, i64 begin) {
  for (i64 c = begin; c < n; c += width * lanes<T>) {
    Vec<T> sums[width];
#pragma unroll
    for (int v = 0; v < width; ++v)
      sums[v] = load(u + i * n + c + v * lanes<T>, n - c - v * lanes<T>);
    for (i64 k = 0; k < i; ++k) {
      Vec<T> factor = -u[k * n + i];
#pragma unroll
      for (int v = 0; v < width; ++v)
        if (c + v * lanes<T> < n)
          sums[v] = fma(factor,
                        load(u + k * n + c + v * lanes<T>,
                             n - c - v * lanes<T>),
                        sums[v]);
    }
#pragma unroll
    for (int v = 0; v < width; ++v)
      store(u + i * n + c + v * lanes<T>, sums[v], n - c - v * lanes<T>);
  }
}

template <class T> void factor(T *u, i64 n) {
  for (i64 i = 0; i < n; ++i) {
    subtractRows(u, n, i, i);
    T square = u[i * n + i];
    // The root of what is not positive is NaN, and so is what follows.
    T diagonal = square > 0 ? __builtin_elementwise_sqrt(square)
                            : T(__builtin_nan(""));
    u[i * n + i] = diagonal;
    for (i64 c = i + 1; c < n; c += lanes<T>)
      store(u + i * n + c, load(u + i * n + c, n - c) / Vec<T>(diagonal),
            n - c);
  }
}

/// The triangle that is read of `from`, as the upper one of `to`.
template <class T>
void copyTriangle(T *to, const T *from, i64 n, bool isUpper) {
  for (i64 i = 0; i < n; ++i)
    for (i64 j = i; j < n; ++j)
      to[i * n + j] = isUpper ? from[i * n + j] : from[j * n + i];
}

template <class T>
void cholesky(T *out, const T *in, i64 n, bool isUpper, T *scratch) {
  T *u = isUpper ? out : scratch;
  copyTriangle(u, in, n, isUpper);
  factor(u, n);
  for (i64 i = 0; i < n; ++i)
    for (i64 j = 0; j < n; ++j) {
      bool isZero = isUpper ? j < i : j > i;
      if (isZero)
        out[i * n + j] = 0;
      else if (!isUpper)
        out[i * n + j] = u[j * n + i];
    }
}

/// Solves m x = b in place: element (i, j) of m is at i * row + j * column.
template <class T> struct Solve {
  T *x;
  const T *m;
  i64 n, columns, row, column;
  bool backwards;

  i64 at(i64 step) const { return backwards ? n - 1 - step : step; }
  void manySides() const;
  void oneSideByRows() const;
  void oneSideByColumns() const;
};

/// Right sides are lanes.
template <class T> void Solve<T>::manySides() const {
  for (i64 c = 0; c < columns; c += width * lanes<T>)
    for (i64 step = 0; step < n; ++step) {
      i64 i = at(step);
      Vec<T> sums[width];
#pragma unroll
      for (int v = 0; v < width; ++v)
        sums[v] = load(x + i * columns + c + v * lanes<T>,
                       columns - c - v * lanes<T>);
      for (i64 before = 0; before < step; ++before) {
        i64 j = at(before);
        Vec<T> factor = -m[i * row + j * column];
#pragma unroll
        for (int v = 0; v < width; ++v)
          if (c + v * lanes<T> < columns)
            sums[v] = fma(factor,
                          load(x + j * columns + c + v * lanes<T>,
                               columns - c - v * lanes<T>),
                          sums[v]);
      }
      Vec<T> diagonal = m[i * row + i * column];
#pragma unroll
      for (int v = 0; v < width; ++v)
        store(x + i * columns + c + v * lanes<T>, sums[v] / diagonal,
              columns - c - v * lanes<T>);
    }
}

/// A row of the matrix is contiguous: its product with what is solved.
template <class T> void Solve<T>::oneSideByRows() const {
  for (i64 step = 0; step < n; ++step) {
    i64 i = at(step), begin = backwards ? i + 1 : 0;
    i64 end = backwards ? n : i;
    Vec<T> sums = 0;
    for (i64 j = begin; j < end; j += lanes<T>)
      sums = fma(load(m + i * row + j, end - j), load(x + j, end - j), sums);
    T sum = 0;
#pragma unroll
    for (int lane = 0; lane < lanes<T>; ++lane)
      sum += sums[lane];
    x[i] = (x[i] - sum) / m[i * row + i];
  }
}

/// A column is: it is subtracted from what is left.
template <class T> void Solve<T>::oneSideByColumns() const {
  for (i64 step = 0; step < n; ++step) {
    i64 j = at(step), begin = backwards ? 0 : j + 1;
    i64 end = backwards ? j : n;
    T solved = x[j] / m[j * row + j * column];
    x[j] = solved;
    for (i64 i = begin; i < end; i += lanes<T>)
      store(x + i,
            fma(Vec<T>(-solved), load(m + i * row + j * column, end - i),
                load(x + i, end - i)),
            end - i);
  }
}

template <class T> void solve(const Solve<T> &system) {
  if (system.columns > 1)
    system.manySides();
  else if (system.column == 1)
    system.oneSideByRows();
  else
    system.oneSideByColumns();
}

} // namespace

#define WARP_FACTORS(suffix, T)                                                \
  WARP_TILES void warp_tile_cholesky_##suffix(u64 out, u64 in, u64 scratch,    \
                                              i32 n, i32 isUpper, void *) {    \
    cholesky(at<T>(out), at<const T>(in), n, isUpper != 0, at<T>(scratch));    \
  }                                                                            \
  WARP_TILES void warp_tile_solve_##suffix(u64 x, u64 m, i32 n, i32 columns,   \
                                           i32 row, i32 column, i32 backwards, \
                                           void *) {                           \
    solve(Solve<T>{at<T>(x), at<const T>(m), n, columns, row, column,          \
                   backwards != 0});                                           \
  }

WARP_FACTORS(f32, float)
WARP_FACTORS(f64, double)
