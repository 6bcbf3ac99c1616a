//===- TileFactors.cpp - Cholesky factors and triangular solves of tiles --===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Squares of a matrix, as many rows as a vector has elements, stay in registers
// while the rows before them are subtracted (left-looking) and they are
// factored or solved with. Quotients are products with inverses where others
// wait for them.
//
//===----------------------------------------------------------------------===//

#include "TileSquares.h"

#include "tiles/Factors.h"

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

/// Rows of U from those of A, less what rows before have, and one over the
/// roots. The next diagonal element is known before its row is, and roots are
/// taken at the end: no step waits for one.
template <class T>
__attribute__((always_inline)) inline Vec<T> factorSquare(Square<T> &a) {
  T next = a.rows[0][0];
  Vec<T> squares = 1;
#pragma unroll
  for (int j = 0; j < lanes<T>; ++j) {
    // The root of what is not positive is NaN, and so is what follows.
    T square = next > 0 ? next : T(__builtin_nan(""));
    T inverse = 1 / square;
    squares[j] = square;
    if (j + 1 == lanes<T>)
      break;
    Vec<T> row = a.rows[j];
    T beside = row[j + 1];
    next = fma(-(beside * inverse), beside, a.rows[j + 1][j + 1]);
    Vec<T> ratios = row * Vec<T>(inverse);
#pragma unroll
    for (int i = j + 1; i < lanes<T>; ++i)
      a.rows[i] = fma(Vec<T>(-ratios[i]), row, a.rows[i]);
  }
  Vec<T> roots = __builtin_elementwise_sqrt(squares);
  Vec<T> inverses = Vec<T>(1) / roots;
#pragma unroll
  for (int j = 0; j < lanes<T>; ++j) {
    a.rows[j] *= Vec<T>(inverses[j]);
    a.rows[j][j] = roots[j];
  }
  return inverses;
}

