//===- SortSegments.cpp - Sorts of many short sequences on CUDA -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A segment of up to 128 pairs is sorted by 8 lanes of a warp, one of up to 512
// by a whole warp, in registers: by a network of comparisons (Batcher, "Sorting
// networks and their applications", 1968) of keys with the place of the pair
// behind them, so that equal keys keep their order. What is longer is noted in
// a list. Its segments are for blocks, which take the next one of them and go
// through it once to count all digits and once for each digit, back and forth
// between the pairs and the room behind them.
//
//===----------------------------------------------------------------------===//

#include "SortKeys.h"

namespace {

/// The order of keys, which is found out at run time here: there is much code
/// that does not depend on it.
struct Order {
  uint32_t flip;
  bool isFloat;
  uint32_t ordered(uint32_t bits) const {
    return isFloat ? Floats<uint32_t>{flip}.ordered(bits) : bits ^ flip;
  }
  uint32_t last() const { return ~flip; }
};

/// What all kernels of a sort get.
struct Segments {
  uint32_t *keys, *values;
  int64_t count;
  const int32_t *begins, *ends;
};

/// Numbers of segments, after how many there are.
struct List {
  uint32_t *size, *items;

  void add(uint32_t item) const {
    items[__scoped_atomic_fetch_add(size, 1u, __ATOMIC_RELAXED,
                                    __MEMORY_SCOPE_DEVICE)] = item;
  }
};

} // namespace

//===----------------------------------------------------------------------===//
// In registers
//===----------------------------------------------------------------------===//

/// Compares numbers at a distance, where sequences of `size` are to be in order
/// next, upward and downward in turn; and so on until all are.
template <int lanes, int each, int size, int distance>
[[gnu::always_inline]] static inline void compare(uint64_t (&x)[each]) {
  int first = (lane() & (lanes - 1)) * each;
  // Whether this lane keeps the smaller of two numbers.
  bool smaller = !(first & distance) == !(first & size);
#pragma unroll
  for (int i = 0; i < each; ++i) {
    if constexpr (distance >= each) {
      uint64_t other = fromAcross(x[i], distance / each);
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
/// `places` is memory of the group, as many.
template <int lanes, int each>
[[gnu::always_inline]] static inline void
sortGroups(uint32_t *keys, uint32_t *values, int length, Order order,
           unsigned short *places) {
  int own = lane() & (lanes - 1);
  uint64_t x[each];
#pragma unroll
  for (int i = 0; i < each; ++i) {
    int at = i * lanes + own;
    x[i] = at < length ? uint64_t(order.ordered(keys[at])) << 32 | at : ~0ul;
  }
  sortRegisters<lanes, each>(x);
#pragma unroll
  for (int i = 0; i < each; ++i)
    places[own * each + i] = static_cast<unsigned short>(x[i]);
  meetWarp();
  uint32_t *both[] = {keys, values};
#pragma unroll
  for (uint32_t *all : both) {
    uint32_t moved[each];
#pragma unroll
    for (int i = 0; i < each; ++i) {
      int at = i * lanes + own;
      moved[i] = at < length ? all[places[at]] : 0;
    }
    meetWarp();
#pragma unroll
    for (int i = 0; i < each; ++i) {
      int at = i * lanes + own;
      if (at < length)
        all[at] = moved[i];
    }
  }
  meetWarp();
}

/// Sorts segments of up to `lanes * most` pairs, those in a list or all of
/// `segments`, and lists the others.
template <int lanes, int most>
static void sortShort(const Segments &all, Order order, int segments,
                      List listed, List longer) {
  WARP_SHARED unsigned short places[threads * most];
  constexpr int groups = warpSize / lanes;
  int total = listed.size ? static_cast<int>(*listed.size) : segments;
  int warp = block() * warps + thread() / warpSize;
  int step = blocks() * warps * groups;
  unsigned short *own = places + thread() / lanes * (lanes * most);
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
    }
    auto has = [&](int more) { return ballot(length > more) != 0; };
    auto sort =
        [&]<int each>(Packed<each, 1> *) __attribute__((always_inline)) {
          sortGroups<lanes, each>(all.keys + begin, all.values + begin, length,
                                  order, own);
        };
    if (has(lanes * 8))
      sort(static_cast<Packed<16, 1> *>(nullptr));
    else if (has(lanes * 4))
      sort(static_cast<Packed<8, 1> *>(nullptr));
    else if (has(lanes * 2))
      sort(static_cast<Packed<4, 1> *>(nullptr));
    else if (has(1))
      sort(static_cast<Packed<2, 1> *>(nullptr));
  }
}

//===----------------------------------------------------------------------===//
// By blocks
//===----------------------------------------------------------------------===//

namespace {
/// Pairs in one of two places.
struct Half {
  uint32_t *keys, *values;
};

/// A digit of all pairs of a segment.
struct Digit {
  Order order;
  int shift;
  int operator()(uint32_t key) const {
    return static_cast<int>(order.ordered(key) >> shift) & (digits - 1);
  }
};
} // namespace

static void count(uint32_t *counts, int digit) {
  __scoped_atomic_fetch_add(counts + digit, 1u, __ATOMIC_RELAXED,
                            __MEMORY_SCOPE_WRKGRP);
}

/// Moves the pairs of a segment to where those of this thread's digit go from
/// `to` on.
static void moveSegment(Half from, Half into, int length, Digit digitOf,
                        uint32_t to) {
  constexpr int perThread = 8;
  constexpr int tileLength = threads * perThread;
  WARP_SHARED uint32_t sorted[tileLength];
  // By warp and digit: how many, then where the next one goes in the tile.
  WARP_SHARED uint32_t counts[warps * digits];
  // By digit: where its pairs go, less their place in the tile.
  WARP_SHARED uint32_t places[digits];
  int warp = thread() / warpSize;
  uint32_t *own = counts + warp * digits;
  for (int first = 0; first < length; first += tileLength) {
    int valid = length - first < tileLength ? length - first : tileLength;
    int rounds = (valid + threads - 1) / threads;
    int mine = warp * warpSize * rounds + lane();
#pragma unroll
    for (int i = 0; i < warps; ++i)
      counts[i * digits + thread()] = 0;
    meet();
    uint32_t keys[perThread], values[perThread];
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      if (i >= rounds)
        continue;
      int at = mine + i * warpSize;
      // What is missing at the end goes last.
      bool isThere = at < valid;
      keys[i] = isThere ? from.keys[first + at] : digitOf.order.last();
      values[i] = isThere ? from.values[first + at] : 0;
    }
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      if (i < rounds)
        count(own, digitOf(keys[i]));
    meet();
    uint32_t ofWarps[warps], total = 0;
#pragma unroll
    for (int i = 0; i < warps; ++i) {
      ofWarps[i] = counts[i * digits + thread()];
      total += ofWarps[i];
    }
    uint32_t next = sumBefore(total);
    places[thread()] = to - next;
    to += total;
#pragma unroll
    for (int i = 0; i < warps; ++i) {
      counts[i * digits + thread()] = next;
      next += ofWarps[i];
    }
    meet();
    Packed<perThread, 16> ranks;
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      if (i >= rounds)
        continue;
      int digit = digitOf(keys[i]);
      uint32_t lanes = lanesWith(digit), before = own[digit];
      uint32_t rank = before + __builtin_popcount(lanes & lanesBefore());
      ranks.set(i, rank);
      meetWarp();
      if (!(lanes & lanesBefore()))
        own[digit] = before + __builtin_popcount(lanes);
      meetWarp();
      sorted[rank] = keys[i];
    }
    meet();
    uint32_t targets[perThread];
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      int at = i * threads + thread();
      if (at >= valid)
        continue;
      targets[i] = at + places[digitOf(sorted[at])];
      into.keys[targets[i]] = sorted[at];
    }
    meet();
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      if (i < rounds)
        sorted[ranks.get(i)] = values[i];
    meet();
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      int at = i * threads + thread();
      if (at < valid)
        into.values[targets[i]] = sorted[at];
    }
    meet();
  }
}

