//===- Sort.cpp - Radix sort of pairs on CUDA -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One kernel counts all digits of all keys, then each digit is a pass that
// reads and writes the pairs once (Adinets and Merrill, "Onesweep: a faster
// least significant digit radix sort for GPUs", 2022). A block takes the next
// tile of pairs in their order, publishes how many of each digit it has, and
// finds the rank of each by its digit; the sum over the tiles before it is
// found by looking back at what those published, counts of one tile or sums
// of all up to it. The pairs are put in order in shared memory, so that those
// of a digit are written as neighbours.
//
//===----------------------------------------------------------------------===//

#include "SortKeys.h"

/// How many tiles a thread looks at at once.
static constexpr int lookAt = 8;

/// The published count of a tile for a digit: nothing, its own count, or the
/// sum up to and with it. In the two upper bits.
static constexpr uint32_t published = 1u << 30;
static constexpr uint32_t summed = 2u << 30;
static constexpr uint32_t countMask = published - 1;

//===----------------------------------------------------------------------===//
// Counts
//===----------------------------------------------------------------------===//

template <typename Order, typename Key = typename Order::Key>
static void countDigits(const Key *keys, int64_t count, Order order, int begin,
                        int end, uint32_t *counts) {
  constexpr int most = sizeof(Key);
  WARP_SHARED uint32_t own[most * digits];
  for (int i = 0; i < most; ++i)
    own[i * digits + thread()] = 0;
  syncThreads();
  auto add = [&](Key key) {
    Key bits = order.ordered(key);
    int pass = 0;
    for (int shift = begin; shift < end; shift += digitBits, ++pass) {
      int width = end - shift < digitBits ? end - shift : digitBits;
      int digit = static_cast<int>(bits >> shift) & ((1 << width) - 1);
      __scoped_atomic_fetch_add(&own[pass * digits + digit], 1u,
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_WRKGRP);
    }
  };
  // The loads of several rounds wait for memory together.
  constexpr int ahead = 8;
  int64_t step = static_cast<int64_t>(blocks()) * threads;
  int64_t i = static_cast<int64_t>(block()) * threads + thread();
  for (; i + (ahead - 1) * step < count; i += ahead * step) {
    Key some[ahead];
#pragma unroll
    for (int j = 0; j < ahead; ++j)
      some[j] = keys[i + j * step];
#pragma unroll
    for (int j = 0; j < ahead; ++j)
      add(some[j]);
  }
  for (; i < count; i += step)
    add(keys[i]);
  syncThreads();
  for (int i = 0; i < most; ++i) {
    uint32_t value = own[i * digits + thread()];
    if (value)
      __scoped_atomic_fetch_add(&counts[i * digits + thread()], value,
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
  }
}

/// Finds the starts of the pairs of each digit: one block per pass.
WARP_KERNEL(threads, 1) void sort_starts(uint32_t *counts) {
  counts += block() * digits;
  counts[thread()] = sumBefore(counts[thread()]);
}

//===----------------------------------------------------------------------===//
// One pass
//===----------------------------------------------------------------------===//

namespace {

template <typename Order, typename Value> struct Pass {
  using Key = typename Order::Key;

  const Key *keys;
  const Value *values;
  Key *outKeys;
  Value *outValues;
  int64_t count;
  Order order;
  int shift, width;
  /// Starts of the pairs of each digit.
  const uint32_t *starts;
  /// The next tile to take, and by tile and digit what was published.
  uint32_t *next;
  uint32_t *states;

  int digitOf(Key key) const {
    return static_cast<int>(order.ordered(key) >> shift) & ((1 << width) - 1);
  }
};

} // namespace

/// Publishes of a digit that a tile has `count` pairs, or that the tiles up to
/// it have so many.
static void publish(uint32_t *states, int tile, uint32_t mark, uint32_t count) {
  __scoped_atomic_store_n(
      states + static_cast<int64_t>(tile) * digits + thread(), mark | count,
      __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
}

/// How many pairs of this thread's digit the tiles before `tile` have.
static uint32_t lookBack(const uint32_t *states, int tile) {
  uint32_t before = 0;
  for (int next = tile - 1; next >= 0;) {
    // The loads of several tiles wait for memory together.
    uint32_t seen[lookAt];
#pragma unroll
    for (int i = 0; i < lookAt; ++i)
      seen[i] = next < i ? summed
                         : __scoped_atomic_load_n(
                               states + int64_t(next - i) * digits + thread(),
                               __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
    bool ends = false, waits = false;
#pragma unroll
    for (int i = 0; i < lookAt; ++i) {
      waits |= !(seen[i] & ~countMask);
      if (ends || waits)
        continue;
      before += seen[i] & countMask;
      ends = seen[i] & summed;
      --next;
    }
    if (ends)
      break;
  }
  return before;
}

template <int perThread, typename Order, typename Value>
[[gnu::always_inline]] static inline void
movePairs(const Pass<Order, Value> &pass) {
  using Key = typename Order::Key;
  constexpr int tileLength = threads * perThread;
  // The pairs in order: first keys, then values.
  using Wide = decltype(sizeof(Key) > sizeof(Value) ? Key(0) : Value(0));
  WARP_SHARED Wide sorted[tileLength];
  auto *sortedKeys = reinterpret_cast<Key *>(&sorted[0]);
  auto *sortedValues = reinterpret_cast<Value *>(&sorted[0]);
  // By warp and digit: how many, then where the next one goes in the tile.
  WARP_SHARED uint32_t counts[warps * digits];
  // By digit: where its pairs go, less their place in the tile.
  WARP_SHARED uint32_t places[digits];
  WARP_SHARED uint32_t taken;

  int warp = thread() / warpSize;
  if (thread() == 0)
    taken = __scoped_atomic_fetch_add(pass.next, 1u, __ATOMIC_RELAXED,
                                      __MEMORY_SCOPE_DEVICE);
#pragma unroll
  for (int i = 0; i < warps; ++i)
    counts[i * digits + thread()] = 0;
  syncThreads();
  int tile = static_cast<int>(taken);
  int64_t first = static_cast<int64_t>(tile) * tileLength;
  int valid = pass.count - first < tileLength
                  ? static_cast<int>(pass.count - first)
                  : tileLength;
  int mine = warp * warpSize * perThread + lane();

  Key keys[perThread];
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = mine + i * warpSize;
    // Missing elements at the end go last.
    keys[i] = at < valid ? pass.keys[first + at] : pass.order.last();
  }
  uint32_t *own = counts + warp * digits;
#pragma unroll
  for (int i = 0; i < perThread; ++i)
    __scoped_atomic_fetch_add(own + pass.digitOf(keys[i]), 1u, __ATOMIC_RELAXED,
                              __MEMORY_SCOPE_WRKGRP);
  syncThreads();

  // A thread per digit. Other tiles can count on these long before they move.
  DigitCounts ofDigit(counts);
  uint32_t total = ofDigit.total;
  publish(pass.states, tile, tile == 0 ? summed : published, total);
  uint32_t firstOfDigit = sumBefore(total);
  ofDigit.place(firstOfDigit);
  syncThreads();

  // The place of each pair in the order of the tile.
  Packed<perThread, 16> ranks;
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    launder(keys[i]);
    uint32_t rank = takePlace(own, pass.digitOf(keys[i]));
    ranks.set(i, rank);
    sortedKeys[rank] = keys[i];
  }
  Value values[perThread];
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = mine + i * warpSize;
    values[i] = at < valid ? pass.values[first + at] : Value(0);
  }
  uint32_t before = tile == 0 ? 0 : lookBack(pass.states, tile);
  if (tile != 0)
    publish(pass.states, tile, summed, before + total);
  places[thread()] = pass.starts[thread()] + before - firstOfDigit;
  syncThreads();
  Packed<perThread, digitBits> digitsOf;
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = i * threads + thread();
    Key key = sortedKeys[at];
    uint32_t digit = pass.digitOf(key);
    digitsOf.set(i, digit);
    if (at < valid)
      pass.outKeys[at + places[digit]] = key;
  }
  syncThreads();