/// The factor U of A = U^T U, or its transpose, a square at a time: left are
/// squares in registers, and what they need of those before is in `rows`, which
/// has as many elements per row as whole squares have.
template <class T, bool isUpper>
void cholesky(T *out, const T *in, i64 n, T *rows) {
  constexpr int size = lanes<T>;
  i64 pitch = (n + size - 1) / size * size;
  overBlocks<T>(n, [=](i64 i, i64 height) {
    Vec<T> inverses = 0;
    T *own = rows + i * pitch;
    for (i64 c = i; c < n; c += size) {
      i64 width = n - c < size ? n - c : i64(size);
      Square<T> part;
      if (isUpper) {
        part.read(in + i * n + c, n, height, width);
      } else {
        part.read(in + c * n + i, n, width, height);
        part.transpose();
      }
      for (i64 k = 0; k < i; ++k) {
        Vec<T> row = load(rows + k * pitch + c);
        const T *factors = rows + k * pitch + i;
#pragma unroll
        for (int r = 0; r < size; ++r)
          part.rows[r] = fma(Vec<T>(-factors[r]), row, part.rows[r]);
      }
      if (c == i) {
        // Rows that there are not are those of the identity.
#pragma unroll
        for (int r = 0; r < size; ++r)
          if (r >= height) {
            part.rows[r] = 0;
            part.rows[r][r] = 1;
          }
        inverses = factorSquare(part);
        part.clear(/*above=*/false);
      } else {
        // Not the last rows, so there are all.
#pragma unroll
        for (int j = 0; j < size; ++j) {
          const T *factors = own + j * pitch + i;
          part.rows[j] *= Vec<T>(inverses[j]);
#pragma unroll
          for (int r = j + 1; r < size; ++r)
            part.rows[r] = fma(Vec<T>(-factors[r]), part.rows[j], part.rows[r]);
        }
      }
      // No caller asks for the values of the last rows.
      if (i + size < n)
#pragma unroll
        for (int r = 0; r < size; ++r)
          store(own + r * pitch + c, part.rows[r]);
      Square<T> none;
      none.fill(0);
      if (isUpper) {
        part.write(out + i * n + c, n, height, width);
        if (c != i)
          none.write(out + c * n + i, n, width, height);
      } else {
        part.transpose();
        part.write(out + c * n + i, n, width, height);
        if (c != i)
          none.write(out + i * n + c, n, height, width);
      }
    }
  });
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

/// Solves for as many unknowns as a vector has, in place; columns of the
/// matrix. These are divided by the diagonal before, and the unknowns after, so
/// that no step waits for a quotient.
template <class T, bool backwards>
__attribute__((always_inline)) inline Vec<T> solveSquare(Vec<T> x,
                                                         const Square<T> &m) {
  constexpr int size = lanes<T>;
  Vec<T> diagonal = 1;
#pragma unroll
  for (int j = 0; j < size; ++j)
    diagonal[j] = m.rows[j][j];
  Vec<T> inverses = Vec<T>(1) / diagonal;
#pragma unroll
  for (int step = 0; step < size; ++step) {
    int j = backwards ? size - 1 - step : step;
    Vec<T> column = m.rows[j] * Vec<T>(inverses[j]);
    // Only those that are left: what is infinite does not reach others.
    Vec<T> left = fma(Vec<T>(-x[j]), column, x);
#pragma unroll
    for (int l = 0; l < size; ++l)
      if (backwards ? l < j : l > j)
        x[l] = left[l];
  }
  return x / diagonal;
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
      Vec<T> sums[4] = {known, Vec<T>(0), Vec<T>(0), Vec<T>(0)};
      i64 j = begin;
      if (height == size)
        for (; j + 4 <= end; j += 4)
#pragma unroll
          for (int s = 0; s < 4; ++s)
            sums[s] = fma(Vec<T>(-x[j + s]),
                          load(m + first * row + (j + s) * column), sums[s]);
      for (; j < end; ++j)
        sums[0] = fma(Vec<T>(-x[j]), load(m + first * row + j * column, height),
                      sums[0]);
      known = (sums[0] + sums[1]) + (sums[2] + sums[3]);
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

//===----------------------------------------------------------------------===//
// Small matrices
//===----------------------------------------------------------------------===//

struct OneThread {
  static constexpr int thread = 0, threads = 1;
  void barrier() const {}
};

/// Moving squares of vectors costs more than moving elements one by one of so
/// few rows: a factor of 4 rows takes an eighth of the time, one of 16 twice as
/// long.
constexpr i32 mostFactored = 8, mostSolved = 4;

template <class T> void factorSmall(T *out, const T *in, i32 n, bool isUpper) {
  i32 row = isUpper ? 1 : n, column = isUpper ? n : 1;
  tiles::factor<T>(OneThread(), tiles::Matrix<T *>{out, row, column},
                   tiles::Matrix<const T *>{in, row, column}, n);
}

} // namespace

#define WARP_FACTORS(suffix, T)                                                \
  WARP_TILES void warp_tile_cholesky_##suffix(u64 out, u64 in, u64 scratch,    \
                                              i32 n, i32 isUpper, void *) {    \
    if (n <= mostFactored)                                                     \
      return factorSmall(at<T>(out), at<const T>(in), n, isUpper != 0);        \
    (isUpper ? cholesky<T, true> : cholesky<T, false>)(at<T>(out),             \
                                                       at<const T>(in), n,     \
                                                       at<T>(scratch));        \
  }                                                                            \
  WARP_TILES void warp_tile_solve_##suffix(u64 x, u64 m, i32 n, i32 columns,   \
                                           i32 row, i32 column, i32 backwards, \
                                           void *) {                           \
    if (n <= mostSolved && columns == 1)                                       \
      return tiles::solve<T>(                                                  \
          OneThread(), tiles::Matrix<T *>{at<T>(x), 1, 1},                     \
          tiles::Matrix<const T *>{at<const T>(m), row, column}, n, 1,         \
          backwards != 0);                                                     \
    solve(Solve<T>{at<T>(x), at<const T>(m), n, columns, row, column,          \
                   backwards != 0});                                           \
  }

WARP_FACTORS(f32, float)
WARP_FACTORS(f64, double)