static void sortLong(const Segments &all, Order order, List listed,
                     uint32_t *next) {
  constexpr int passes = sizeof(uint32_t);
  WARP_SHARED uint32_t counts[passes * digits];
  WARP_SHARED uint32_t taken;
  while (true) {
    meet();
    if (thread() == 0)
      taken = __scoped_atomic_fetch_add(next, 1u, __ATOMIC_RELAXED,
                                        __MEMORY_SCOPE_DEVICE);
#pragma unroll
    for (int i = 0; i < passes; ++i)
      counts[i * digits + thread()] = 0;
    meet();
    if (taken >= *listed.size)
      return;
    uint32_t segment = listed.items[taken];
    int begin = all.begins[segment], length = all.ends[segment] - begin;
    Half from = {all.keys + begin, all.values + begin};
    Half into = {from.keys + all.count, from.values + all.count};
    for (int i = thread(); i < length; i += threads) {
      uint32_t bits = order.ordered(from.keys[i]);
#pragma unroll
      for (int pass = 0; pass < passes; ++pass)
        count(counts + pass * digits, bits >> (pass * digitBits) & digits - 1);
    }
    meet();
    bool moved = false;
    for (int pass = 0; pass < passes; ++pass) {
      uint32_t own = counts[pass * digits + thread()];
      // A digit that all share moves nothing.
      if (meetAny(own == static_cast<uint32_t>(length)))
        continue;
      moveSegment(from, into, length, Digit{order, pass * digitBits},
                  sumBefore(own));
      Half other = from;
      from = into;
      into = other;
      moved = !moved;
    }
    if (!moved)
      continue;
    for (int i = thread(); i < length; i += threads) {
      into.keys[i] = from.keys[i];
      into.values[i] = from.values[i];
    }
  }
}

WARP_KERNEL(threads, 3)
void segments_few(uint32_t *keys, uint32_t *values, int64_t count,
                  uint32_t flip, int isFloat, const int32_t *begins,
                  const int32_t *ends, int segments, uint32_t *longer,
                  uint32_t *longerItems) {
  sortShort<8, 16>({keys, values, count, begins, ends}, {flip, isFloat != 0},
                   segments, {}, {longer, longerItems});
}

/// Those in a list, or all if there is none.
WARP_KERNEL(threads, 3)
void segments_some(uint32_t *keys, uint32_t *values, int64_t count,
                   uint32_t flip, int isFloat, const int32_t *begins,
                   const int32_t *ends, int segments, uint32_t *listed,
                   uint32_t *items, uint32_t *longer, uint32_t *longerItems) {
  sortShort<32, 16>({keys, values, count, begins, ends}, {flip, isFloat != 0},
                    segments, {listed, items}, {longer, longerItems});
}

WARP_KERNEL(threads, 4)
void segments_many(uint32_t *keys, uint32_t *values, int64_t count,
                   uint32_t flip, int isFloat, const int32_t *begins,
                   const int32_t *ends, uint32_t *listed, uint32_t *items,
                   uint32_t *next) {
  sortLong({keys, values, count, begins, ends}, {flip, isFloat != 0},
           {listed, items}, next);
}
