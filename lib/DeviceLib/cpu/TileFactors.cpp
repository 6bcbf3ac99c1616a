//===- TileFactors.cpp - Cholesky factors and triangular solves of tiles --===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Squares of a matrix, as many rows as a vector has elements, stay in registers
// while the rows before them are subtracted (left-looking) and they are
// factored or solved with.
//
//===----------------------------------------------------------------------===//

#include "TileSquares.h"

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

template <class T> void transpose(T *to, const T *from, i64 n) {
  overBlocks<T>(n, [=](i64 i, i64 height) {
    overBlocks<T>(n, [=](i64 j, i64 width) {
      Square<T> part;
      part.read(from + i * n + j, n, height, width);
      part.transpose();
      part.write(to + j * n + i, n, width, height);
    });
  });
}

/// Zero on one side of the diagonal.
template <class T> void clearTriangle(T *u, i64 n, bool above) {
  overBlocks<T>(n, [=](i64 i, i64 height) {
    overBlocks<T>(n, [=](i64 j, i64 width) {
      Square<T> part;
      if (above ? j < i : j > i)
        return;
      part.read(u + i * n + j, n, i == j ? height : 0, width);
      part.clear(above);
      part.write(u + i * n + j, n, height, width);
    });
  });
}

/// Rows of U from those of A, less what rows before have: a column at a time is
/// multiplied by what it is divided by later, so that roots hold nothing up.
template <class T>
__attribute__((always_inline)) inline void factorSquare(Square<T> &a) {
#pragma unroll
  for (int j = 0; j < lanes<T>; ++j) {
    T square = a.rows[j][j];
    // The root of what is not positive is NaN, and so is what follows.
    square = square > 0 ? square : T(__builtin_nan(""));
    Vec<T> ratios = a.rows[j] / Vec<T>(square);
#pragma unroll
    for (int i = j + 1; i < lanes<T>; ++i)
      a.rows[i] = fma(Vec<T>(-ratios[i]), a.rows[j], a.rows[i]);
    T root = __builtin_elementwise_sqrt(square);
    a.rows[j] = a.rows[j] / Vec<T>(root);
    a.rows[j][j] = root;
  }
}

/// The factor U of A = U^T U, in place: a block of rows at a time, a square at
/// a time. What is below the diagonal means nothing.
template <class T> void factor(T *u, i64 n) {
  overBlocks<T>(n, [=](i64 i, i64 height) {
    for (i64 c = i; c < n; c += lanes<T>) {
      i64 width = n - c < lanes<T> ? n - c : i64(lanes<T>);
      Square<T> part;
      part.read(u + i * n + c, n, height, width);
      for (i64 k = 0; k < i; ++k) {
        Vec<T> row = load(u + k * n + c, width);
        const T *factors = u + k * n + i;
#pragma unroll
        for (int r = 0; r < lanes<T>; ++r)
          part.rows[r] = fma(Vec<T>(-factors[r]), row, part.rows[r]);
      }
      if (c == i) {
        // Rows that there are not are those of the identity.
#pragma unroll
        for (int r = 0; r < lanes<T>; ++r)
          if (r >= height) {
            part.rows[r] = 0;
            part.rows[r][r] = 1;
          }
        factorSquare(part);
      } else {
        // Not the last rows, so there are all.
#pragma unroll
        for (int j = 0; j < lanes<T>; ++j) {
          const T *factors = u + (i + j) * n + i;
          part.rows[j] = part.rows[j] / Vec<T>(factors[j]);
#pragma unroll
          for (int r = j + 1; r < lanes<T>; ++r)
            part.rows[r] = fma(Vec<T>(-factors[r]), part.rows[j], part.rows[r]);
        }
      }
      part.write(u + i * n + c, n, height, width);
    }
  });
}

