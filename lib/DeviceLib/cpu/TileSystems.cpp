//===- TileSystems.cpp - Factors and solves of many blocks at a time ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Small systems have chains of pivots that wait for each other, so those of
// several blocks are the lanes of vectors. Rows of as many systems as a vector
// has lanes are exchanged with columns on the way from the memory of the
// blocks and back; between, element (i, k) of the factor L of A = L L^T is
// vector i (i + 1) / 2 + k, with as many rows as make squares of four, those
// that there are not from the identity. What a square lacks of columns before
// it is subtracted in registers (left-looking). A lane has the same bits
// whatever the others hold.
//
//===----------------------------------------------------------------------===//

#include "TileSquares.h"

namespace {

/// What is to be done, in this order.
enum Step { factors = 1, isUpper = 2, keeps = 4, forwards = 8, backwards = 16 };

template <class T> struct Systems {
  using V = Vec<T>;
  static constexpr int count = lanes<T>, side = 4;

  T *out;
  const T *in;
  T *x;
  /// Elements from a system to the next, and how many there are.
  i64 step, systems;
  i64 n, columns;
  V *l, *inverses, *sides;

  i64 padded() const { return (n + side - 1) / side * side; }
  V *rowOf(i64 i) const { return l + i * (i + 1) / 2; }
  /// Of the factor's cotangent, which has a second triangle.
  V *barOf(i64 i) const { return sides + i * (i + 1) / 2; }
  i64 there(i64 lane) const { return lane < systems ? lane : systems - 1; }

  __attribute__((always_inline)) Square<T> take(const T *from, i64 left) const {
    Square<T> part;
#pragma unroll
    for (int s = 0; s < count; ++s)
      part.rows[s] = load(from + there(s) * step, left);
    part.transpose();
    return part;
  }
  __attribute__((always_inline)) void give(Square<T> part, T *to,
                                           i64 left) const {
    part.transpose();
#pragma unroll
    for (int s = 0; s < count; ++s)
      if (s < systems)
        store(to + s * step, part.rows[s], left);
  }

  template <bool upper> void readMatrix() const;
  template <bool upper> void writeFactor() const;
  void readSides() const;
  void writeSides() const;
  template <bool onDiagonal> void square(i64 i, i64 j) const;
  void factor() const;
  void invertDiagonal() const;
  void solveForwards() const;
  void solveBackwards() const;
  void run(i32 steps) const;
  template <int width> void differentiate(i64 j, i64 k, V diagonal) const;
  void differentiate() const;
};

//===----------------------------------------------------------------------===//
// From the memory of the blocks and back
//===----------------------------------------------------------------------===//

template <class T> template <bool upper> void Systems<T>::readMatrix() const {
  for (i64 r = 0; r < n; ++r)
    for (i64 c = upper ? r / count * count : 0; c < (upper ? n : r + 1);
         c += count) {
      Square<T> part = take(in + r * n + c, n - c);
#pragma unroll
      for (int i = 0; i < count; ++i) {
        if (!upper && c + i <= r)
          rowOf(r)[c + i] = part.rows[i];
        if (upper && c + i >= r && c + i < n)
          rowOf(c + i)[r] = part.rows[i];
      }
    }
  for (i64 r = n; r < padded(); ++r)
    for (i64 c = 0; c <= r; ++c)
      rowOf(r)[c] = V(T(c == r));
}

template <class T> template <bool upper> void Systems<T>::writeFactor() const {
  for (i64 r = 0; r < n; ++r)
    for (i64 c = 0; c < n; c += count) {
      Square<T> part;
#pragma unroll
      for (int i = 0; i < count; ++i) {
        i64 row = upper ? c + i : r, column = upper ? r : c + i;
        part.rows[i] = column <= row && row < n ? rowOf(row)[column] : V(T(0));
      }
      give(part, out + r * n + c, n - c);
    }
}

template <class T> void Systems<T>::readSides() const {
  i64 all = n * columns;
  for (i64 e = 0; e < all; e += count) {
    Square<T> part = take(x + e, all - e);
#pragma unroll
    for (int i = 0; i < count; ++i)
      sides[e + i] = part.rows[i];
  }
  for (i64 e = all; e < padded() * columns; ++e)
    sides[e] = V(T(0));
}

template <class T> void Systems<T>::writeSides() const {
  for (i64 e = 0; e < n * columns; e += count) {
    Square<T> part;
#pragma unroll
    for (int i = 0; i < count; ++i)
      part.rows[i] = sides[e + i];
    give(part, x + e, n * columns - e);
  }
}

//===----------------------------------------------------------------------===//
// Factors
//===----------------------------------------------------------------------===//

/// Of four rows from i on and four columns from j on.
template <class T>
template <bool onDiagonal>
__attribute__((always_inline)) inline void Systems<T>::square(i64 i,
                                                              i64 j) const {
  V part[side][side], *rows[side], *others[side];
  auto width = [](int r) { return onDiagonal ? r + 1 : side; };
#pragma unroll
  for (int r = 0; r < side; ++r) {
    rows[r] = rowOf(i + r);
    others[r] = rowOf(j + r);
#pragma unroll
    for (int c = 0; c < width(r); ++c)
      part[r][c] = rows[r][j + c];
  }
  for (i64 k = 0; k < j; ++k) {
    V right[side];
#pragma unroll
    for (int c = 0; c < side; ++c)
      right[c] = -others[c][k];
#pragma unroll
    for (int r = 0; r < side; ++r) {
      V left = rows[r][k];
#pragma unroll
      for (int c = 0; c < width(r); ++c)
        part[r][c] = fma(left, right[c], part[r][c]);
    }
  }
#pragma unroll
  for (int c = 0; c < side; ++c) {
    V inverse;
    if (onDiagonal) {
      // The root of what is not positive is NaN, and so is what follows.
      V none = V(T(__builtin_nan("")));
      V root =
          __builtin_elementwise_sqrt(part[c][c] > V(T(0)) ? part[c][c] : none);
      inverse = inverses[j + c] = V(T(1)) / root;
      part[c][c] = root;
    } else {
      inverse = inverses[j + c];
    }
#pragma unroll
    for (int r = onDiagonal ? c + 1 : 0; r < side; ++r) {
      part[r][c] *= inverse;
#pragma unroll
      for (int next = c + 1; next < width(r); ++next) {
        V factor = onDiagonal ? part[next][c] : others[next][j + c];
        if (onDiagonal && next == r)
          factor = part[r][c];
        part[r][next] = fma(-part[r][c], factor, part[r][next]);
      }
    }
  }
#pragma unroll
  for (int r = 0; r < side; ++r)
#pragma unroll
    for (int c = 0; c < width(r); ++c)
      rows[r][j + c] = part[r][c];
}

template <class T> void Systems<T>::factor() const {
  for (i64 j = 0; j < padded(); j += side) {
    square<true>(j, j);
    for (i64 i = j + side; i < padded(); i += side)
      square<false>(i, j);
  }
}

//===----------------------------------------------------------------------===//
// Triangular solves
//===----------------------------------------------------------------------===//

template <class T> void Systems<T>::invertDiagonal() const {
  for (i64 i = 0; i < padded(); ++i)
    inverses[i] = V(T(1)) / rowOf(i)[i];
}

template <class T> void Systems<T>::solveForwards() const {
  for (i64 i = 0; i < padded(); i += side)
    for (i64 column = 0; column < columns; ++column) {
      V part[side], *known = sides + column;
#pragma unroll
      for (int r = 0; r < side; ++r)
        part[r] = known[(i + r) * columns];
      for (i64 k = 0; k < i; ++k)
#pragma unroll
        for (int r = 0; r < side; ++r)
          part[r] = fma(-rowOf(i + r)[k], known[k * columns], part[r]);
#pragma unroll
      for (int r = 0; r < side; ++r) {
#pragma unroll
        for (int k = 0; k < r; ++k)
          part[r] = fma(-rowOf(i + r)[i + k], part[k], part[r]);
        part[r] *= inverses[i + r];
        known[(i + r) * columns] = part[r];
      }
    }
}

template <class T> void Systems<T>::solveBackwards() const {
  for (i64 i = padded() - side; i >= 0; i -= side)
    for (i64 column = 0; column < columns; ++column) {
      V part[side], *known = sides + column;
#pragma unroll
      for (int r = 0; r < side; ++r)
        part[r] = known[(i + r) * columns];
      for (i64 k = i + side; k < padded(); ++k) {
        const V *row = rowOf(k) + i;
#pragma unroll
        for (int r = 0; r < side; ++r)
          part[r] = fma(-row[r], known[k * columns], part[r]);
      }
#pragma unroll
      for (int r = side - 1; r >= 0; --r) {
#pragma unroll
        for (int k = side - 1; k > r; --k)
          part[r] = fma(-rowOf(i + k)[i + r], part[k], part[r]);
        part[r] *= inverses[i + r];
        known[(i + r) * columns] = part[r];
      }
    }
}

//===----------------------------------------------------------------------===//
// Adjoints of factors
//===----------------------------------------------------------------------===//

/// What column j of the factor had from some columns before it. Iain Murray,
/// Differentiation of the Cholesky decomposition, 2016.
template <class T>
template <int width>
__attribute__((always_inline)) inline void
Systems<T>::differentiate(i64 j, i64 k, V diagonal) const {
  V common[width], own[width];
#pragma unroll
  for (int c = 0; c < width; ++c) {
    common[c] = V(T(0));
    own[c] = rowOf(j)[k + c];
  }
  for (i64 i = j + 1; i < n; ++i) {
    V bar = barOf(i)[j];
#pragma unroll
    for (int c = 0; c < width; ++c)
      common[c] = fma(bar, rowOf(i)[k + c], common[c]);
  }
#pragma unroll
  for (int c = 0; c < width; ++c) {
    V change = fma(common[c], inverses[j], diagonal * own[c]);
    barOf(j)[k + c] -= change;
    own[c] *= -inverses[j];
  }
  for (i64 i = j + 1; i < n; ++i) {
    V bar = barOf(i)[j];
#pragma unroll
    for (int c = 0; c < width; ++c)
      barOf(i)[k + c] = fma(bar, own[c], barOf(i)[k + c]);
  }
}

/// In place of the cotangent, columns from the last to the first.
template <class T> void Systems<T>::differentiate() const {
  for (i64 j = n - 1; j >= 0; --j) {
    V common = V(T(0)), over = inverses[j];
    for (i64 i = j + 1; i < n; ++i)
      common = fma(barOf(i)[j], rowOf(i)[j], common);
    V diagonal = (barOf(j)[j] - common * over) * over;
    i64 k = 0;
    for (; k + 4 <= j; k += 4)
      differentiate<4>(j, k, diagonal);
    for (; k < j; ++k)
      differentiate<1>(j, k, diagonal);
    barOf(j)[j] = diagonal * V(T(0.5));
    for (i64 i = j + 1; i < n; ++i)
      barOf(i)[j] *= over;
  }
}

template <class T> void Systems<T>::run(i32 steps) const {
  steps &isUpper ? readMatrix<true>() : readMatrix<false>();
  if (steps & factors)
    factor();
  else
    invertDiagonal();
  if (steps & keeps)
    steps &isUpper ? writeFactor<true>() : writeFactor<false>();
  if (!(steps & (forwards | backwards)))
    return;
  readSides();
  if (steps & forwards)
    solveForwards();
  if (steps & backwards)
    solveBackwards();
  writeSides();
}

/// As many systems at a time as a vector has lanes.
template <class T>
void solveAll(u64 out, u64 in, u64 x, u64 scratch, i64 bytes, i64 systems,
              i64 n, i64 columns, i32 steps) {
  Systems<T> work{};
  work.step = bytes / i64(sizeof(T));
  work.n = n;
  work.columns = columns;
  i64 rows = work.padded();
  work.l = at<Vec<T>>(scratch);
  work.inverses = work.l + rows * (rows + 1) / 2;
  work.sides = work.inverses + rows;
  for (i64 first = 0; first < systems; first += lanes<T>) {
    u64 behind = u64(first * bytes);
    work.out = at<T>(out + behind);
    work.in = at<const T>(in + behind);
    work.x = at<T>(x + behind);
    work.systems = systems - first < lanes<T> ? systems - first : lanes<T>;
    work.run(steps);
  }
}

/// In place of the cotangents.
template <class T>
void differentiateAll(u64 bar, u64 factor, u64 scratch, i64 bytes, i64 systems,
                      i64 n, bool upper) {
  Systems<T> work{};
  work.step = bytes / i64(sizeof(T));
  work.n = n;
  i64 rows = work.padded(), triangle = rows * (rows + 1) / 2;
  Vec<T> *l = at<Vec<T>>(scratch);
  work.inverses = l + triangle;
  work.sides = work.inverses + rows;
  for (i64 first = 0; first < systems; first += lanes<T>) {
    u64 behind = u64(first * bytes);
    work.systems = systems - first < lanes<T> ? systems - first : lanes<T>;
    work.out = at<T>(bar + behind);
    auto read = [&](u64 matrix, Vec<T> *into) {
      work.in = at<const T>(matrix + behind);
      work.l = into;
      upper ? work.template readMatrix<true>()
            : work.template readMatrix<false>();
    };
    read(bar, work.sides);
    read(factor, l);
    work.invertDiagonal();
    work.differentiate();
    work.l = work.sides;
    upper ? work.template writeFactor<true>()
          : work.template writeFactor<false>();
  }
}

} // namespace

#define WARP_SYSTEMS(name, T)                                                  \
  WARP_TILES void name(u64 out, u64 in, u64 x, u64 scratch, i32 bytes,         \
                       i32 systems, i32 n, i32 columns, i32 steps, void *) {   \
    solveAll<T>(out, in, x, scratch, bytes, systems, n, columns, steps);       \
  }

#define WARP_SYSTEMS_ADJOINT(name, T)                                          \
  WARP_TILES void name(u64 bar, u64 factor, u64 scratch, i32 bytes,            \
                       i32 systems, i32 n, i32 upper, void *) {                \
    differentiateAll<T>(bar, factor, scratch, bytes, systems, n, upper != 0);  \
  }

WARP_SYSTEMS_ADJOINT(warp_tile_systems_adjoint_f32, float)
WARP_SYSTEMS_ADJOINT(warp_tile_systems_adjoint_f64, double)

WARP_SYSTEMS(warp_tile_systems_f32, float)
WARP_SYSTEMS(warp_tile_systems_f64, double)
