//===- TreeHalves.cpp - Median splits of BVH builds, on CUDA --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A segment of the order is a node with all below it. It is halved where half
// of its centers are on either side, along the widest axis of what they bound:
// they are counted in bins along the axis, and those of the bin in the middle
// go to either half, the first ones to the lower. All segments of one size are
// halved together, down to 4096 by `tree_count` and `tree_part`, a block for
// each 4096 places; `tree_halve` does the rest within a block.
//
// A primitive without a center is behind all others, and an absent one behind
// that:
// only the last segment has fewer primitives than places.
//
//===----------------------------------------------------------------------===//

#include "Tree.h"

using namespace gpu;
using namespace tree;

using treeShape::bins, treeShape::chunk, treeShape::each;
static constexpr int threads = treeShape::halvers;
static constexpr int warps = threads / warpSize;

namespace {
/// Bins along the widest axis of bounds; the last one has what has no center.
struct Ruler {
  int axis = 0, count;
  float start, fine;

  Ruler(const uint32_t *bounds, int count) : count(count) {
    float low[3], high[3];
    readBounds(bounds, low, high);
    float extent = 0.5f * high[0] - 0.5f * low[0];
    start = low[0];
    for (int i = 1; i < 3; ++i)
      if (float other = 0.5f * high[i] - 0.5f * low[i]; other > extent) {
        axis = i;
        extent = other;
        start = low[i];
      }
    fine = float(count - 1) / upper(extent, 1e-37f);
  }

  int operator()(Quad center) const {
    if (center[0] != center[0])
      return count - 1;
    float x = axis == 0 ? center[0] : axis == 1 ? center[1] : center[2];
    float at = (0.5f * x - 0.5f * start) * fine;
    return int(lower(upper(at, 0), float(count - 2)));
  }
};

/// The cut of a segment: how many primitives are in bins before the one in
/// the middle, and in that.
struct Cut {
  int bin, less, equal;
};

/// How many primitives come before, in the bins before the middle and in that.
struct Before {
  int less, equal;

  /// The new place of a primitive of a segment, from its start.
  int target(int place, int bin, const Cut &cut, int half) const {
    int low = half - cut.less;
    if (bin < cut.bin)
      return less;
    if (bin == cut.bin)
      return equal < low ? cut.less + equal : half + equal - low;
    return half + cut.equal - low + place - less - equal;
  }
};
} // namespace

/// Numbers of the primitives of two bins, in one word.
static uint32_t packed(int bin, const Cut &cut) {
  return bin < cut.bin ? 1 : bin == cut.bin ? 1u << 16 : 0;
}
static Before unpacked(uint32_t word) {
  return {int(word & 0xffff), int(word >> 16)};
}

/// The sum of `value` over the threads before this one, and over all.
static uint32_t sumBefore(uint32_t value, uint32_t &total) {
  WARP_SHARED uint32_t sums[warps];
  uint32_t own = sumOfLanes(value);
  int warp = thread() / warpSize;
  syncThreads();
  if (lane() == warpSize - 1)
    sums[warp] = own;
  syncThreads();
  if (warp == 0)
    sums[lane()] = sumOfLanes(sums[lane()]);
  syncThreads();
  total = sums[warps - 1];
  return own - value + (warp ? sums[warp - 1] : 0);
}

//===----------------------------------------------------------------------===//
// Segments of more than a block has
//===----------------------------------------------------------------------===//

namespace {
struct Halving {
  const Quad *from;
  Quad *to;
  /// For segments of this size, and for their halves.
  const uint32_t *bounds;
  uint32_t *halves;
  /// For each segment.
  uint32_t *counts;
  /// The next chunk, then for each chunk how many of its primitives are in the
  /// bins up to the middle, plus one.
  uint32_t *states;
  int count, size;

  int segmentOf(int tile) const { return tile / (size / chunk); }
  Ruler ruler(int segment) const {
    return Ruler(bounds + segment * boundsWords, bins);
  }
};
} // namespace

