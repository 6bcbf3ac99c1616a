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

/// Vectors next to each other, the last one perhaps not whole.
template <class T, int width, bool isPart> struct Strip {
  Vec<T> parts[width];
  Mask<T> last;

  Strip() = default;
  explicit Strip(i64 count)
      : last(firstLanes<T>(count - (width - 1) * lanes<T>)) {}

  static constexpr bool isMasked(int v) { return isPart && v + 1 == width; }
  __attribute__((always_inline)) Vec<T> read(const T *from, int v) const {
    const T *part = from + v * lanes<T>;
    return isMasked(v) ? __builtin_masked_load(last, part, Vec<T>(0))
                       : load(part);
  }
  __attribute__((always_inline)) void readAll(const T *from) {
#pragma unroll
    for (int v = 0; v < width; ++v)
      parts[v] = read(from, v);
  }
  __attribute__((always_inline)) void subtract(T factor, const T *row) {
#pragma unroll
    for (int v = 0; v < width; ++v)
      parts[v] = fma(Vec<T>(-factor), read(row, v), parts[v]);
  }
  __attribute__((always_inline)) void divide(T divisor) {
#pragma unroll
    for (int v = 0; v < width; ++v)
      parts[v] /= divisor;
  }
  __attribute__((always_inline)) void write(T *to) const {
#pragma unroll
    for (int v = 0; v < width; ++v)
      if (isMasked(v))
        __builtin_masked_store(last, parts[v], to + v * lanes<T>);
      else
        store(to + v * lanes<T>, parts[v]);
  }
};

/// Calls `work` for strips of a row that cover the columns from `begin` on.
template <class T, class Work>
inline void overStrips(i64 begin, i64 end, const Work &work) {
  i64 c = begin;
  for (; c + 2 * lanes<T> <= end; c += 2 * lanes<T>)
    work(c, Strip<T, 2, false>(2 * lanes<T>));
  for (; c + lanes<T> <= end; c += lanes<T>)
    work(c, Strip<T, 1, false>(lanes<T>));
  if (c < end)
    work(c, Strip<T, 1, true>(end - c));
}

/// From rows i, i + 1, ... of A, from column `begin` on, the sum over some k of
/// U[k, i] U[k, c].
template <class T, int height>
inline void subtract(T *u, i64 n, i64 i, i64 begin, i64 first, i64 last) {
  overStrips<T>(begin, n, [=](i64 c, auto strip) {
    decltype(strip) rows[height];
#pragma unroll
    for (int r = 0; r < height; ++r) {
      rows[r] = strip;
      rows[r].readAll(u + (i + r) * n + c);
    }
    for (i64 k = first; k < last; ++k)
#pragma unroll
      for (int r = 0; r < height; ++r)
        rows[r].subtract(u[k * n + i + r], u + k * n + c);
#pragma unroll
    for (int r = 0; r < height; ++r)
      rows[r].write(u + (i + r) * n + c);
  });
}

/// The factor U of A = U^T U, in place, four rows at a time. Strips begin where
/// those of other rows do, so that what was stored is found as it is loaded;
/// what they have before the diagonal means nothing.
template <class T> void factor(T *u, i64 n) {
  constexpr i64 height = 4;
  for (i64 i = 0; i < n; ++i) {
    i64 begin = i / lanes<T> * lanes<T>, together = i / height * height;
    bool isWhole = together + height <= n;
    if (isWhole && i == together)
      subtract<T, height>(u, n, i, begin, 0, i);
    subtract<T, 1>(u, n, i, begin, isWhole ? together : 0, i);
    T square = u[i * n + i];
    // The root of what is not positive is NaN, and so is what follows.
    T diagonal = square > 0 ? __builtin_elementwise_sqrt(square)
                            : T(__builtin_nan(""));
    overStrips<T>(begin, n, [=](i64 c, auto strip) {
      strip.readAll(u + i * n + c);
      strip.divide(diagonal);
      strip.write(u + i * n + c);
    });
    u[i * n + i] = diagonal;
  }
}

/// The triangle that is read of `from`, as the upper one of `to`; zero below.
template <class T>
void copyTriangle(T *to, const T *from, i64 n, bool isUpper) {
  i64 row = isUpper ? n : 1, column = isUpper ? 1 : n;
  for (i64 i = 0; i < n; ++i) {
    for (i64 j = 0; j < i; ++j)
      to[i * n + j] = 0;
    for (i64 j = i; j < n; ++j)
      to[i * n + j] = from[i * row + j * column];
  }
}

template <class T>
void cholesky(T *out, const T *in, i64 n, bool isUpper, T *scratch) {
  T *u = isUpper ? out : scratch;
  copyTriangle(u, in, n, isUpper);
  factor(u, n);
  if (isUpper) {
    for (i64 i = 1; i < n; ++i)
      for (i64 j = 0; j < i; ++j)
        out[i * n + j] = 0;
    return;
  }
  for (i64 i = 0; i < n; ++i) {
    for (i64 j = 0; j <= i; ++j)
      out[i * n + j] = u[j * n + i];
    for (i64 j = i + 1; j < n; ++j)
      out[i * n + j] = 0;
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
  overStrips<T>(0, columns, [this](i64 c, auto strip) {
    for (i64 step = 0; step < n; ++step) {
      i64 i = at(step);
      strip.readAll(x + i * columns + c);
      for (i64 before = 0; before < step; ++before) {
        i64 j = at(before);
        strip.subtract(m[i * row + j * column], x + j * columns + c);
      }
      strip.divide(m[i * row + i * column]);
      strip.write(x + i * columns + c);
    }
  });
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
