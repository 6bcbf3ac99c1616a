//===- SortKeys.h - Shared parts of the sorts of a GPU ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The order of keys, and ranks by the digits that a block of threads has.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CUDA_SORTKEYS_H
#define WARP_DEVICELIB_CUDA_SORTKEYS_H

#include "../gpu/Gpu.h"

using namespace gpu;

static constexpr int threads = 256;
static constexpr int warps = threads / warpSize;
static constexpr int digitBits = 8;
static constexpr int digits = 1 << digitBits;
static_assert(digits == threads, "a thread per digit");

/// The bits of integers, signed or not, as an unsigned number of the same
/// order.
template <typename Bits> struct Integers {
  using Key = Bits;
  /// The mask that flips them: the bit of the sign, or nothing.
  Key flip;
  Key ordered(Key bits) const { return bits ^ flip; }
  /// The last of all.
  Key last() const { return ~flip; }
};

/// The same of floats.
template <typename Bits> struct Floats {
  using Key = Bits;
  Key sign;
  Key ordered(Key bits) const {
    constexpr Key infinity =
        sizeof(Key) == 4 ? Key(0x7f800000u) : Key(0x7ff0000000000000ul);
    Key magnitude = bits & ~sign;
    Key result = bits & sign && magnitude ? ~bits : bits | sign;
    return magnitude > infinity ? ~Key(0) : result;
  }
  /// A NaN.
  Key last() const { return ~sign; }
};

/// The sum of `value` over the threads before this one.
inline uint32_t sumBefore(uint32_t value) {
  WARP_SHARED uint32_t sums[warps];
  uint32_t own = sumOfLanes(value);
  int warp = thread() / warpSize;
  if (lane() == warpSize - 1)
    sums[warp] = own;
  syncThreads();
  uint32_t before = 0;
  for (int i = 0; i < warp; ++i)
    before += sums[i];
  return before + own - value;
}

/// Small numbers in few registers: `bits` of 32 for each.
template <int count, int bits> class Packed {
public:
  void set(int i, uint32_t value) {
    int shift = i % each * bits;
    words[i / each] = shift ? words[i / each] | value << shift : value;
  }
  uint32_t get(int i) const {
    return words[i / each] >> (i % each * bits) & ((1u << bits) - 1);
  }

private:
  static constexpr int each = 32 / bits;
  uint32_t words[(count + each - 1) / each];
};

/// The lanes whose digit is that of this lane.
inline uint32_t lanesWith(int digit) {
  uint32_t lanes = ~0u;
#pragma unroll
  for (int bit = 0; bit < digitBits; ++bit) {
    bool set = digit >> bit & 1;
    uint32_t with = ballot(set);
    lanes &= set ? with : ~with;
  }
  return lanes;
}

/// The place of the pair of a lane in a tile; `own` has, by digit, where the
/// next pair of the warp goes.
inline uint32_t takePlace(uint32_t *own, int digit) {
  uint32_t lanes = lanesWith(digit), before = own[digit];
  uint32_t place = before + __builtin_popcount(lanes & lanesBefore());
  syncWarp();
  if (!(lanes & lanesBefore()))
    own[digit] = before + __builtin_popcount(lanes);
  syncWarp();
  return place;
}

/// How many pairs of this thread's digit each warp has in a tile.
class DigitCounts {
public:
  /// The counts, by warp and digit.
  explicit DigitCounts(uint32_t *counts) : counts(counts) {
#pragma unroll
    for (int i = 0; i < warps; ++i) {
      ofWarps[i] = counts[i * digits + thread()];
      total += ofWarps[i];
    }
  }
  /// Puts where they go in their place: from `next` on.
  void place(uint32_t next) {
#pragma unroll
    for (int i = 0; i < warps; ++i) {
      counts[i * digits + thread()] = next;
      next += ofWarps[i];
    }
  }

  uint32_t total = 0;

private:
  uint32_t *counts, ofWarps[warps];
};

#endif // WARP_DEVICELIB_CUDA_SORTKEYS_H
