//===- SparseProduct.cpp - Sparse matrix-vector product on CUDA -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Rows may be empty or hold a good part of the matrix, so blocks share what
// there is to do, not rows (Merrill and Garland, "Merge-based parallel sparse
// matrix-vector multiplication", 2016): entries and ends of rows make one
// sequence, in which the end of a row follows its last entry, and a block takes
// as much of it as any other. It puts its products side by side in shared
// memory and adds those of each row: a warp does for a row where rows are long,
// else each thread goes through as much of the sequence as any other. The part
// that a block has of a row that goes on is published for the block in which
// the row ends. The order of additions depends on the matrix alone.
//
//===----------------------------------------------------------------------===//

#include "LaunchShapes.h"
#include "Published.h"

using namespace gpu;
using namespace productShape;

static constexpr int warps = threads / warpSize;
/// Up to so many rows in a tile, a warp adds a row.
static constexpr int fewRows = 64;

namespace {

/// Row i ends at offsets[i + 1].
template <typename T> struct Matrix {
  const int32_t *offsets, *columns;
  const T *values;
  int rows;

  /// The end of a row in the sequence.
  int64_t endOf(int row) const {
    return static_cast<int64_t>(offsets[row + 1]) + row;
  }
};

/// The destination of rows: alpha * sum + beta * y.
template <typename T> struct Target {
  T *y;
  T alpha, beta;

  void put(int row, T sum) const {
    // An unwanted entry need not be a number.
    y[row] = beta == T(0) ? alpha * sum : alpha * sum + beta * y[row];
  }
};

/// A number's memory for an integer.
int integerIn(float word) { return __builtin_bit_cast(int32_t, word); }
int integerIn(double word) {
  return static_cast<int>(__builtin_bit_cast(int64_t, word));
}
void putInteger(float &word, int32_t value) {
  word = __builtin_bit_cast(float, value);
}
void putInteger(double &word, int64_t value) {
  word = __builtin_bit_cast(double, value);
}

/// A tile in shared memory: where its rows end among its products, counted
/// from its first one; then the products.
template <typename T> struct Tile {
  int rows, count;
  T *words;

  int end(int row) const { return integerIn(words[row]); }
  void setEnd(int row, int end) const { putInteger(words[row], end); }
  T &product(int i) const { return words[rows + i]; }

  int beginOf(int row) const { return row == 0 ? 0 : end(row - 1); }
  int endOf(int row) const { return row < rows ? end(row) : count; }
};

/// The part of a thread in its last row, and true if that began in it.
template <typename T> struct Tail {
  bool begins;
  T sum;

  Tail after(Tail before) const {
    return {before.begins || begins, begins ? sum : before.sum + sum};
  }
};

} // namespace

/// How many rows end before a place of the sequence; all lanes of a warp look.
template <typename T>
static int rowsBefore(const Matrix<T> &matrix, int64_t place) {
  int64_t first = 0, last = place < matrix.rows ? place : matrix.rows;
  while (first < last) {
    int64_t step = (last - first + warpSize - 1) / warpSize;
    int64_t row = first + lane() * step;
    bool isBefore = row < last && matrix.endOf(int(row)) < place;
    int found = __builtin_popcount(ballot(isBefore));
    if (found == 0)
      break;
    int64_t limit = first + found * step;
    last = limit < last ? limit : last;
    first += (found - 1) * step + 1;
  }
  return int(first);
}

/// A warp adds the rows that its number is due for. Gives what the tile has of
/// the row that goes on, in the warp that has added it.
template <typename T, typename Put>
static T addByWarps(const Tile<T> &tile, Put put) {
  T rest = 0;
  for (int row = thread() / warpSize; row <= tile.rows; row += warps) {
    T sum = 0;
    for (int i = tile.beginOf(row) + lane(); i < tile.endOf(row); i += warpSize)
      sum += tile.product(i);
#pragma unroll
    for (int mask = 1; mask < warpSize; mask *= 2)
      sum += shuffleXor(sum, mask);
    if (row == tile.rows)
      rest = sum;
    else if (lane() == 0)
      put(row, sum);
  }
  return rest;
}

/// The part of the threads before this one in the row that it begins in.
template <typename T> static T tailBefore(Tail<T> own, T &ofBlock) {
  WARP_SHARED T sums[warps];
  WARP_SHARED bool begins[warps];
#pragma unroll
  for (int distance = 1; distance < warpSize; distance *= 2) {
    Tail<T> other = {shuffleUp(uint32_t(own.begins), distance) != 0,
                     shuffleUp(own.sum, distance)};
    if (lane() >= distance)
      own = own.after(other);
  }
  int warp = thread() / warpSize;
  if (lane() == warpSize - 1) {
    sums[warp] = own.sum;
    begins[warp] = own.begins;
  }
  Tail<T> before = {shuffleUp(uint32_t(own.begins), 1) != 0,
                    shuffleUp(own.sum, 1)};
  if (lane() == 0)
    before = {false, T(0)};
  syncThreads();
  Tail<T> all = {false, T(0)};
#pragma unroll
  for (int i = 0; i < warps; ++i) {
    if (i == warp)
      before = before.after(all);
    all = Tail<T>{begins[i], sums[i]}.after(all);
  }
  ofBlock = all.sum;
  return before.sum;
}

