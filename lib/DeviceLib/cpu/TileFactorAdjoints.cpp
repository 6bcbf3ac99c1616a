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
// Both matrices are copied to rows of whole vectors, and blocks are squares; a
// unit matrix without cotangents fills the last ones.
//
//===----------------------------------------------------------------------===//

#include "TileSquares.h"

namespace {

template <class T> struct FactorAdjoint {
  static constexpr int size = lanes<T>;
  static constexpr int height = 8;
  T *bar, *factor;
  i64 extent;

  T *barAt(i64 i, i64 j) const { return bar + i * extent + j; }
  const T *factorAt(i64 i, i64 j) const { return factor + i * extent + j; }

  void subtract(i64 row, i64 column, const T *a, i64 rowOfA, i64 stepOfA,
                i64 depth, i64 rowOfB) const;
  void divide(i64 first) const;
  Square<T> reverseBlock(i64 first) const;
  void run() const;
};

/// Rows of c from `row` on lose the product of a and rows of the factor, in
/// columns before `columns`.
template <class T>
void FactorAdjoint<T>::subtract(i64 row, i64 columns, const T *a, i64 rowOfA,
                                i64 stepOfA, i64 depth, i64 rowOfB) const {
  for (i64 column = 0; column < columns; column += size) {
    Vec<T> sums[height];
#pragma unroll
    for (int r = 0; r < height; ++r)
      sums[r] = load(barAt(row + r, column));
    for (i64 k = 0; k < depth; ++k) {
      Vec<T> right = load(factorAt(rowOfB + k, column));
#pragma unroll
      for (int r = 0; r < height; ++r)
        sums[r] = fma(Vec<T>(-a[r * rowOfA + k * stepOfA]), right, sums[r]);
    }
#pragma unroll
    for (int r = 0; r < height; ++r)
      store(barAt(row + r, column), sums[r]);
  }
}

/// C' D^-1.
template <class T> void FactorAdjoint<T>::divide(i64 first) const {
  Vec<T> inverses = 1;
#pragma unroll
  for (int j = 0; j < size; ++j)
    inverses[j] = 1 / *factorAt(first + j, first + j);
  for (i64 row = first + size; row < extent; row += height) {
    Vec<T> rows[height];
#pragma unroll
    for (int r = 0; r < height; ++r)
      rows[r] = load(barAt(row + r, first));
#pragma unroll
    for (int j = size - 1; j > 0; --j) {
      Vec<T> before =
          __builtin_masked_load(firstLanes<T>(j), factorAt(first + j, first),
                                Vec<T>(0)) *
          Vec<T>(inverses[j]);
#pragma unroll
      for (int r = 0; r < height; ++r)
        rows[r] = fma(Vec<T>(-rows[r][j]), before, rows[r]);
    }
#pragma unroll
    for (int r = 0; r < height; ++r)
      store(barAt(row + r, first), rows[r] * inverses);
  }
}

/// Columns are lanes; below the diagonal, and there, of a block.
template <class T> Square<T> FactorAdjoint<T>::reverseBlock(i64 first) const {
  Square<T> a, l;
  a.read(barAt(first, first), extent, size, size);
  l.read(factorAt(first, first), extent, size, size);
  Vec<T> diagonal = 1, halves = 0;
#pragma unroll
  for (int j = 0; j < size; ++j)
    diagonal[j] = l.rows[j][j];
  Vec<T> inverses = Vec<T>(1) / diagonal;
#pragma unroll
  for (int j = size - 1; j >= 0; --j) {
    // The terms that columns have in common with this one.
    Vec<T> common[2] = {Vec<T>(0), Vec<T>(0)};
#pragma unroll
    for (int i = j + 1; i < size; ++i)
      common[i % 2] = fma(Vec<T>(a.rows[i][j]), l.rows[i], common[i % 2]);
    Vec<T> sum = (common[0] + common[1]) * Vec<T>(inverses[j]);
    T onDiagonal = (a.rows[j][j] - sum[j]) * inverses[j];
    halves[j] = onDiagonal * T(0.5);
    Vec<T> own = l.rows[j], change = fma(own, Vec<T>(onDiagonal), sum);
    own *= Vec<T>(inverses[j]);
#pragma unroll
    for (int lane = j; lane < size; ++lane) {
      own[lane] = 0;
      change[lane] = 0;
    }
    a.rows[j] -= change;
#pragma unroll
    for (int i = j + 1; i < size; ++i)
      a.rows[i] = fma(Vec<T>(-a.rows[i][j]), own, a.rows[i]);
  }
#pragma unroll
  for (int j = 0; j < size; ++j) {
    a.rows[j] *= inverses;
    a.rows[j][j] = halves[j];
  }
  a.clear(/*above=*/true);
  return a;
}

template <class T> void FactorAdjoint<T>::run() const {
  for (i64 first = extent - size; first >= 0; first -= size) {
    i64 below = first + size;
    divide(first);
    for (i64 row = below; row < extent; row += height)
      subtract(row, first, barAt(row, first), extent, 1, size, first);
    Square<T> block;
    block.read(barAt(first, first), extent, size, size);
    for (i64 row = below; row < extent; ++row) {
      Vec<T> right = load(factorAt(row, first));
#pragma unroll
      for (int r = 0; r < size; ++r)
        block.rows[r] =
            fma(Vec<T>(-*barAt(row, first + r)), right, block.rows[r]);
    }
    block.write(barAt(first, first), extent, size, size);
    block = reverseBlock(first);
    block.write(barAt(first, first), extent, size, size);
    if (first == 0)
      return;
    Square<T> transposed = block;
    transposed.transpose();
    T both[size * size];
#pragma unroll
    for (int r = 0; r < size; ++r)
      store(both + r * size, block.rows[r] + transposed.rows[r]);
    for (i64 r = 0; r < size; r += height) {
      subtract(first + r, first, both + r, 1, size, size, first);
      subtract(first + r, first, barAt(below, first + r), 1, extent,
               extent - below, below);
    }
  }
}

/// The lower triangle of a matrix, or the upper one as columns, with whole
/// vectors in rows.
template <class T>
void copyTriangle(T *to, i64 extent, const T *from, i64 pitch, i64 n,
                  bool isTransposed, T diagonal) {
  overBlocks<T>(n, [=](i64 i, i64 height) {
    overBlocks<T>(i + 1, [=](i64 j, i64) {
      i64 width = n - j < lanes<T> ? n - j : i64(lanes<T>);
      Square<T> part;
      if (isTransposed) {
        part.read(from + j * pitch + i, pitch, width, height);
        part.transpose();
      } else {
        part.read(from + i * pitch + j, pitch, height, width);
      }
      if (i == j) {
        part.clear(/*above=*/true);
#pragma unroll
        for (int r = 0; r < lanes<T>; ++r)
          if (r >= height)
            part.rows[r][r] = diagonal;
      }
      part.write(to + i * extent + j, extent, lanes<T>, lanes<T>);
    });
  });
}

/// The factor has elements `row` and `column` from the next ones.
template <class T>
void reverseCholesky(T *bar, const T *factor, T *scratch, i64 row, i64 column,
                     i64 n, bool isUpper) {
  i64 extent = (n + lanes<T> - 1) / lanes<T> * lanes<T>;
  T *lower = scratch + extent * extent;
  copyTriangle(scratch, extent, bar, n, n, isUpper, T(0));
  bool isTransposed = isUpper == (column == 1);
  copyTriangle(lower, extent, factor, column == 1 ? row : column, n,
               isTransposed, T(1));
  FactorAdjoint<T>{scratch, lower, extent}.run();
  overBlocks<T>(n, [=](i64 i, i64 height) {
    overBlocks<T>(i + 1, [=](i64 j, i64) {
      i64 width = n - j < lanes<T> ? n - j : i64(lanes<T>);
      Square<T> part, none;
      part.read(scratch + i * extent + j, extent, lanes<T>, lanes<T>);
      none.fill(0);
      if (isUpper)
        part.transpose();
      (isUpper ? none : part).write(bar + i * n + j, n, height, width);
      if (i != j)
        (isUpper ? part : none).write(bar + j * n + i, n, width, height);
      else if (isUpper)
        part.write(bar + i * n + i, n, height, height);
    });
  });
}

} // namespace

#define WARP_FACTOR_ADJOINTS(suffix, T)                                        \
  WARP_TILES void warp_tile_cholesky_adjoint_##suffix(                         \
      u64 bar, u64 factor, u64 scratch, i32 row, i32 column, i32 n,            \
      i32 isUpper, void *) {                                                   \
    reverseCholesky(at<T>(bar), at<const T>(factor), at<T>(scratch), row,      \
                    column, n, isUpper != 0);                                  \
  }

WARP_FACTOR_ADJOINTS(f32, float)
WARP_FACTOR_ADJOINTS(f64, double)
