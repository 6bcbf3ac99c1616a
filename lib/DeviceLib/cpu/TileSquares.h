//===- TileSquares.h - Register blocks of a matrix --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As many rows as a vector has elements, a vector each.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_TILESQUARES_H
#define WARP_DEVICELIB_CPU_TILESQUARES_H

#include "Tiles.h"

namespace {

template <class T> struct Square {
  static constexpr int size = lanes<T>;
  Vec<T> rows[size];

  __attribute__((always_inline)) void fill(T value) {
#pragma unroll
    for (int r = 0; r < size; ++r)
      rows[r] = value;
  }
  /// From a row-major matrix; what is beyond `height` and `width` is zero.
  __attribute__((always_inline)) void read(const T *from, i64 pitch, i64 height,
                                           i64 width) {
    if (height == size && width == size) {
#pragma unroll
      for (int r = 0; r < size; ++r)
        rows[r] = load(from + r * pitch);
      return;
    }
    Mask<T> there = firstLanes<T>(width);
#pragma unroll
    for (int r = 0; r < size; ++r)
      rows[r] = r < height
                    ? __builtin_masked_load(there, from + r * pitch, Vec<T>(0))
                    : Vec<T>(0);
  }
  __attribute__((always_inline)) void write(T *to, i64 pitch, i64 height,
                                            i64 width) const {
    if (height == size && width == size) {
#pragma unroll
      for (int r = 0; r < size; ++r)
        store(to + r * pitch, rows[r]);
      return;
    }
    Mask<T> there = firstLanes<T>(width);
#pragma unroll
    for (int r = 0; r < size; ++r)
      if (r < height)
        __builtin_masked_store(there, rows[r], to + r * pitch);
  }
  /// Within quarters of vectors first, which have one instruction for each
  /// step, and then whole quarters.
  __attribute__((always_inline)) void transpose() {
    constexpr int part = size / 4;
    interleave<1>();
    if constexpr (part > 2)
      interleave<2>();
    Square old = *this;
#pragma unroll
    for (int r = 0; r < part; ++r) {
      Vec<T> parts[4];
#pragma unroll
      for (int i = 0; i < 4; ++i)
        parts[i] = old.rows[i * part + r];
      rows[r] = quarters<0>(quarters<0>(parts[0], parts[1]),
                            quarters<0>(parts[2], parts[3]));
      rows[part + r] = quarters<0>(quarters<1>(parts[0], parts[1]),
                                   quarters<1>(parts[2], parts[3]));
      rows[2 * part + r] = quarters<1>(quarters<0>(parts[0], parts[1]),
                                       quarters<0>(parts[2], parts[3]));
      rows[3 * part + r] = quarters<1>(quarters<1>(parts[0], parts[1]),
                                       quarters<1>(parts[2], parts[3]));
    }
  }
  /// A step within quarters: groups of elements of two rows in turn.
  template <int group> __attribute__((always_inline)) void interleave() {
    Square old = *this;
#pragma unroll
    for (int r = 0; r < size; ++r) {
      int first = r / (2 * group) * (2 * group) + r % (2 * group) / 2;
      const Vec<T> &a = old.rows[first], &b = old.rows[first + group];
      rows[r] = r % 2 ? halves<group, 1>(a, b) : halves<group, 0>(a, b);
    }
  }
  /// In each quarter, groups of the lower or upper halves of those of a and b.
  template <int group, int upper>
  __attribute__((always_inline)) static Vec<T> halves(Vec<T> a, Vec<T> b) {
    return shuffle(a, b, [](int l) {
      constexpr int part = size / 4;
      int within = l % part, turn = within / group;
      return turn % 2 * size + l - within + upper * (part / 2) +
             turn / 2 * group + within % group;
    });
  }
  /// Quarters 0 and 2 of a and of b, or 1 and 3.
  template <int odd>
  __attribute__((always_inline)) static Vec<T> quarters(Vec<T> a, Vec<T> b) {
    return shuffle(a, b, [](int l) {
      constexpr int part = size / 4;
      return l / part / 2 * size + (l / part % 2 * 2 + odd) * part + l % part;
    });
  }
  /// Elements of a and b, which follow each other, by a function of the lane.
  template <class From>
  __attribute__((always_inline)) static Vec<T> shuffle(Vec<T> a, Vec<T> b,
                                                       From from) {
    return shuffleLanes(a, b, from, __make_integer_seq<Lanes, int, size>());
  }
  template <class Index, Index... lane> struct Lanes {};
  template <class From, int... lane>
  __attribute__((always_inline)) static Vec<T>
  shuffleLanes(Vec<T> a, Vec<T> b, From, Lanes<int, lane...>) {
    return __builtin_shufflevector(a, b, From()(lane)...);
  }
  /// Clears the elements above the diagonal, or below it.
  __attribute__((always_inline)) void clear(bool above) {
#pragma unroll
    for (int r = 0; r < size; ++r)
#pragma unroll
      for (int l = 0; l < size; ++l)
        if (above ? l > r : l < r)
          rows[r][l] = 0;
  }
};

/// Calls `work` for the rows of blocks: first row and how many there are.
template <class T, class Work> inline void overBlocks(i64 n, const Work &work) {
  for (i64 i = 0; i < n; i += lanes<T>)
    work(i, n - i < lanes<T> ? n - i : i64(lanes<T>));
}

} // namespace

#endif // WARP_DEVICELIB_CPU_TILESQUARES_H
