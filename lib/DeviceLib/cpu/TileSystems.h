//===- TileSystems.h - Systems of many blocks as lanes ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Small systems have chains of pivots that wait for each other, so those of
// several blocks are the lanes of vectors. Rows of as many systems as a vector
// has lanes are exchanged with columns on the way from the memory of the
// blocks and back; between, element (i, k) of the factor L of A = L L^T is
// vector i (i + 1) / 2 + k, with as many rows as make squares of four, those
// that there are not from the identity. Earlier columns are subtracted
// from a square in registers (left-looking). A lane has the same bits
// whatever the others hold.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_TILESYSTEMS_H
#define WARP_DEVICELIB_CPU_TILESYSTEMS_H

#include "TileSquares.h"

namespace {

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
};

//===----------------------------------------------------------------------===//
// From shared memory and back
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

/// Four rows from i on and four columns from j on.
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

} // namespace

#endif // WARP_DEVICELIB_CPU_TILESYSTEMS_H
