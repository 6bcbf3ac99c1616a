//===- TileReductions.cpp - Block reductions ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// For sums lanes exchange theirs at distances that double, so that all of them
// have the same in the end; then warps do by way of shared memory. The
// order depends on nothing but the number of threads. Extrema are found as
// integers, which lanes compare in one instruction.
//
//===----------------------------------------------------------------------===//

#include "Tiles.h"

namespace {

WARP_INLINE void combineSums(u64 own, u64 scratch, i32 threads) {
  float value = *::own<float>(own);
#pragma unroll
  for (int distance = 1; distance < warpSize; distance *= 2)
    value += shuffleXor(value, distance);
  if (threads > warpSize) {
    Shared<float> *ofWarps = shared<float>(scratch);
    i32 thread = threadNumber();
    if (thread % warpSize == 0)
      ofWarps[thread / warpSize] = value;
    syncThreads();
    value = ofWarps[0];
#pragma clang loop unroll(full)
    for (i32 warp = 1; warp < threads / warpSize; ++warp)
      value += ofWarps[warp];
  }
  *::own<float>(own) = value;
}

/// Numbers as integers in the same order, which lanes compare at once. The
/// value that loses against everything stands for NaN.
template <bool isGreatest> struct Key {
  static constexpr i32 none = isGreatest ? (i32)0x80000000 : 0x7fffffff;

  WARP_INLINE static i32 flipped(i32 bits) {
    return bits ^ ((bits >> 31) & 0x7fffffff);
  }
  WARP_INLINE static i32 of(float value) {
    return value == value ? flipped(__builtin_bit_cast(i32, value)) : none;
  }
  WARP_INLINE static float back(i32 key) {
    return key == none ? __builtin_nanf("")
                       : __builtin_bit_cast(float, flipped(key));
  }
  WARP_INLINE static i32 best(i32 x, i32 y) {
    return (isGreatest ? x > y : x < y) ? x : y;
  }
  WARP_INLINE static i32 overLanes(i32 key) {
    return isGreatest ? greatestOfLanes(key) : leastOfLanes(key);
  }
};

template <bool isGreatest>
WARP_INLINE void combineKeys(u64 own, u64 scratch, i32 threads) {
  using Order = Key<isGreatest>;
  i32 key = Order::overLanes(Order::of(*::own<float>(own)));
  if (threads > warpSize) {
    Shared<i32> *ofWarps = shared<i32>(scratch);
    i32 thread = threadNumber();
    if (thread % warpSize == 0)
      ofWarps[thread / warpSize] = key;
    syncThreads();
#pragma clang loop unroll(full)
    for (i32 warp = 0; warp < threads / warpSize; ++warp)
      key = Order::best(key, ofWarps[warp]);
  }
  *::own<float>(own) = Order::back(key);
}

/// A number and where it is; of equal ones the first wins, and NaN never.
template <bool isGreatest>
WARP_INLINE void combinePlaces(u64 own, u64 scratch, i32 threads) {
  using Order = Key<isGreatest>;
  // Both zeros tie.
  i32 mine = Order::of(::own<float>(own)[0] + 0.0f);
  i32 key = Order::overLanes(mine);
  i32 place = Key<false>::overLanes(mine == key ? ::own<i32>(own)[1]
                                                : Key<false>::none);
  if (threads > warpSize) {
    Shared<i32> *keys = shared<i32>(scratch), *places = keys + threads;
    i32 thread = threadNumber();
    if (thread % warpSize == 0) {
      keys[thread / warpSize] = key;
      places[thread / warpSize] = place;
    }
    syncThreads();
#pragma clang loop unroll(full)
    for (i32 warp = 0; warp < threads / warpSize; ++warp) {
      i32 other = keys[warp], where = places[warp];
      place = other == key ? (where < place ? where : place)
              : Order::best(other, key) == other ? where
                                                 : place;
      key = Order::best(other, key);
    }
  }
  ::own<float>(own)[0] = Order::back(key);
  ::own<i32>(own)[1] = place;
}

} // namespace

WARP_TILES warp_tile_combine_argmin(u64 own, u64 scratch, i32 threads, void *) {
  combinePlaces<false>(own, scratch, threads);
}
WARP_TILES warp_tile_combine_argmax(u64 own, u64 scratch, i32 threads, void *) {
  combinePlaces<true>(own, scratch, threads);
}
WARP_TILES warp_tile_combine_add(u64 own, u64 scratch, i32 threads, void *) {
  combineSums(own, scratch, threads);
}
WARP_TILES warp_tile_combine_min(u64 own, u64 scratch, i32 threads, void *) {
  combineKeys<false>(own, scratch, threads);
}
WARP_TILES warp_tile_combine_max(u64 own, u64 scratch, i32 threads, void *) {
  combineKeys<true>(own, scratch, threads);
}
