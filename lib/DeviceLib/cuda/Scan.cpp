//===- Scan.cpp - Prefix sums on CUDA -------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One kernel reads and writes the sequence once. A block makes the prefix sums
// of its tile in registers and publishes the tile's sum; what precedes it is
// found from what the tiles before it published. Merrill and Garland ("Single-
// pass parallel prefix scan with decoupled look-back", 2016) add whatever is
// there when they look; here a sum always has the same shape, so that equal
// input gives equal bits: tiles form groups, of as many as a block has threads,
// the last tile of a group publishes the group's sum, and a tile adds the
// tiles before it in its own group and the one before, and the other groups.
//
//===----------------------------------------------------------------------===//

#include "LaunchShapes.h"
#include "Published.h"

using namespace gpu;
using namespace scanShape;

static constexpr int warps = threads / warpSize;
/// Neighbours that a thread moves at once, 16 bytes.
template <typename T> static constexpr int perThread = 16 / sizeof(T);
template <typename T>
static constexpr int tileLength = threads * perThread<T> * rounds;
/// Tiles of a group.
static constexpr int groupTiles = threads;

namespace {

template <typename T> struct Packet {
  T at[perThread<T>];
};

/// A component of a sequence, from the first element of a tile.
template <typename T> struct Tile {
  const char *in;
  char *out;
  int64_t inStride, outStride;
  /// Elements from here to the end of the sequence, tile or not.
  int64_t count;
  /// Neighbours can be moved at once.
  bool packed;

  /// True if all of the tile is there and neighbours can be moved at once.
  bool isPlain() const { return packed && count >= tileLength<T>; }

  Packet<T> loadPlain(int first) const {
    return __builtin_bit_cast(
        Packet<T>, *reinterpret_cast<const Wide *>(in + first * sizeof(T)));
  }
  void storePlain(int first, const Packet<T> &packet) const {
    *reinterpret_cast<Wide *>(out + first * sizeof(T)) =
        __builtin_bit_cast(Wide, packet);
  }

  Packet<T> load(int first) const {
    Packet<T> packet;
#pragma unroll
    for (int i = 0; i < perThread<T>; ++i)
      packet.at[i] =
          first + i < count
              ? *reinterpret_cast<const T *>(in + (first + i) * inStride)
              : T(0);
    return packet;
  }
  void store(int first, const Packet<T> &packet) const {
#pragma unroll
    for (int i = 0; i < perThread<T>; ++i)
      if (first + i < count)
        *reinterpret_cast<T *>(out + (first + i) * outStride) = packet.at[i];
  }

private:
  using Wide = T __attribute__((ext_vector_type(perThread<T>)));
};

} // namespace

/// The sum that precedes a tile whose sum is `total`; publishes that. There are
/// `tiles` of them, and the sums of groups follow theirs.
template <typename T>
static T sumBeforeTile(uint64_t *sums, int tiles, int tile, T total) {
  constexpr int words = Published<T>::words;
  auto ofTile = [&](int i) {
    return Published<T>(sums + static_cast<int64_t>(i) * words);
  };
  auto ofGroup = [&](int i) { return ofTile(tiles + i); };
  if (thread() == 0)
    ofTile(tile).set(total);
  int group = tile / groupTiles, place = tile % groupTiles;
  // The group before may not be done: its tiles are added, too.
  T inGroup = 0, before = 0;
  for (int i = thread(); i < group - 1; i += threads)
    before += ofGroup(i).get();
  if (group > 0)
    before += ofTile(tile - place - groupTiles + thread()).get();
  if (thread() < place)
    inGroup = ofTile(tile - place + thread()).get();
  before = sumOfBlock<warps>(before + inGroup);
  if (place == groupTiles - 1) {
    inGroup = sumOfBlock<warps>(inGroup);
    if (thread() == 0)
      ofGroup(group).set(inGroup + total);
  }
  return before;
}