/// Each thread goes through a piece of the sequence. Gives what the tile has of
/// the row that goes on.
template <typename T, typename Put>
static T addByThreads(const Tile<T> &tile, Put put) {
  int all = tile.rows + tile.count;
  int place = thread() * perThread;
  place = place < all ? place : all;
  int first = 0, last = place < tile.rows ? place : tile.rows;
  while (first < last) {
    int middle = (first + last) / 2;
    if (tile.end(middle) + middle < place)
      first = middle + 1;
    else
      last = middle;
  }
  int row = first, at = place - first;
  // The row that the thread begins in may have begun before.
  T sum = 0, ofFirst = 0;
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    if (place + i >= all)
      continue;
    if (row < tile.rows && tile.end(row) <= at) {
      if (row == first)
        ofFirst = sum;
      else
        put(row, sum);
      sum = 0;
      ++row;
    } else {
      sum += tile.product(at++);
    }
  }
  T rest, before = tailBefore<T>({row != first, sum}, rest);
  if (row != first)
    put(first, before + ofFirst);
  return rest;
}

/// `sums` is what tiles publish, zero at first.
template <typename T>
static void multiply(const Matrix<T> &matrix, const T *x, Target<T> target,
                     uint64_t *sums) {
  WARP_SHARED int bounds[2];
  WARP_SHARED T words[tileLength];
  WARP_SHARED T firstSum;
  int tileNumber = block();
  int64_t begin = int64_t(tileNumber) * tileLength;
  int64_t all = int64_t(matrix.offsets[matrix.rows]) + matrix.rows;
  if (begin >= all)
    return;
  int64_t end = begin + tileLength < all ? begin + tileLength : all;
  int warp = thread() / warpSize;
  if (warp < 2) {
    int found = rowsBefore(matrix, warp == 0 ? begin : end);
    if (lane() == 0)
      bounds[warp] = found;
  }
  syncThreads();
  int firstRow = bounds[0];
  int firstEntry = int(begin - firstRow);
  Tile<T> tile = {bounds[1] - firstRow, 0, words};
  tile.count = int(end - bounds[1]) - firstEntry;

  const int32_t *columns = matrix.columns + firstEntry;
  const T *values = matrix.values + firstEntry;
  int column[perThread];
  T product[perThread];
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = i * threads + thread();
    column[i] = at < tile.count ? loadOnce(columns + at) : 0;
    product[i] = at < tile.count ? loadOnce(values + at) : T(0);
  }
  // The start of the first row in the sequence.
  int64_t start = int64_t(matrix.offsets[firstRow]) + firstRow;
  for (int i = thread(); i < tile.rows; i += threads)
    tile.setEnd(i, matrix.offsets[firstRow + i + 1] - firstEntry);
#pragma unroll
  for (int i = 0; i < perThread; ++i)
    if (i * threads + thread() < tile.count)
      product[i] *= x[column[i]];
#pragma unroll
  for (int i = 0; i < perThread; ++i)
    if (i * threads + thread() < tile.count)
      tile.product(i * threads + thread()) = product[i];
  syncThreads();

  // The first row may have begun in tiles before this one. Blocks begin in
  // their order, so what they publish is on its way.
  auto ofTile = [&](int i) {
    return Published<T>(sums + int64_t(i) * Published<T>::words);
  };
  auto put = [&](int row, T sum) {
    if (row == 0)
      firstSum = sum;
    else
      target.put(firstRow + row, sum);
  };
  T rest;
  bool publishes;
  if (tile.rows <= fewRows) {
    rest = addByWarps(tile, put);
    publishes = lane() == 0 && tile.rows % warps == warp;
  } else {
    rest = addByThreads(tile, put);
    publishes = thread() == 0;
  }
  if (publishes)
    ofTile(tileNumber).set(rest);
  if (tile.rows == 0)
    return;
  T before = 0;
  if (start < begin) {
    for (int i = int(start / tileLength) + thread(); i < tileNumber;
         i += threads)
      before += ofTile(i).get();
    before = sumOfBlock<warps>(before);
  } else {
    syncThreads();
  }
  if (thread() == 0)
    target.put(firstRow, before + firstSum);
}

#define WARP_SPARSE_PRODUCT(name, T, blocks)                                   \
  WARP_KERNEL(threads, blocks)                                                 \
  void sparse_product_##name(const int32_t *__restrict__ offsets,              \
                             const int32_t *__restrict__ columns,              \
                             const T *__restrict__ values, int rows,           \
                             const T *__restrict__ x, T *__restrict__ y,       \
                             T alpha, T beta, uint64_t *sums) {                \
    multiply<T>({offsets, columns, values, rows}, x, {y, alpha, beta}, sums);  \
  }

WARP_SPARSE_PRODUCT(f32, float, 8)
WARP_SPARSE_PRODUCT(f64, double, 5)
