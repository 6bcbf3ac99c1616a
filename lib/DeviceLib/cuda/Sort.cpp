//===- Sort.cpp - Radix sort of pairs on CUDA -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One kernel counts all digits of all keys, then each digit is a pass that
// reads and writes the pairs once (Adinets and Merrill, "Onesweep: a faster
// least significant digit radix sort for GPUs", 2022). A block takes the next
// tile of pairs in their order, finds the rank of each by its digit, and
// publishes how many of each digit it has; the sum over the tiles before it is
// found by looking back at what those published, counts of one tile or sums
// of all up to it. The pairs are put in order in shared memory, so that those
// of a digit are written as neighbours.
//
//===----------------------------------------------------------------------===//

#include "Gpu.h"

using namespace gpu;

static constexpr int threads = 256;
static constexpr int warps = threads / warpSize;
static constexpr int digitBits = 8;
static constexpr int digits = 1 << digitBits;
static_assert(digits == threads, "a thread per digit");

/// What a tile has published of a digit: nothing, its own count, or the sum up
/// to and with it. In the two upper bits.
static constexpr uint32_t published = 1u << 30;
static constexpr uint32_t summed = 2u << 30;
static constexpr uint32_t countMask = published - 1;

/// Order of keys: see SequencesCuda.cpp.
enum KeyOrder { unsignedOrder = 0, signedOrder = 1, floatOrder = 2 };

template <typename Key> static Key orderedBits(Key bits, int order) {
  constexpr Key sign = Key(1) << (8 * sizeof(Key) - 1);
  constexpr Key infinity =
      sizeof(Key) == 4 ? Key(0x7f800000u) : Key(0x7ff0000000000000ul);
  if (order == unsignedOrder)
    return bits;
  if (order == signedOrder)
    return bits ^ sign;
  if ((bits & ~sign) > infinity)
    return ~Key(0);
  if (bits == sign)
    return sign;
  return bits & sign ? ~bits : bits | sign;
}

template <typename Key>
static int digitOf(Key bits, int order, int shift, int width) {
  Key digit = orderedBits(bits, order) >> shift;
  return static_cast<int>(digit) & ((1 << width) - 1);
}

//===----------------------------------------------------------------------===//
// Counts
//===----------------------------------------------------------------------===//