template <typename T>
static Tile<T> tileOf(const void *in, int64_t inStride, void *out,
                      int64_t outStride, int64_t count, int index, int row) {
  int64_t first = static_cast<int64_t>(index) * tileLength<T>;
  Tile<T> tile;
  tile.inStride = inStride;
  tile.outStride = outStride;
  tile.in = static_cast<const char *>(in) + first * inStride + row * sizeof(T);
  tile.out = static_cast<char *>(out) + first * outStride + row * sizeof(T);
  tile.count = count - first;
  uint64_t places = reinterpret_cast<uint64_t>(tile.in) |
                    reinterpret_cast<uint64_t>(tile.out);
  tile.packed =
      inStride == sizeof(T) && outStride == sizeof(T) && places % 16 == 0;
  return tile;
}

/// `state` is what tiles and groups publish, by component, zero at first. If
/// there is one tile it is not needed.
template <typename T>
static void scan(const void *in, int64_t inStride, void *out, int64_t outStride,
                 int64_t count, int width, int tiles, uint64_t *state,
                 int inclusive) {
  WARP_SHARED T sums[warps];
  // Blocks begin in their order, so what a tile waits for is on its way.
  int index = block(), row = 0;
  if (width > 1) {
    row = index % width;
    index /= width;
  }
  Tile<T> tile = tileOf<T>(in, inStride, out, outStride, count, index, row);
  int warp = thread() / warpSize;
  int first = warp * (rounds * warpSize * perThread<T>)+lane() * perThread<T>;
  Packet<T> packets[rounds];
  bool isPlain = tile.isPlain();
  if (isPlain) {
#pragma unroll
    for (int i = 0; i < rounds; ++i)
      packets[i] = tile.loadPlain(first + i * warpSize * perThread<T>);
  } else {
#pragma unroll
    for (int i = 0; i < rounds; ++i)
      packets[i] = tile.load(first + i * warpSize * perThread<T>);
  }

  // Sums within the warp, in place.
  T ofWarp = 0;
#pragma unroll
  for (int i = 0; i < rounds; ++i) {
    T own = 0;
#pragma unroll
    for (int j = 0; j < perThread<T>; ++j)
      own += packets[i].at[j];
    T with = sumOfLanes(own);
    T before = shuffleUp(with, 1);
    T sum = ofWarp + (lane() == 0 ? T(0) : before);
#pragma unroll
    for (int j = 0; j < perThread<T>; ++j) {
      T next = sum + packets[i].at[j];
      packets[i].at[j] = inclusive ? next : sum;
      sum = next;
    }
    ofWarp += shuffle(with, warpSize - 1);
  }
  if (lane() == 0)
    sums[warp] = ofWarp;
  syncThreads();
  T before = 0, total = 0;
#pragma unroll
  for (int i = 0; i < warps; ++i) {
    if (i == warp)
      before = total;
    total += sums[i];
  }
  if (tiles > 1) {
    int64_t all = tiles + (tiles + groupTiles - 1) / groupTiles;
    uint64_t *own = state + row * all * Published<T>::words;
    before += sumBeforeTile(own, tiles, index, total);
  }
#pragma unroll
  for (int i = 0; i < rounds; ++i) {
#pragma unroll
    for (int j = 0; j < perThread<T>; ++j)
      packets[i].at[j] += before;
  }
  if (isPlain) {
#pragma unroll
    for (int i = 0; i < rounds; ++i)
      tile.storePlain(first + i * warpSize * perThread<T>, packets[i]);
  } else {
#pragma unroll
    for (int i = 0; i < rounds; ++i)
      tile.store(first + i * warpSize * perThread<T>, packets[i]);
  }
}

#define WARP_SCAN(name, T, blocks)                                             \
  WARP_KERNEL(threads, blocks)                                                 \
  void scan_##name(const void *in, int64_t inStride, void *out,                \
                   int64_t outStride, int64_t count, int width, int tiles,     \
                   uint64_t *state, int inclusive) {                           \
    scan<T>(in, inStride, out, outStride, count, width, tiles, state,          \
            inclusive);                                                        \
  }

WARP_SCAN(u32, uint32_t, 4)
WARP_SCAN(u64, uint64_t, 3)
WARP_SCAN(f32, float, 4)
WARP_SCAN(f64, double, 4)