#pragma unroll
  for (int i = 0; i < perThread; ++i)
    sortedValues[ranks.get(i)] = values[i];
  syncThreads();
#pragma unroll
  for (int i = 0; i < perThread; ++i) {
    int at = i * threads + thread();
    if (at < valid)
      pass.outValues[at + places[digitsOf.get(i)]] = sortedValues[at];
  }
}

#define WARP_COUNT(name, Order)                                                \
  WARP_KERNEL(threads, 4)                                                      \
  void sort_count_##name(const Order::Key *keys, int64_t count,                \
                         Order::Key flip, int begin, int end,                  \
                         uint32_t *counts) {                                   \
    countDigits<Order>(keys, count, {flip}, begin, end, counts);               \
  }

#define WARP_MOVE(name, Order, Value, perThread)                               \
  WARP_KERNEL(threads, 2)                                                      \
  void sort_move_##name(                                                       \
      const Order::Key *keys, const Value *values, Order::Key *outKeys,        \
      Value *outValues, int64_t count, Order::Key flip, int shift, int width,  \
      const uint32_t *starts, uint32_t *next, uint32_t *states) {              \
    movePairs<perThread, Order, Value>({keys,                                  \
                                        values,                                \
                                        outKeys,                               \
                                        outValues,                             \
                                        count,                                 \
                                        {flip},                                \
                                        shift,                                 \
                                        width,                                 \
                                        starts,                                \
                                        next,                                  \
                                        states});                              \
  }

WARP_COUNT(i32, Integers<uint32_t>)
WARP_COUNT(i64, Integers<uint64_t>)
WARP_COUNT(f32, Floats<uint32_t>)
WARP_COUNT(f64, Floats<uint64_t>)
// Pairs of a thread: what shared memory and registers hold, or fewer.
WARP_MOVE(i32_32, Integers<uint32_t>, uint32_t, 24)
WARP_MOVE(i32_64, Integers<uint32_t>, uint64_t, 18)
WARP_MOVE(i64_32, Integers<uint64_t>, uint32_t, 18)
WARP_MOVE(i64_64, Integers<uint64_t>, uint64_t, 18)
WARP_MOVE(f32_32, Floats<uint32_t>, uint32_t, 24)
WARP_MOVE(f32_64, Floats<uint32_t>, uint64_t, 18)
WARP_MOVE(f64_32, Floats<uint64_t>, uint32_t, 18)
WARP_MOVE(f64_64, Floats<uint64_t>, uint64_t, 18)
WARP_MOVE(i32_32_short, Integers<uint32_t>, uint32_t, 16)
WARP_MOVE(f32_32_short, Floats<uint32_t>, uint32_t, 16)