template <class T>
void cholesky(T *out, const T *in, i64 n, bool isUpper, T *scratch) {
  if (isUpper) {
    for (i64 e = 0; out != in && e < n * n; e += lanes<T>)
      store(out + e, load(in + e, n * n - e), n * n - e);
    factor(out, n);
    return clearTriangle(out, n, /*above=*/false);
  }
  transpose(scratch, in, n);
  factor(scratch, n);
  transpose(out, scratch, n);
  clearTriangle(out, n, /*above=*/true);
}

//===----------------------------------------------------------------------===//
// Triangular solves
//===----------------------------------------------------------------------===//

/// Solves m x = b in place: element (i, j) of m is at i * row + j * column.
template <class T> struct Solve {
  T *x;
  const T *m;
  i64 n, columns, row, column;
  bool backwards;

  i64 at(i64 step) const { return backwards ? n - 1 - step : step; }
  void manySides() const;
  void oneSide() const;
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

/// Of as many unknowns as a vector has, in place; columns of the matrix.
template <class T, bool backwards>
__attribute__((always_inline)) inline Vec<T> solveSquare(Vec<T> x,
                                                         const Square<T> &m) {
  constexpr int size = lanes<T>;
#pragma unroll
  for (int step = 0; step < size; ++step) {
    int j = backwards ? size - 1 - step : step;
    T solved = x[j] / m.rows[j][j];
    // Only those that are left: what is infinite does not reach others.
    Vec<T> left = fma(Vec<T>(-solved), m.rows[j], x);
#pragma unroll
    for (int l = 0; l < size; ++l)
      if (backwards ? l < j : l > j)
        x[l] = left[l];
    x[j] = solved;
  }
  return x;
}

/// A vector of unknowns at a time, less what those before have to do with them.
template <class T> void Solve<T>::oneSide() const {
  constexpr int size = lanes<T>;
  i64 blocks = (n + size - 1) / size;
  for (i64 step = 0; step < blocks; ++step) {
    i64 first = (backwards ? blocks - 1 - step : step) * size;
    i64 height = n - first < size ? n - first : i64(size);
    Vec<T> known = load(x + first, height);
    i64 begin = backwards ? first + height : 0, end = backwards ? n : first;
    Square<T> part;
    if (column == 1) {
#pragma unroll
      for (int r = 0; r < size; ++r)
        part.rows[r] = 0;
      for (i64 j = begin; j < end; j += size) {
        Mask<T> there = firstLanes<T>(end - j < size ? end - j : size);
        Vec<T> before = __builtin_masked_load(there, x + j, Vec<T>(0));
#pragma unroll
        for (int r = 0; r < size; ++r) {
          i64 i = r < height ? first + r : n - 1;
          Vec<T> factors =
              __builtin_masked_load(there, m + i * row + j, Vec<T>(0));
          part.rows[r] = fma(factors, before, part.rows[r]);
        }
      }
      if (begin < end) {
        part.transpose();
#pragma unroll
        for (int half = size / 2; half > 0; half /= 2)
#pragma unroll
          for (int r = 0; r < half; ++r)
            part.rows[r] += part.rows[r + half];
        known -= part.rows[0];
      }
      part.read(m + first * row + first, row, height, height);
      part.transpose();
    } else {
      Vec<T> sums[2] = {known, Vec<T>(0)};
      for (i64 j = begin; j < end; ++j) {
        Vec<T> &sum = sums[j % 2];
        sum =
            fma(Vec<T>(-x[j]), load(m + first * row + j * column, height), sum);
      }
      known = sums[0] + sums[1];
      part.read(m + first * row + first * column, column, height, height);
    }
#pragma unroll
    for (int r = 0; r < size; ++r)
      if (r >= height)
        part.rows[r][r] = 1;
    known = backwards ? solveSquare<T, true>(known, part)
                      : solveSquare<T, false>(known, part);
    store(x + first, known, height);
  }
}

template <class T> void solve(const Solve<T> &system) {
  if (system.columns > 1)
    system.manySides();
  else
    system.oneSide();
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