/// Counts primitives in bins.
WARP_KERNEL(threads, 1) void tree_count(Halving all) {
  WARP_SHARED uint32_t counts[bins];
  counts[thread()] = 0;
  syncThreads();
  int segment = all.segmentOf(block());
  Ruler ruler = all.ruler(segment);
#pragma unroll
  for (int i = 0; i < each; ++i) {
    int at = block() * chunk + i * threads + thread();
    if (at < all.count)
      __scoped_atomic_fetch_add(&counts[ruler(all.from[at])], 1u,
                                __ATOMIC_RELAXED, __MEMORY_SCOPE_WRKGRP);
  }
  syncThreads();
  if (uint32_t value = counts[thread()])
    __scoped_atomic_fetch_add(&all.counts[int64_t(segment) * bins + thread()],
                              value, __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
}

/// The bin in which half of a segment's places end; past the last one if there
/// is nothing in the other half.
static Cut findCut(const uint32_t *counts, int half) {
  WARP_SHARED Cut cut;
  uint32_t own = counts[thread()], total;
  int before = int(sumBefore(own, total));
  if (thread() == 0)
    cut = {bins, int(total), 0};
  syncThreads();
  if (before <= half && half < before + int(own))
    cut = {thread(), before, int(own)};
  syncThreads();
  return cut;
}

/// How many primitives of the segment's tiles before this one are in bins up to
/// the middle; tells what this one has.
static Before lookBack(uint32_t *states, int first, int tile, uint32_t own) {
  WARP_SHARED uint32_t sums[2];
  if (thread() < 2)
    sums[thread()] = 0;
  if (thread() == 0)
    __scoped_atomic_store_n(&states[tile], own + 1, __ATOMIC_RELAXED,
                            __MEMORY_SCOPE_DEVICE);
  syncThreads();
  for (int at = first + thread(); at < tile; at += threads) {
    uint32_t seen = 0;
    while (!seen)
      seen = __scoped_atomic_load_n(&states[at], __ATOMIC_RELAXED,
                                    __MEMORY_SCOPE_DEVICE);
    Before of = unpacked(seen - 1);
    __scoped_atomic_fetch_add(&sums[0], uint32_t(of.less), __ATOMIC_RELAXED,
                              __MEMORY_SCOPE_WRKGRP);
    __scoped_atomic_fetch_add(&sums[1], uint32_t(of.equal), __ATOMIC_RELAXED,
                              __MEMORY_SCOPE_WRKGRP);
  }
  syncThreads();
  return {int(sums[0]), int(sums[1])};
}

/// Puts primitives into the halves of their segments, which are bounded.
WARP_KERNEL(threads, 1) void tree_part(Halving all) {
  WARP_SHARED uint32_t bounds[2 * boundsWords];
  WARP_SHARED uint32_t taken;
  if (thread() == 0)
    taken = __scoped_atomic_fetch_add(all.states, 1u, __ATOMIC_RELAXED,
                                      __MEMORY_SCOPE_DEVICE);
  if (thread() < 2 * boundsWords)
    bounds[thread()] = 0;
  syncThreads();
  int tile = int(taken), segment = all.segmentOf(tile), half = all.size / 2;
  Ruler ruler = all.ruler(segment);
  Cut cut = findCut(all.counts + int64_t(segment) * bins, half);
  int first = tile * chunk + each * thread();
  Quad center[each];
  int bin[each];
  uint32_t own = 0, total;
#pragma unroll
  for (int i = 0; i < each; ++i) {
    bin[i] = bins;
    if (first + i >= all.count)
      continue;
    center[i] = all.from[first + i];
    bin[i] = ruler(center[i]);
    own += packed(bin[i], cut);
  }
  uint32_t inTile = sumBefore(own, total);
  int start = segment * all.size;
  Before before = lookBack(all.states + 1, start / chunk, tile, total);
  before.less += unpacked(inTile).less;
  before.equal += unpacked(inTile).equal;
  Box box[2] = {nothing(), nothing()};
#pragma unroll
  for (int i = 0; i < each; ++i) {
    if (first + i >= all.count)
      continue;
    int to = before.target(first + i - start, bin[i], cut, half);
    all.to[start + to] = center[i];
    Before one = unpacked(packed(bin[i], cut));
    before.less += one.less;
    before.equal += one.equal;
    float at[3] = {center[i][0], center[i][1], center[i][2]};
    if (at[0] == at[0]) {
      // Not by an index: boxes are in registers.
      if (to < half)
        box[0].include(at);
      else
        box[1].include(at);
    }
  }
#pragma unroll
  for (int side = 0; side < 2; ++side) {
    box[side].uniteLanes(1, warpSize);
    if (lane() == 0)
      raiseBounds(bounds + side * boundsWords, box[side], raiseShared);
  }
  syncThreads();
  if (thread() < 2 * boundsWords && bounds[thread()])
    raiseGlobal(&all.halves[2 * segment * boundsWords + thread()],
                bounds[thread()]);
}

//===----------------------------------------------------------------------===//
// Within a block
//===----------------------------------------------------------------------===//

/// Segments of this size and less are sorted by counting who is before whom.
static constexpr int fewPlaces = 64;

namespace {
/// The primitives of a chunk: which of them is at the places of a thread, in
/// segments that are halved.
struct Chunk {
  const Quad *from;
  int valid;
  uint32_t *places, *bounds;

  Quad center(uint32_t place) const {
    if (int(place) < valid)
      return from[place];
    return Quad{__builtin_nanf(""), 0, 0, 0};
  }
  /// Reads the centers of a thread's places, and bounds the segments.
  void read(Quad (&center)[each], uint32_t (&place)[each], int size) const {
    for (int i = thread(); i < chunk / size * boundsWords; i += threads)
      bounds[i] = 0;
    syncThreads();
    Box box = nothing();
#pragma unroll
    for (int i = 0; i < each; ++i) {
      place[i] = places[each * thread() + i];
      center[i] = this->center(place[i]);
      float at[3] = {center[i][0], center[i][1], center[i][2]};
      if (at[0] == at[0])
        box.include(at);
    }
    int lanes = size / each < warpSize ? size / each : warpSize;
    box.uniteLanes(1, lanes);
    if (lane() % lanes == 0)
      raiseBounds(boundsOf(size), box, raiseShared);
    syncThreads();
  }
  uint32_t *boundsOf(int size) const {
    return bounds + each * thread() / size * boundsWords;
  }
};
} // namespace

/// Halves segments by bins, of which a segment has as many as places.
static void halveByBins(const Chunk &all, uint32_t *counts, int size) {
  WARP_SHARED Cut cuts[chunk / fewPlaces];
  WARP_SHARED uint32_t starts[chunk / fewPlaces];
  Quad center[each];
  uint32_t place[each];
  for (int i = 0; i < each; ++i)
    counts[i * threads + thread()] = 0;
  all.read(center, place, size);
  Ruler ruler(all.boundsOf(size), size);
  int mine = each * thread(), segment = mine / size, start = segment * size;
  int bin[each];
#pragma unroll
  for (int i = 0; i < each; ++i) {
    bin[i] = ruler(center[i]);
    __scoped_atomic_fetch_add(&counts[start + bin[i]], 1u, __ATOMIC_RELAXED,
                              __MEMORY_SCOPE_WRKGRP);
  }
  syncThreads();
  uint32_t count[each], own = 0, total;
#pragma unroll
  for (int i = 0; i < each; ++i) {
    count[i] = counts[mine + i];
    own += count[i];
  }
  int before = int(sumBefore(own, total)) - start;
#pragma unroll
  for (int i = 0; i < each; ++i) {
    if (before <= size / 2 && size / 2 < before + int(count[i]))
      cuts[segment] = {mine + i - start, before, int(count[i])};
    before += int(count[i]);
  }
  syncThreads();
  Cut cut = cuts[segment];
  own = 0;
#pragma unroll
  for (int i = 0; i < each; ++i)
    own += packed(bin[i], cut);
  uint32_t sum = sumBefore(own, total);
  if (mine == start)
    starts[segment] = sum;
  syncThreads();
  Before rank = unpacked(sum - starts[segment]);
#pragma unroll
  for (int i = 0; i < each; ++i) {
    int to = rank.target(mine + i - start, bin[i], cut, size / 2);
    all.places[start + to] = place[i];
    Before one = unpacked(packed(bin[i], cut));
    rank.less += one.less;
    rank.equal += one.equal;
  }
  syncThreads();
}

/// Sorts segments.
static void halveBySorting(const Chunk &all, uint32_t *words, int size) {
  // Absent primitives have the last numbers, and places in its order.
  constexpr int numbers = ~0u / chunk;
  Quad center[each];
  uint32_t place[each], word[each];
  all.read(center, place, size);
  Ruler ruler(all.boundsOf(size), numbers + 1);
  int mine = each * thread(), segment = mine / size, start = segment * size;
#pragma unroll
  for (int i = 0; i < each; ++i) {
    word[i] = uint32_t(ruler(center[i])) * chunk + (mine + i);
    words[mine + i] = word[i];
  }
  syncThreads();
  int rank[each] = {};
  for (int k = 0; k < size; ++k) {
    // Threads of a warp that are in several segments read of several banks.
    uint32_t other = words[start + ((k + each * segment) & (size - 1))];
#pragma unroll
    for (int i = 0; i < each; ++i)
      rank[i] += other < word[i];
  }
#pragma unroll
  for (int i = 0; i < each; ++i)
    all.places[start + rank[i]] = place[i];
  syncThreads();
}

/// Orders the primitives of a chunk, down to the eight of a block.
WARP_KERNEL(threads, 1)
void tree_halve(const Quad *from, int *order, int count) {
  WARP_SHARED uint32_t places[chunk];
  WARP_SHARED uint32_t words[chunk];
  WARP_SHARED uint32_t bounds[chunk / 16 * boundsWords];
  int first = block() * chunk;
  int valid = count - first < chunk ? count - first : chunk;
  Chunk all{from + first, valid, places, bounds};
  for (int i = thread(); i < chunk; i += threads)
    places[i] = i;
  syncThreads();
  for (int size = chunk; size > 8; size /= 2) {
    // All of them are in the first half.
    if (valid <= size / 2)
      continue;
    if (size > fewPlaces)
      halveByBins(all, words, size);
    else
      halveBySorting(all, words, size);
  }
  for (int i = thread(); i < valid; i += threads) {
    // A cast of an element of a vector would take the first one.
    float number = from[first + places[i]][3];
    order[first + i] = __builtin_bit_cast(int32_t, number);
  }
}
