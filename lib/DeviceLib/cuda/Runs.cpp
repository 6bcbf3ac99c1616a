//===- Runs.cpp - Runs of equal numbers on CUDA ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One kernel reads the numbers once. A block finds where runs begin in its
// tile, publishes how many do and where the last one does, and looks back at
// what the tiles before it published, as scans do: how many runs there are
// before, and where the one begins that goes on. The runs of a tile are put
// side by side in shared memory, so that they are written as neighbours.
//
//===----------------------------------------------------------------------===//

#include "../gpu/Gpu.h"

using namespace gpu;

static constexpr int threads = 256;
static constexpr int warps = threads / warpSize;
/// Neighbours that a thread moves at once, and how often.
static constexpr int perThread = 4;
template <typename T> static constexpr int rounds = 16 / sizeof(T);
template <typename T>
static constexpr int tileLength = threads * perThread * rounds<T>;

namespace {

/// How many runs begin in some tiles, and where the last of those does; that
/// is zero if there is none. Two bits are left in a word for what it is.
struct Found {
  uint32_t count, last;

  static constexpr uint64_t own = uint64_t(1) << 62;
  static constexpr uint64_t summed = uint64_t(2) << 62;

  void publish(uint64_t *at, uint64_t mark) const {
    __scoped_atomic_store_n(at, mark | uint64_t(count) << 31 | last,
                            __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
  }
  static Found read(uint64_t word) {
    constexpr uint32_t mask = ~0u >> 1;
    return {static_cast<uint32_t>(word >> 31) & mask,
            static_cast<uint32_t>(word) & mask};
  }
  /// With what comes later.
  Found with(Found other) const {
    return {count + other.count, other.last > last ? other.last : last};
  }
};

template <typename T> struct Quad {
  T at[perThread];
};

template <typename T> using Wide = T __attribute__((ext_vector_type(4)));

} // namespace

/// The runs of the tiles before this one, for all lanes of a warp.
static Found lookBack(const uint64_t *states, int tile) {
  Found all = {0, 0};
  for (int next = tile - 1; next >= 0; next -= warpSize) {
    int at = next - lane();
    uint64_t word;
    do {
      word = at < 0 ? Found::summed
                    : __scoped_atomic_load_n(states + at, __ATOMIC_RELAXED,
                                             __MEMORY_SCOPE_DEVICE);
    } while (ballot(!(word >> 62)));
    // Nothing counts that is before the last sum.
    uint32_t sums = ballot(word >> 63);
    uint32_t counts = sums ? sums ^ (sums - 1) : ~0u;
    if (counts >> lane() & 1)
      all = all.with(Found::read(word));
    if (sums)
      break;
  }
#pragma unroll
  for (int mask = 1; mask < warpSize; mask *= 2)
    all = all.with({shuffleXor(all.count, mask), shuffleXor(all.last, mask)});
  return all;
}

template <typename T>
static Quad<T> load(const T *numbers, int64_t first, int64_t count,
                    bool packed) {
  if (packed && first + perThread <= count)
    return __builtin_bit_cast(
        Quad<T>, *reinterpret_cast<const Wide<T> *>(numbers + first));
  Quad<T> quad;
#pragma unroll
  for (int i = 0; i < perThread; ++i)
    quad.at[i] = first + i < count ? numbers[first + i] : T(0);
  return quad;
}

/// `states` has a word for each tile, zero at first. `runCount` is the number
/// of runs.
template <typename T>
static void findRuns(const T *numbers, int64_t count, T *runNumbers,
                     uint32_t *runLengths, uint32_t *runCount,
                     uint64_t *states) {
  constexpr int rounds = ::rounds<T>;
  // The runs that begin here: their number, and their places in the tile.
  WARP_SHARED T found[tileLength<T>];
  WARP_SHARED unsigned short starts[tileLength<T>];
  WARP_SHARED uint32_t counts[warps];
  WARP_SHARED uint32_t countBefore, lastBefore;
  // Blocks begin in their order, so what a tile waits for is on its way.
  int tile = block(), warp = thread() / warpSize;
  int64_t first = static_cast<int64_t>(tile) * tileLength<T>;
  int mine = warp * (rounds * warpSize * perThread) + lane() * perThread;
  bool packed = reinterpret_cast<uint64_t>(numbers) % 16 == 0;
  Quad<T> quads[rounds];
#pragma unroll
  for (int i = 0; i < rounds; ++i)
    quads[i] =
        load(numbers, first + mine + i * warpSize * perThread, count, packed);

  // A bit for each number that a run begins with, and what begins before it in
  // the warp.
  uint32_t begins[rounds], before[rounds], ofWarp = 0;
#pragma unroll
  for (int i = 0; i < rounds; ++i) {
    int64_t at = first + mine + i * warpSize * perThread;
    T previous = shuffleUp(quads[i].at[perThread - 1], 1);
    if (i > 0) {
      T last = shuffle(quads[i - 1].at[perThread - 1], warpSize - 1);
      previous = lane() == 0 ? last : previous;
    } else if (lane() == 0) {
      previous = at > 0 && at < count ? numbers[at - 1] : T(0);
    }
    begins[i] = before[i] = 0;
    uint32_t inRound = 0;
#pragma unroll
    for (int j = 0; j < perThread; ++j) {
      bool isFirst =
          at + j < count && (quads[i].at[j] != previous || at + j == 0);
      previous = quads[i].at[j];
      uint32_t lanes = ballot(isFirst);
      begins[i] |= uint32_t(isFirst) << j;
      before[i] += __builtin_popcount(lanes & lanesBefore());
      inRound += __builtin_popcount(lanes);
    }
    before[i] += ofWarp;
    ofWarp += inRound;
  }
  if (lane() == 0)
    counts[warp] = ofWarp;
  syncThreads();
  uint32_t beforeWarp = 0, total = 0;
#pragma unroll
  for (int i = 0; i < warps; ++i) {
    if (i == warp)
      beforeWarp = total;
    total += counts[i];
  }
#pragma unroll
  for (int i = 0; i < rounds; ++i) {
    uint32_t to = beforeWarp + before[i];
#pragma unroll
    for (int j = 0; j < perThread; ++j)
      if (begins[i] >> j & 1) {
        found[to] = quads[i].at[j];
        starts[to++] = mine + i * warpSize * perThread + j;
      }
  }
  syncThreads();

  auto startOf = [&](uint32_t run) {
    return static_cast<uint32_t>(first) + starts[run];
  };
  if (warp == 0) {
    Found own = {total, total ? startOf(total - 1) : 0};
    if (lane() == 0)
      own.publish(states + tile, tile == 0 ? Found::summed : Found::own);
    Found earlier = lookBack(states, tile);
    if (lane() == 0) {
      if (tile > 0)
        earlier.with(own).publish(states + tile, Found::summed);
      countBefore = earlier.count;
      lastBefore = earlier.last;
    }
  }
  syncThreads();
  uint32_t base = countBefore;
  for (uint32_t i = thread(); i < total; i += threads) {
    runNumbers[base + i] = found[i];
    if (i + 1 < total)
      runLengths[base + i] = starts[i + 1] - starts[i];
  }
  // A run ends where the next one begins.
  if (thread() != 0)
    return;
  if (total > 0 && base > 0)
    runLengths[base - 1] = startOf(0) - lastBefore;
  if (tile + 1 < blocks())
    return;
  uint32_t last = total ? startOf(total - 1) : lastBefore;
  runLengths[base + total - 1] = static_cast<uint32_t>(count) - last;
  *runCount = base + total;
}

#define WARP_RUNS(name, T)                                                     \
  WARP_KERNEL(threads, 5)                                                      \
  void runs_##name(const T *numbers, int64_t count, T *runNumbers,             \
                   uint32_t *runLengths, uint32_t *runCount,                   \
                   uint64_t *states) {                                         \
    findRuns<T>(numbers, count, runNumbers, runLengths, runCount, states);     \
  }

WARP_RUNS(u32, uint32_t)
WARP_RUNS(u64, uint64_t)
