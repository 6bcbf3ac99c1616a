//===- Sort.cpp - Radix sorts, segments and runs on CUDA ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Launches of the kernels in lib/DeviceLib/cuda, which Clang has made PTX when
// the library was built. Everything is queued on one stream, temporary memory
// included, so it can be captured. The constants here are those of the
// kernels.
//
//===----------------------------------------------------------------------===//

#include "LibraryKernels.h"
#include "warp/Error.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>

using namespace warp;

static constexpr int threads = 256;
/// Blocks that count radix.
static constexpr int64_t mostCounters = 1024;
static constexpr int radixBits = 8;
static constexpr int radix = 1 << radixBits;
/// The largest count that fits into a status word.
static constexpr int64_t mostPairs = (int64_t(1) << 30) - 1;

template <typename... Args>
static void launch(const QueuedWork &work, const LibraryKernel &kernel,
                   int64_t blocks, int64_t rows, Args... args) {
  launchKernel(work, kernel, blocks, rows, threads, args...);
}

//===----------------------------------------------------------------------===//
// Sorts
//===----------------------------------------------------------------------===//

/// True for floats; the bit to flip is below. See the kernels.
static bool isFloat(NumberType kind) {
  return kind == NumberType::Float32 || kind == NumberType::Float64;
}
static uint64_t signOf(NumberType kind) {
  if (kind == NumberType::UInt32 || kind == NumberType::UInt64)
    return 0;
  return uint64_t(1) << (8 * sizeOf(kind) - 1);
}

SortState::SortState(int device, const Pairs &pairs, int beginBit, int endBit)
    : device(device), pairs(pairs), beginBit(beginBit), endBit(endBit),
      passes(int(ceilDivide(endBit - beginBit, radixBits))),
      counts(int64_t(sizeOf(pairs.kind)) * radix) {
  bool isWide = sizeOf(pairs.kind) + pairs.valueSize > 8;
  tiles = ceilDivide(pairs.count, threads * (isWide ? 18 : 24));
  if (isWide)
    return;
  // With shorter tiles multiprocessors have as much to do as each other, as
  // long as all tiles have room at a time.
  int64_t shorter = ceilDivide(pairs.count, threads * 16);
  isShort = shorter <= 2 * deviceInfo(device).smCount;
  if (isShort)
    tiles = shorter;
}

int64_t SortState::words() const {
  return counts + sizeOf(pairs.kind) + passes * tiles * radix;
}

bool SortState::move(const QueuedWork &work, uint32_t *state) const {
  int keySize = sizeOf(pairs.kind);
  // Kernels for 32 bits read the lower half.
  uint64_t flip = signOf(pairs.kind);
  std::string types = (isFloat(pairs.kind) ? "f" : "i") +
                      std::to_string(8 * keySize) + "_" +
                      std::to_string(8 * pairs.valueSize);
  launch(work, kernelOf(device, "Sort", "sort_starts"), passes, 1, state);
  auto *keys = static_cast<char *>(pairs.keys);
  auto *values = static_cast<char *>(pairs.values);
  char *otherKeys = keys + pairs.count * keySize;
  char *otherValues = values + pairs.count * pairs.valueSize;
  LibraryKernel move = kernelOf(
      device, "Sort", "sort_move_" + types + (isShort ? "_short" : ""));
  uint32_t *heads = state + counts, *statuses = heads + keySize;
  for (int pass = 0; pass < passes; ++pass) {
    int shift = beginBit + pass * radixBits;
    launch(work, move, tiles, 1, keys, values, otherKeys, otherValues,
           pairs.count, flip, shift, std::min(radixBits, endBit - shift),
           state + pass * radix, heads + pass, statuses + pass * tiles * radix);
    std::swap(keys, otherKeys);
    std::swap(values, otherValues);
  }
  return passes % 2 != 0;
}

