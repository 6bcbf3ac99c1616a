//===- SortLongSegments.cpp - Sorts of sequences by blocks on CUDA --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Blocks take the next segment of a list and go through it once to count all
// digits and once for each digit, back and forth between the pairs and the room
// behind them.
//
//===----------------------------------------------------------------------===//

#include "Segments.h"

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
    syncThreads();
    uint32_t keys[perThread], values[perThread];
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      if (i >= rounds)
        continue;
      int at = mine + i * warpSize;
      // Missing elements at the end go last.
      bool isThere = at < valid;
      keys[i] = isThere ? from.keys[first + at] : digitOf.order.last();
      values[i] = isThere ? from.values[first + at] : 0;
    }
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      if (i < rounds)
        count(own, digitOf(keys[i]));
    syncThreads();
    DigitCounts digit(counts);
    uint32_t before = sumBefore(digit.total);
    places[thread()] = to - before;
    to += digit.total;
    digit.place(before);
    syncThreads();
    Packed<perThread, 16> ranks;
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      if (i >= rounds)
        continue;
      uint32_t rank = takePlace(own, digitOf(keys[i]));
      ranks.set(i, rank);
      sorted[rank] = keys[i];
    }
    syncThreads();
    uint32_t targets[perThread];
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      int at = i * threads + thread();
      if (at >= valid)
        continue;
      targets[i] = at + places[digitOf(sorted[at])];
      into.keys[targets[i]] = sorted[at];
    }
    syncThreads();
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      if (i < rounds)
        sorted[ranks.get(i)] = values[i];
    syncThreads();
#pragma unroll
    for (int i = 0; i < perThread; ++i) {
      int at = i * threads + thread();
      if (at < valid)
        into.values[targets[i]] = sorted[at];
    }
    syncThreads();
  }
}

static void sortLong(const Segments &all, Order order, List listed,
                     uint32_t *next) {
  constexpr int passes = sizeof(uint32_t);
  WARP_SHARED uint32_t counts[passes * digits];
  WARP_SHARED uint32_t taken;
  while (true) {
    syncThreads();
    if (thread() == 0)
      taken = __scoped_atomic_fetch_add(next, 1u, __ATOMIC_RELAXED,
                                        __MEMORY_SCOPE_DEVICE);
#pragma unroll
    for (int i = 0; i < passes; ++i)
      counts[i * digits + thread()] = 0;
    syncThreads();
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
    syncThreads();
    bool moved = false;
    for (int pass = 0; pass < passes; ++pass) {
      uint32_t own = counts[pass * digits + thread()];
      // A digit that all share moves nothing.
      if (syncThreadsOr(own == static_cast<uint32_t>(length)))
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

WARP_KERNEL(threads, 4)
void segments_long(uint32_t *keys, uint32_t *values, int64_t count,
                   uint32_t flip, int isFloat, const int32_t *begins,
                   const int32_t *ends, uint32_t *listed, uint32_t *items,
                   uint32_t *next) {
  sortLong({keys, values, count, begins, ends}, {flip, isFloat != 0},
           {listed, items}, next);
}
