//===- SortSegments.cpp - Sorts of many short sequences on CUDA -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A segment of up to 16 pairs is sorted by 4 lanes of a warp, one of up to 128
// by 8 lanes, one of up to 512 by a whole warp, in registers: by a network of
// comparisons (Batcher, "Sorting networks and their applications", 1968) of
// keys with the place of the pair behind them, so that equal keys keep their
// order. Longer segments are noted in a list for the next kernel; the last ones
// are for blocks (SortLongSegments.cpp).
//
//===----------------------------------------------------------------------===//

#include "Segments.h"

/// Compares numbers at a distance, where sequences of `size` are to be in order
/// next, upward and downward in turn; and so on until all are.
template <int lanes, int each, int size, int distance>
[[gnu::always_inline]] static inline void compare(uint64_t (&x)[each]) {
  int first = (lane() & (lanes - 1)) * each;
  // True if this lane keeps the smaller of two numbers.
  bool smaller = !(first & distance) == !(first & size);
#pragma unroll
  for (int i = 0; i < each; ++i) {
    if constexpr (distance >= each) {
      uint64_t other = shuffleXor(x[i], distance / each);
      x[i] = (other < x[i]) == smaller ? other : x[i];
    } else if (!(i & distance)) {
      uint64_t a = x[i], b = x[i | distance];
      bool swaps = (b < a) == !((first | i) & size);
      x[i] = swaps ? b : a;
      x[i | distance] = swaps ? a : b;
    }
  }
  if constexpr (distance > 1)
    compare<lanes, each, size, distance / 2>(x);
  else if constexpr (size < lanes * each)
    compare<lanes, each, size * 2, size>(x);
}

/// Sorts what groups of `lanes` have, `each` numbers a lane: afterwards the
/// first lane has the first ones.
template <int lanes, int each>
[[gnu::always_inline]] static inline void sortRegisters(uint64_t (&x)[each]) {
  compare<lanes, each, 2, 1>(x);
}

/// Sorts a segment of up to `lanes * each` pairs for each group of lanes.
/// `places` and `moved` are memory of the group, as many.
template <int lanes, int each>
[[gnu::always_inline]] static inline void
sortGroups(uint32_t *keys, uint32_t *values, int length, Order order,
           unsigned short *places, uint32_t *moved) {
  int own = lane() & (lanes - 1);
  // Missing elements at the end are read again, so that no load waits for a
  // branch; values are on their way while keys are compared.
  uint32_t key[each];
#pragma unroll
  for (int i = 0; i < each; ++i) {
    int at = i * lanes + own;
    key[i] = keys[at < length ? at : 0];
  }
#pragma unroll
  for (int i = 0; i < each; ++i) {
    int at = i * lanes + own;
    moved[at] = values[at < length ? at : 0];
  }
  uint64_t x[each];
#pragma unroll
  for (int i = 0; i < each; ++i) {
    int at = i * lanes + own;
    x[i] = at < length ? uint64_t(order.ordered(key[i])) << 32 | at : ~0ul;
  }
  sortRegisters<lanes, each>(x);
#pragma unroll
  for (int i = 0; i < each; ++i)
    places[own * each + i] = static_cast<unsigned short>(x[i]);
  syncWarp();
#pragma unroll
  for (int i = 0; i < each; ++i) {
    int at = i * lanes + own;
    int from = at < length ? places[at] : 0;
    key[i] = keys[from];
    if (at < length)
      values[at] = moved[from];
  }
  syncWarp();
#pragma unroll
  for (int i = 0; i < each; ++i) {
    int at = i * lanes + own;
    if (at < length)
      keys[at] = key[i];
  }
}

/// Sorts segments of up to `lanes * most` pairs, those in a list or all of
/// `segments`, and lists the others.
template <int lanes, int most>
[[gnu::always_inline]] static inline void sortShort(const Segments &all,
                                                    Order order, int segments,
                                                    List listed, List longer) {
  WARP_SHARED unsigned short places[threads * most];
  WARP_SHARED uint32_t moved[threads * most];
  constexpr int groups = warpSize / lanes;
  int total = listed.size ? static_cast<int>(*listed.size) : segments;
  int warp = block() * warps + thread() / warpSize;
  int step = blocks() * warps * groups;
  int own = thread() / lanes * (lanes * most);
  for (int next = warp * groups; next < total; next += step) {
    int at = next + lane() / lanes, begin = 0, length = 0;
    if (at < total) {
      int segment = listed.size ? static_cast<int>(listed.items[at]) : at;
      begin = all.begins[segment];
      int end = all.ends[segment];
      // One that does not lie within the pairs stays as it is.
      length = begin >= 0 && begin < end && end <= all.count ? end - begin : 0;
      if (length > lanes * most) {
        if ((lane() & (lanes - 1)) == 0)
          longer.add(segment);
        length = 0;
      }
      if (length == 0)
        begin = 0;
    }
    auto has = [&](int each) { return ballot(length > lanes * each) != 0; };
    auto sort =
        [&]<int each>(Packed<each, 1> *) __attribute__((always_inline)) {
          sortGroups<lanes, each>(all.keys + begin, all.values + begin, length,
                                  order, places + own, moved + own);
        };
    if constexpr (most == 16)
      if (has(8)) {
        sort(static_cast<Packed<16, 1> *>(nullptr));
        continue;
      }
    if constexpr (most == 16)
      if (has(4)) {
        sort(static_cast<Packed<8, 1> *>(nullptr));
        continue;
      }
    if (has(2))
      sort(static_cast<Packed<4, 1> *>(nullptr));
    else if (ballot(length > 1))
      sort(static_cast<Packed<2, 1> *>(nullptr));
  }
}

/// The segments in a list, or all if there is none.
#define WARP_SEGMENTS(name, lanes, most, blocks)                               \
  WARP_KERNEL(threads, blocks)                                                 \
  void segments_##name(uint32_t *keys, uint32_t *values, int64_t count,        \
                       uint32_t flip, int isFloat, const int32_t *begins,      \
                       const int32_t *ends, int segments, uint32_t *listed,    \
                       uint32_t *items, uint32_t *longer,                      \
                       uint32_t *longerItems) {                                \
    sortShort<lanes, most>({keys, values, count, begins, ends},                \
                           {flip, isFloat != 0}, segments, {listed, items},    \
                           {longer, longerItems});                             \
  }

WARP_SEGMENTS(4, 4, 4, 7)
WARP_SEGMENTS(8, 8, 16, 3)
WARP_SEGMENTS(32, 32, 16, 3)