bool CudaDevice::sort(const Pairs &pairs, int beginBit, int endBit,
                      const Stream *stream) {
  if (pairs.count > mostPairs)
    throw Error(Error::Kind::Value,
                "a sort on CUDA takes at most " + std::to_string(mostPairs) +
                    " pairs, but got " + std::to_string(pairs.count));
  SortState sort(index, pairs, beginBit, endBit);
  Buffer buffer(index, sort.words() * 4, false, stream);
  auto *state = static_cast<uint32_t *>(buffer.data());
  setMemory(state, index, 0, buffer.size(), stream);

  QueuedWork work(index, stream);
  int keySize = sizeOf(pairs.kind);
  std::string key =
      (isFloat(pairs.kind) ? "f" : "i") + std::to_string(8 * keySize);
  int64_t counters =
      std::min(mostCounters, ceilDivide(pairs.count, 4 * threads));
  launch(work, kernelOf(index, "Sort", "sort_count_" + key), counters, 1,
         pairs.keys, pairs.count, signOf(pairs.kind), beginBit, endBit, state);
  return sort.move(work, state);
}

//===----------------------------------------------------------------------===//
// Segments and runs
//===----------------------------------------------------------------------===//

namespace {
/// Kernels that sort segments in registers, by how many lanes share one.
struct SegmentKernel {
  const char *name;
  int64_t lanes, most;
};
} // namespace
static constexpr SegmentKernel segmentKernels[] = {
    {"segments_4", 4, 16}, {"segments_8", 8, 128}, {"segments_32", 32, 512}};
/// Blocks for segments in a list, whose length only the device knows.
static constexpr int64_t listBlocks = 1056;

void CudaDevice::sortSegments(const Pairs &pairs, const int32_t *begins,
                              const int32_t *ends, int64_t segments,
                              const Stream *stream) {
  if (sizeOf(pairs.kind) != 4 || pairs.valueSize != 4)
    throw Error(Error::Kind::Value,
                "a sort of segments on CUDA takes keys and values of 32 bits");
  if (pairs.count > INT32_MAX || segments > INT32_MAX)
    throw Error(Error::Kind::Value,
                "a sort of segments on CUDA takes less than 2^31 pairs");
  if (pairs.count <= 1 || segments <= 0)
    return;
  // How long the lists of the kernels are and how many segments blocks have
  // taken, then the lists; one is written while the one before is read.
  Buffer buffer(index, (4 + 2 * segments) * 4, false, stream);
  auto *sizes = static_cast<uint32_t *>(buffer.data());
  uint32_t *lists[] = {sizes + 4, sizes + 4 + segments};
  setMemory(sizes, index, 0, 16, stream);

  QueuedWork work(index, stream);
  auto queue = [&](const char *code, const char *name, int64_t blocks,
                   auto... args) {
    launch(work, kernelOf(index, code, name), blocks, 1, pairs.keys,
           pairs.values, pairs.count, static_cast<uint32_t>(signOf(pairs.kind)),
           int(isFloat(pairs.kind)), begins, ends, args...);
  };
  uint32_t *listed = nullptr;
  // Segments that the kernels so far may have left.
  int64_t left = segments;
  for (const SegmentKernel &kernel : segmentKernels) {
    // If most are longer, a later one is the first.
    if (!listed && kernel.most < 512 && pairs.count > kernel.most * segments)
      continue;
    int64_t blocks = ceilDivide(left * kernel.lanes, threads);
    queue("SortSegments", kernel.name,
          std::min(blocks, listed ? listBlocks : 1 << 20), int(segments),
          listed, lists[0], sizes, lists[1]);
    if (pairs.count <= kernel.most)
      return;
    left = std::min(segments, pairs.count / (kernel.most + 1));
    listed = sizes++;
    std::swap(lists[0], lists[1]);
  }
  queue("SortLongSegments", "segments_long", std::min(left, listBlocks), listed,
        lists[0], sizes);
}

void CudaDevice::findRuns(const Runs &runs, const Stream *stream) {
  if (runs.count > INT32_MAX)
    throw Error(Error::Kind::Value,
                "a search for runs on CUDA takes less than 2^31 numbers");
  if (runs.count <= 0)
    return;
  // As in the kernel: a thread has 16 numbers of 32 bits, or 8 of 64.
  int64_t tiles = ceilDivide(runs.count, threads * 64 / runs.size);
  Buffer states(index, tiles * 8, false, stream);
  setMemory(states.data(), index, 0, states.size(), stream);
  QueuedWork work(index, stream);
  launch(work,
         kernelOf(index, "Runs", runs.size == 4 ? "runs_u32" : "runs_u64"),
         tiles, 1, runs.numbers, runs.count, runs.runNumbers, runs.runLengths,
         runs.runCount, states.data());
}
