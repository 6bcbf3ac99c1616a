//===- TileSorts.cpp - Sorting the elements of a tile ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Keys are unsigned numbers in the order that is wanted, with the position that
// each had: short runs by insertion, then merged in pairs of runs, from one
// memory to the other. Stable.
//
//===----------------------------------------------------------------------===//

#include "Tiles.h"

namespace {

struct Run {
  u64 *keys;
  i32 *positions;

  void set(i64 i, const Run &from, i64 j) const {
    keys[i] = from.keys[j];
    positions[i] = from.positions[j];
  }
};

constexpr i64 shortest = 8;

void insert(const Run &run, i64 begin, i64 end) {
  for (i64 i = begin + 1; i < end; ++i) {
    u64 key = run.keys[i];
    i32 position = run.positions[i];
    i64 j = i;
    for (; j > begin && run.keys[j - 1] > key; --j)
      run.set(j, run, j - 1);
    run.keys[j] = key;
    run.positions[j] = position;
  }
}

void merge(const Run &to, const Run &from, i64 begin, i64 middle, i64 end) {
  i64 left = begin, right = middle;
  for (i64 i = begin; i < end; ++i) {
    bool takesLeft = right >= end ||
                     (left < middle && from.keys[left] <= from.keys[right]);
    to.set(i, from, takesLeft ? left : right);
    left += takesLeft;
    right += !takesLeft;
  }
}

i64 least(i64 a, i64 b) { return a < b ? a : b; }

} // namespace

/// Room for 12 bytes per element follows the keys' 8.
WARP_TILES void warp_tile_sort(u64 keys, u64 positions, i32 count, void *) {
  i64 n = count;
  Run run{at<u64>(keys), at<i32>(positions)};
  Run other{run.keys + n, reinterpret_cast<i32 *>(run.keys + 2 * n)};
  for (i64 i = 0; i < n; ++i)
    run.positions[i] = i32(i);
  for (i64 begin = 0; begin < n; begin += shortest)
    insert(run, begin, least(begin + shortest, n));
  for (i64 length = shortest; length < n; length *= 2) {
    for (i64 begin = 0; begin < n; begin += 2 * length)
      merge(other, run, begin, least(begin + length, n),
            least(begin + 2 * length, n));
    Run old = run;
    run = other;
    other = old;
  }
  if (run.positions != at<i32>(positions))
    for (i64 i = 0; i < n; ++i)
      other.positions[i] = run.positions[i];
}
