//===- TileReductions.cpp - Numbers of a block's threads, combined --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lanes exchange theirs at distances that double, so that all of them have the
// same in the end; then warps do by way of the block's memory. The order
// depends on nothing but the number of threads.
//
//===----------------------------------------------------------------------===//

#include "Tiles.h"

namespace {

struct Sum {
  WARP_INLINE static float of(float x, float y) { return x + y; }
};
/// NaN is skipped, as PTX defines them.
struct Least {
  WARP_INLINE static float of(float x, float y) {
    float result;
    asm("min.f32 %0, %1, %2;" : "=f"(result) : "f"(x), "f"(y));
    return result;
  }
};
struct Greatest {
  WARP_INLINE static float of(float x, float y) {
    float result;
    asm("max.f32 %0, %1, %2;" : "=f"(result) : "f"(x), "f"(y));
    return result;
  }
};

template <class Pair>
WARP_INLINE void combine(u64 own, u64 scratch, i32 threads) {
  float value = *::own<float>(own);
#pragma unroll
  for (int distance = 1; distance < 32; distance *= 2) {
    float other;
    asm volatile("shfl.sync.bfly.b32 %0, %1, %2, 31, -1;"
                 : "=f"(other)
                 : "f"(value), "r"(distance));
    value = Pair::of(value, other);
  }
  if (threads > 32) {
    Shared<float> *ofWarps = shared<float>(scratch);
    i32 thread = threadNumber();
    if (thread % 32 == 0)
      ofWarps[thread / 32] = value;
    asm volatile("bar.sync 0;" ::: "memory");
    value = ofWarps[0];
    for (i32 warp = 1; warp < threads / 32; ++warp)
      value = Pair::of(value, ofWarps[warp]);
  }
  *::own<float>(own) = value;
}

/// A number and where it is; of equal ones the first wins, and NaN never.
template <bool isGreatest> struct Extremum {
  float value;
  i32 place;

  WARP_INLINE bool loses(const Extremum &other) const {
    bool isNone = value != value, isOtherNone = other.value != other.value;
    bool isWorse = isGreatest ? other.value > value : other.value < value;
    bool ties = value == other.value || (isNone && isOtherNone);
    return isWorse || (isNone && !isOtherNone) || (ties && other.place < place);
  }
  WARP_INLINE void take(const Extremum &other) {
    if (loses(other))
      *this = other;
  }
};

template <bool isGreatest>
WARP_INLINE void combinePlaces(u64 own, u64 scratch, i32 threads) {
  Extremum<isGreatest> best{::own<float>(own)[0], ::own<i32>(own)[1]};
#pragma unroll
  for (int distance = 1; distance < 32; distance *= 2) {
    Extremum<isGreatest> other;
    asm volatile("shfl.sync.bfly.b32 %0, %1, %2, 31, -1;"
                 : "=f"(other.value)
                 : "f"(best.value), "r"(distance));
    asm volatile("shfl.sync.bfly.b32 %0, %1, %2, 31, -1;"
                 : "=r"(other.place)
                 : "r"(best.place), "r"(distance));
    best.take(other);
  }
  if (threads > 32) {
    Shared<float> *values = shared<float>(scratch);
    Shared<i32> *places = shared<i32>(scratch) + threads;
    i32 thread = threadNumber();
    if (thread % 32 == 0) {
      values[thread / 32] = best.value;
      places[thread / 32] = best.place;
    }
    asm volatile("bar.sync 0;" ::: "memory");
    for (i32 warp = 0; warp < threads / 32; ++warp)
      best.take({values[warp], places[warp]});
  }
  ::own<float>(own)[0] = best.value;
  ::own<i32>(own)[1] = best.place;
}

} // namespace

WARP_TILES warp_tile_combine_argmin(u64 own, u64 scratch, i32 threads, void *) {
  combinePlaces<false>(own, scratch, threads);
}
WARP_TILES warp_tile_combine_argmax(u64 own, u64 scratch, i32 threads, void *) {
  combinePlaces<true>(own, scratch, threads);
}
WARP_TILES warp_tile_combine_add(u64 own, u64 scratch, i32 threads, void *) {
  combine<Sum>(own, scratch, threads);
}
WARP_TILES warp_tile_combine_min(u64 own, u64 scratch, i32 threads, void *) {
  combine<Least>(own, scratch, threads);
}
WARP_TILES warp_tile_combine_max(u64 own, u64 scratch, i32 threads, void *) {
  combine<Greatest>(own, scratch, threads);
}
