//===- TileProducts.cpp - Products of tiles -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// c = alpha a b + beta c, in patches of c that stay in registers while all of a
// and b goes by: per step a vector or two of a row of b, and a number per row
// of a. Rows of b and c are contiguous. Missing rows of a patch are computed
// twice, missing columns are masked.
//
//===----------------------------------------------------------------------===//

#include "TileSquares.h"

namespace {

template <class T> struct Product {
  T *c;
  const T *a, *b;
  i64 rows, columns, depth;
  /// From one element of a to the next in its row and column, and between the
  /// rows of b.
  i64 rowOfA, stepOfA, rowOfB;
  T alpha, beta;
  /// True if there is nothing in c yet.
  bool isNew;

  template <int height, int width, bool isPart>
  __attribute__((always_inline)) inline void patch(i64 row, i64 column) const;
  template <int height, int width> inline void rowsOf(i64 row) const;
  template <int height, int width> inline void run() const;
};

template <class T>
template <int height, int width, bool isPart>
void Product<T>::patch(i64 row, i64 column) const {
  using V = Vec<T>;
  V sums[height][width];
  const T *rowsOfA[height];
#pragma unroll
  for (int r = 0; r < height; ++r) {
    i64 known = row + r < rows ? row + r : rows - 1;
    rowsOfA[r] = a + known * rowOfA;
#pragma unroll
    for (int v = 0; v < width; ++v)
      sums[r][v] = 0;
  }
  const T *from = b + column;
  for (i64 k = 0; k < depth; ++k, from += rowOfB) {
    V right[width];
#pragma unroll
    for (int v = 0; v < width; ++v)
      right[v] =
          isPart ? load(from + v * lanes<T>, columns - column - v * lanes<T>)
                 : load(from + v * lanes<T>);
#pragma unroll
    for (int r = 0; r < height; ++r) {
      V left = rowsOfA[r][k * stepOfA];
#pragma unroll
      for (int v = 0; v < width; ++v)
        sums[r][v] = fma(left, right[v], sums[r][v]);
    }
  }
#pragma unroll
  for (int r = 0; r < height; ++r) {
    if (row + r >= rows)
      break;
#pragma unroll
    for (int v = 0; v < width; ++v) {
      i64 first = column + v * lanes<T>;
      i64 count = isPart ? columns - first : lanes<T>;
      T *to = c + (row + r) * columns + first;
      V value = sums[r][v] * V(alpha);
      if (!isNew && beta != T(0))
        value = fma(load(to, count), V(beta), value);
      store(to, value, count);
    }
  }
}

template <class T>
template <int height, int width>
void Product<T>::rowsOf(i64 row) const {
  constexpr i64 step = width * lanes<T>;
  i64 column = 0;
  for (; column + step <= columns; column += step)
    patch<height, width, false>(row, column);
  for (; column + lanes<T> <= columns; column += lanes<T>)
    patch<height, 1, false>(row, column);
  if (column < columns)
    patch<height, 1, true>(row, column);
}

template <class T>
template <int height, int width>
void Product<T>::run() const {
  i64 row = 0;
  for (; row + height <= rows; row += height)
    rowsOf<height, width>(row);
  for (; row < rows; row += 2)
    rowsOf<2, width>(row);
}

template <class T> void multiply(const Product<T> &product) {
  // 16 sums of the 32 registers that there are, or 12 of 16.
  if constexpr (hasWideRegisters)
    product.template run<8, 2>();
  else
    product.template run<6, 1>();
}

/// The transpose of a matrix, packed.
template <class T>
void transpose(T *to, const T *from, i64 rows, i64 columns, i64 pitch) {
  for (i64 i = 0; i < rows; i += lanes<T>)
    for (i64 j = 0; j < columns; j += lanes<T>) {
      i64 height = rows - i < lanes<T> ? rows - i : i64(lanes<T>);
      i64 width = columns - j < lanes<T> ? columns - j : i64(lanes<T>);
      Square<T> part;
      part.read(from + i * pitch + j, pitch, height, width);
      part.transpose();
      part.write(to + j * rows + i, rows, width, height);
    }
}

} // namespace

#define WARP_TRANSPOSE(name, T)                                                \
  WARP_TILES void name(u64 to, u64 from, i32 rows, i32 columns, i32 pitch,     \
                       void *) {                                               \
    transpose(at<T>(to), at<const T>(from), rows, columns, pitch);             \
  }

WARP_TRANSPOSE(warp_tile_transpose_f32, float)
WARP_TRANSPOSE(warp_tile_transpose_f64, double)

#define WARP_PRODUCT(name, T)                                                  \
  WARP_TILES void name(u64 c, u64 a, u64 b, i32 rows, i32 columns, i32 depth,  \
                       i32 rowOfA, i32 stepOfA, i32 rowOfB, i32 isNew,         \
                       T alpha, T beta, void *) {                              \
    multiply(Product<T>{at<T>(c), at<const T>(a), at<const T>(b), rows,        \
                        columns, depth, rowOfA, stepOfA, rowOfB, alpha, beta,  \
                        isNew != 0});                                          \
  }

WARP_PRODUCT(warp_tile_product_f32, float)
WARP_PRODUCT(warp_tile_product_f64, double)
