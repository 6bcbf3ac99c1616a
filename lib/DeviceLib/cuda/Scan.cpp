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

#include "Gpu.h"

using namespace gpu;

static constexpr int threads = 256;
static constexpr int warps = threads / warpSize;
/// Neighbours that a thread moves at once, and how often.
static constexpr int perThread = 4;
template <typename T> static constexpr int rounds = 32 / sizeof(T);
template <typename T>
static constexpr int tileLength = threads * perThread * rounds<T>;
/// Tiles of a group.
static constexpr int groupTiles = threads;

namespace {

template <typename T> struct Quad {
  T at[perThread];
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

  /// Whether all of the tile is there and neighbours can be moved at once.
  bool isPlain() const { return packed && count >= tileLength<T>; }

  Quad<T> loadPlain(int first) const {
    return __builtin_bit_cast(
        Quad<T>, *reinterpret_cast<const Wide *>(in + first * sizeof(T)));
  }
  void storePlain(int first, const Quad<T> &quad) const {
    *reinterpret_cast<Wide *>(out + first * sizeof(T)) =
        __builtin_bit_cast(Wide, quad);
  }

  Quad<T> load(int first) const {
    Quad<T> quad;
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      quad.at[i] =
          first + i < count
              ? *reinterpret_cast<const T *>(in + (first + i) * inStride)
              : T(0);
    return quad;
  }
  void store(int first, const Quad<T> &quad) const {
#pragma unroll
    for (int i = 0; i < perThread; ++i)
      if (first + i < count)
        *reinterpret_cast<T *>(out + (first + i) * outStride) = quad.at[i];
  }

private:
  using Wide = T __attribute__((ext_vector_type(perThread)));
};

/// A number that one block publishes for others: 32 of its bits per word, with
/// a mark above them. Zero is none.
template <typename T> class Published {
public:
  static constexpr int words = sizeof(T) / 4;

  explicit Published(uint64_t *at) : at(at) {}

  void set(T value) const {
    auto bits = __builtin_bit_cast(Bits, value);
#pragma unroll
    for (int i = 0; i < words; ++i)
      __scoped_atomic_store_n(at + i, bits.at[i] | mark, __ATOMIC_RELAXED,
                              __MEMORY_SCOPE_DEVICE);
  }

  /// Waits for it.
  T get() const {
    Bits bits;
#pragma unroll
    for (int i = 0; i < words; ++i) {
      uint64_t word;
      do {
        word = __scoped_atomic_load_n(at + i, __ATOMIC_RELAXED,
                                      __MEMORY_SCOPE_DEVICE);
      } while (!(word & mark));
      bits.at[i] = static_cast<uint32_t>(word);
    }
    return __builtin_bit_cast(T, bits);
  }

private:
  struct Bits {
    uint32_t at[words];
  };
  static constexpr uint64_t mark = uint64_t(1) << 32;

  uint64_t *at;
};

} // namespace

/// The sum of `value` over all threads, always added in the same order.
template <typename T> static T sumOfBlock(T value) {
  WARP_SHARED T sums[warps];
  T own = sumOfLanes(value);
  if (lane() == warpSize - 1)
    sums[thread() / warpSize] = own;
  meet();
  T total = 0;
#pragma unroll
  for (int i = 0; i < warps; ++i)
    total += sums[i];
  meet();
  return total;
}

/// What precedes a tile whose sum is `total`; publishes that. There are
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
  before = sumOfBlock(before + inGroup);
  if (place == groupTiles - 1) {
    inGroup = sumOfBlock(inGroup);
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
  constexpr int most = perThread * sizeof(T) < 16 ? perThread * sizeof(T) : 16;
  tile.packed =
      inStride == sizeof(T) && outStride == sizeof(T) && places % most == 0;
  return tile;
}

/// `state` is what tiles and groups publish, by component, zero at first. If
/// there is one tile it is not needed.
template <typename T>
static void scan(const void *in, int64_t inStride, void *out, int64_t outStride,
                 int64_t count, int width, int tiles, uint64_t *state,
                 int inclusive) {
  constexpr int rounds = ::rounds<T>;
  WARP_SHARED T sums[warps];
  // Blocks begin in their order, so what a tile waits for is on its way.
  int index = block(), row = 0;
  if (width > 1) {
    row = index % width;
    index /= width;
  }
  Tile<T> tile = tileOf<T>(in, inStride, out, outStride, count, index, row);
  int warp = thread() / warpSize;
  int first = warp * (rounds * warpSize * perThread) + lane() * perThread;
  Quad<T> quads[rounds];
  bool isPlain = tile.isPlain();
  if (isPlain) {
#pragma unroll
    for (int i = 0; i < rounds; ++i)
      quads[i] = tile.loadPlain(first + i * warpSize * perThread);
  } else {
#pragma unroll
    for (int i = 0; i < rounds; ++i)
      quads[i] = tile.load(first + i * warpSize * perThread);
  }

  // Of each quad: what precedes it in its warp.
  T starts[rounds], ofWarp = 0;
#pragma unroll
  for (int i = 0; i < rounds; ++i) {
    T own = 0;
#pragma unroll
    for (int j = 0; j < perThread; ++j)
      own += quads[i].at[j];
    T with = sumOfLanes(own);
    T before = fromBefore(with, 1);
    starts[i] = ofWarp + (lane() == 0 ? T(0) : before);
    ofWarp += fromLane(with, warpSize - 1);
  }
  if (lane() == 0)
    sums[warp] = ofWarp;
  meet();
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
    T sum = before + starts[i];
#pragma unroll
    for (int j = 0; j < perThread; ++j) {
      T with = sum + quads[i].at[j];
      quads[i].at[j] = inclusive ? with : sum;
      sum = with;
    }
  }
  if (isPlain) {
#pragma unroll
    for (int i = 0; i < rounds; ++i)
      tile.storePlain(first + i * warpSize * perThread, quads[i]);
  } else {
#pragma unroll
    for (int i = 0; i < rounds; ++i)
      tile.store(first + i * warpSize * perThread, quads[i]);
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

WARP_SCAN(u32, uint32_t, 3)
WARP_SCAN(u64, uint64_t, 4)
WARP_SCAN(f32, float, 3)
WARP_SCAN(f64, double, 4)