template <typename Key>
static void countDigits(const Key *keys, int64_t count, int order, int begin,
                        int end, uint32_t *counts) {
  constexpr int most = sizeof(Key);
  WARP_SHARED uint32_t own[most * digits];
  for (int i = 0; i < most; ++i)
    own[i * digits + thread()] = 0;
  meet();
  int64_t step = static_cast<int64_t>(blocks()) * threads;
  for (int64_t i = static_cast<int64_t>(block()) * threads + thread();
       i < count; i += step) {
    Key bits = orderedBits(keys[i], order);
    int pass = 0;
    for (int shift = begin; shift < end; shift += digitBits, ++pass) {
      int width = end - shift < digitBits ? end - shift : digitBits;
      int digit = static_cast<int>(bits >> shift) & ((1 << width) - 1);
      __scoped_atomic_fetch_add(&own[pass * digits + digit], 1u,
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_WRKGRP);
    }
  }
  meet();
  for (int i = 0; i < most; ++i) {
    uint32_t value = own[i * digits + thread()];
    if (value)
      __scoped_atomic_fetch_add(&counts[i * digits + thread()], value,
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
  }
}

/// The sum of `value` over the threads before this one.
static uint32_t sumBefore(uint32_t value) {
  WARP_SHARED uint32_t sums[warps];
  uint32_t own = sumOfLanes(value);
  int warp = thread() / warpSize;
  if (lane() == warpSize - 1)
    sums[warp] = own;
  meet();
  uint32_t before = 0;
  for (int i = 0; i < warp; ++i)
    before += sums[i];
  return before + own - value;
}

/// Where the pairs of each digit begin: one block per pass.
WARP_KERNEL void sort_starts(uint32_t *counts) {
  counts += block() * digits;
  counts[thread()] = sumBefore(counts[thread()]);
}

//===----------------------------------------------------------------------===//
// One pass
//===----------------------------------------------------------------------===//

namespace {

template <typename Key, typename Value> struct Pass {
  /// Pairs of a thread: what shared memory and registers hold.
  static constexpr int perThread = sizeof(Key) + sizeof(Value) > 12 ? 12 : 16;
  static constexpr int tile = threads * perThread;

  const Key *keys;
  const Value *values;
  Key *outKeys;
  Value *outValues;
  int64_t count;
  int order, shift, width;
  /// Where pairs of each digit begin.
  const uint32_t *starts;
  /// The next tile to take, and by tile and digit what was published.
  uint32_t *next;
  uint32_t *states;
};

} // namespace

/// The lanes whose digit is that of this lane.
static uint32_t lanesWith(int digit) {
  uint32_t lanes = ~0u;
#pragma unroll
  for (int bit = 0; bit < digitBits; ++bit) {
    bool set = digit >> bit & 1;
    uint32_t with = ballot(set);
    lanes &= set ? with : ~with;
  }
  return lanes;
}

/// How many pairs of this thread's digit the tiles before `tile` have.
static uint32_t lookBack(uint32_t *states, int tile, uint32_t own) {
  uint32_t *mine = states + static_cast<int64_t>(tile) * digits + thread();
  auto publish = [&](uint32_t state) {
    __scoped_atomic_store_n(mine, state, __ATOMIC_RELAXED,
                            __MEMORY_SCOPE_DEVICE);
  };
  if (tile == 0) {
    publish(summed | own);
    return 0;
  }
  publish(published | own);
  uint32_t before = 0;
  for (uint32_t *other = mine - digits;;) {
    uint32_t state =
        __scoped_atomic_load_n(other, __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
    if (!(state & ~countMask))
      continue;
    before += state & countMask;
    if (state & summed)
      break;
    other -= digits;
  }
  publish(summed | (before + own));
  return before;
}

template <typename Key, typename Value>
static void movePairs(const Pass<Key, Value> &pass) {
  constexpr int perThread = Pass<Key, Value>::perThread;
  constexpr int tileLength = Pass<Key, Value>::tile;
  // The pairs in order: first keys, then values.
  using Wide = decltype(sizeof(Key) > sizeof(Value) ? Key(0) : Value(0));
  WARP_SHARED Wide sorted[tileLength];
  auto *sortedKeys =
      reinterpret_cast<Key __attribute__((address_space(3))) *>(&sorted[0]);
  auto *sortedValues =
      reinterpret_cast<Value __attribute__((address_space(3))) *>(&sorted[0]);
  // By warp and digit: how many, then how many in the warps before.
  WARP_SHARED uint32_t counts[warps * digits];
  // By digit: where its pairs go, less their place in the tile.
  WARP_SHARED uint32_t places[digits];
  WARP_SHARED uint32_t firsts[digits];
  WARP_SHARED uint32_t taken;

  int warp = thread() / warpSize;
  if (thread() == 0)
    taken = __scoped_atomic_fetch_add(pass.next, 1u, __ATOMIC_RELAXED,
                                      __MEMORY_SCOPE_DEVICE);
#pragma unroll
  for (int i = 0; i < warps; ++i)
    counts[i * digits + thread()] = 0;
  meet();
  int tile = static_cast<int>(taken);
  int64_t first = static_cast<int64_t>(tile) * tileLength;
  int valid = pass.count - first < tileLength
                  ? static_cast<int>(pass.count - first)
                  : tileLength;
  int mine = warp * warpSize * perThread + lane();

  Key keys[perThread];
  int digitsOf[perThread];
  uint32_t ranks[perThread];
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = mine + i * warpSize;
    bool there = at < valid;
    keys[i] = there ? pass.keys[first + at] : Key(0);
    // What is missing at the end goes last.
    digitsOf[i] = there ? digitOf(keys[i], pass.order, pass.shift, pass.width)
                        : digits - 1;
  }
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    uint32_t lanes = lanesWith(digitsOf[i]);
    auto *counter = &counts[warp * digits + digitsOf[i]];
    uint32_t before = *counter;
    ranks[i] = before + __builtin_popcount(lanes & lanesBefore());
    meetWarp();
    if (!(lanes & lanesBefore()))
      *counter = before + __builtin_popcount(lanes);
    meetWarp();
  }
  meet();

  uint32_t total = 0;
#pragma unroll
  for (int i = 0; i < warps; ++i) {
    uint32_t own = counts[i * digits + thread()];
    counts[i * digits + thread()] = total;
    total += own;
  }
  uint32_t firstOfDigit = sumBefore(total);
  firsts[thread()] = firstOfDigit;
  uint32_t start = pass.starts[thread()];
  places[thread()] = start + lookBack(pass.states, tile, total) - firstOfDigit;
  meet();

#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    ranks[i] += counts[warp * digits + digitsOf[i]] + firsts[digitsOf[i]];
    sortedKeys[ranks[i]] = keys[i];
  }
  Value values[perThread];
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = mine + i * warpSize;
    values[i] = at < valid ? pass.values[first + at] : Value(0);
  }
  meet();
  uint32_t targets[perThread];
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = i * threads + thread();
    Key key = sortedKeys[at];
    targets[i] = at + places[digitOf(key, pass.order, pass.shift, pass.width)];
    if (at < valid)
      pass.outKeys[targets[i]] = key;
  }
  meet();
#pragma unroll
  for (int i = 0; i < perThread; ++i)
    sortedValues[ranks[i]] = values[i];
  meet();
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = i * threads + thread();
    if (at < valid)
      pass.outValues[targets[i]] = sortedValues[at];
  }
}

#define WARP_COUNT(name, Key)                                                  \
  WARP_KERNEL void sort_count_##name(const Key *keys, int64_t count,           \
                                     int order, int begin, int end,            \
                                     uint32_t *counts) {                       \
    countDigits<Key>(keys, count, order, begin, end, counts);                  \
  }

#define WARP_MOVE(name, Key, Value)                                            \
  WARP_KERNEL void sort_move_##name(                                           \
      const Key *keys, const Value *values, Key *outKeys, Value *outValues,    \
      int64_t count, int order, int shift, int width, const uint32_t *starts,  \
      uint32_t *next, uint32_t *states) {                                      \
    movePairs<Key, Value>({keys, values, outKeys, outValues, count, order,     \
                           shift, width, starts, next, states});               \
  }

WARP_COUNT(32, uint32_t)
WARP_COUNT(64, uint64_t)
WARP_MOVE(32_32, uint32_t, uint32_t)
WARP_MOVE(32_64, uint32_t, uint64_t)
WARP_MOVE(64_32, uint64_t, uint32_t)
WARP_MOVE(64_64, uint64_t, uint64_t)
