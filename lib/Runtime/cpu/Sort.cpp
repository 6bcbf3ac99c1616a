//===- Sort.cpp - Radix sorts and runs on the CPU -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A radix sort moves the pairs once per digit of 8 bits, from the lowest, to
// and fro between the two halves of their memory. Digits that all keys share
// are found by counting all of them beforehand and cost no move. For a move by
// several threads the pairs are cut into parts; each counts its digits, learns
// where its pairs of each digit begin, and moves them in their order: the sort
// is stable and its result the same for any number of parts.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "GraphImpl.h"
#include "warp/Error.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

using namespace warp;

static constexpr int radixBits = 8;
static constexpr int radix = 1 << radixBits;
/// Pairs that are sorted by insertion, and that are worth a thread.
static constexpr int64_t fewPairs = 48;
static constexpr int64_t partLength = 32768;

/// Bits of a key as an unsigned number of the same order.
template <typename Key> static auto orderedBits(Key key) {
  using Bits = std::conditional_t<sizeof(Key) == 4, uint32_t, uint64_t>;
  constexpr Bits sign = Bits(1) << (8 * sizeof(Key) - 1);
  auto bits = std::bit_cast<Bits>(key);
  if constexpr (std::is_floating_point_v<Key>) {
    if (key != key)
      return static_cast<Bits>(~Bits(0));
    if (bits == sign)
      return sign;
    return static_cast<Bits>(bits & sign ? ~bits : bits | sign);
  } else if constexpr (std::is_signed_v<Key>) {
    return static_cast<Bits>(bits ^ sign);
  } else {
    return bits;
  }
}

namespace {

/// Some of the bits of keys.
struct BitRange {
  int begin, end;

  template <typename Key> auto of(Key key) const {
    auto bits = orderedBits(key);
    constexpr int width = 8 * sizeof(Key);
    bits >>= begin;
    if (end - begin < width)
      bits &= (decltype(bits)(1) << (end - begin)) - 1;
    return bits;
  }
};

using Counts = std::array<int64_t, radix>;

template <typename Key, typename Value> class RadixSort {
public:
  RadixSort(Key *keys, Value *values, Key *otherKeys, Value *otherValues,
            int64_t count, BitRange range)
      : keys(keys), values(values), otherKeys(otherKeys),
        otherValues(otherValues), count(count), range(range),
        passes((range.end - range.begin + radixBits - 1) / radixBits) {}

  void run() {
    if (count <= fewPairs)
      return insert();
    int64_t parts = std::clamp<int64_t>(count / partLength, 1,
                                        int64_t(4) * ThreadPool::size());
    if (ThreadPool::size() == 1)
      parts = 1;
    std::vector<Counts> all = countAll();
    bool moved = false;
    for (int pass = 0; pass < passes; ++pass) {
      if (isShared(all[pass]))
        continue;
      move(pass, parts, all[pass]);
      std::swap(keys, otherKeys);
      std::swap(values, otherValues);
      moved = !moved;
    }
    if (moved)
      copyBack();
  }

private:
  int digit(Key key, int pass) const {
    return static_cast<int>(range.of(key) >> (radixBits * pass)) & (radix - 1);
  }

  void insert() {
    for (int64_t i = 1; i < count; ++i) {
      Key key = keys[i];
      Value value = values[i];
      auto bits = range.of(key);
      int64_t to = i;
      for (; to > 0 && range.of(keys[to - 1]) > bits; --to) {
        keys[to] = keys[to - 1];
        values[to] = values[to - 1];
      }
      keys[to] = key;
      values[to] = value;
    }
  }

  /// How often each digit occurs, for every pass.
  std::vector<Counts> countAll() const {
    std::vector<Counts> counts(passes, Counts{});
    for (int64_t i = 0; i < count; ++i) {
      auto bits = range.of(keys[i]);
      for (int pass = 0; pass < passes; ++pass, bits >>= radixBits)
        ++counts[pass][bits & (radix - 1)];
    }
    return counts;
  }

  bool isShared(const Counts &counts) const {
    return std::find(counts.begin(), counts.end(), count) != counts.end();
  }

  void move(int pass, int64_t parts, const Counts &total) {
    int64_t length = (count + parts - 1) / parts;
    auto endOf = [&](int64_t part) {
      return std::min(count, (part + 1) * length);
    };
    std::vector<Counts> places(parts, Counts{});
    if (parts == 1)
      places[0] = total;
    else
      ThreadPool::parallelFor(0, parts, 1, [&](int64_t begin, int64_t end) {
        for (int64_t part = begin; part < end; ++part)
          for (int64_t i = part * length; i < endOf(part); ++i)
            ++places[part][digit(keys[i], pass)];
      });
    int64_t place = 0;
    for (int i = 0; i < radix; ++i)
      for (Counts &counts : places)
        place += std::exchange(counts[i], place);
    ThreadPool::parallelFor(0, parts, 1, [&](int64_t begin, int64_t end) {
      for (int64_t part = begin; part < end; ++part)
        movePart(pass, part * length, endOf(part), places[part]);
    });
  }

  void movePart(int pass, int64_t begin, int64_t end, Counts &next) {
    for (int64_t i = begin; i < end; ++i) {
      int64_t to = next[digit(keys[i], pass)]++;
      otherKeys[to] = keys[i];
      otherValues[to] = values[i];
    }
  }

  void copyBack() {
    ThreadPool::parallelFor(
        0, count, partLength, [&](int64_t begin, int64_t end) {
          std::copy(keys + begin, keys + end, otherKeys + begin);
          std::copy(values + begin, values + end, otherValues + begin);
        });
  }

  Key *keys;
  Value *values;
  Key *otherKeys;
  Value *otherValues;
  int64_t count;
  BitRange range;
  int passes;
};

} // namespace

//===----------------------------------------------------------------------===//
// Sorts
//===----------------------------------------------------------------------===//

/// Calls `fn` with null pointers of the types of keys and values.
template <typename Fn> static void withTypes(const Pairs &pairs, Fn &&fn) {
  auto withKey = [&](auto *key) {
    if (pairs.valueSize == 4)
      fn(key, static_cast<uint32_t *>(nullptr));
    else
      fn(key, static_cast<uint64_t *>(nullptr));
  };
  switch (pairs.kind) {
  case NumberType::Int32:
    return withKey(static_cast<int32_t *>(nullptr));
  case NumberType::UInt32:
    return withKey(static_cast<uint32_t *>(nullptr));
  case NumberType::Float32:
    return withKey(static_cast<float *>(nullptr));
  case NumberType::Int64:
    return withKey(static_cast<int64_t *>(nullptr));
  case NumberType::UInt64:
    return withKey(static_cast<uint64_t *>(nullptr));
  case NumberType::Float64:
    return withKey(static_cast<double *>(nullptr));
  }
}

static void sortRange(const Pairs &pairs, int64_t begin, int64_t end,
                      BitRange range) {
  withTypes(pairs, [&]<typename Key, typename Value>(Key *, Value *) {
    Key *keys = static_cast<Key *>(pairs.keys) + begin;
    Value *values = static_cast<Value *>(pairs.values) + begin;
    RadixSort<Key, Value>(keys, values, keys + pairs.count,
                          values + pairs.count, end - begin, range)
        .run();
  });
}

bool CpuDevice::sort(const Pairs &pairs, int beginBit, int endBit,
                     const Stream *) {
  size_t bytes = pairs.count * (sizeOf(pairs.kind) + pairs.valueSize);
  recordOrRun(bytes,
              [=] { sortRange(pairs, 0, pairs.count, {beginBit, endBit}); });
  return false;
}

static void checkSegments(const Pairs &pairs, const int32_t *begins,
                          const int32_t *ends, int64_t segments) {
  for (int64_t i = 0; i < segments; ++i)
    if (begins[i] < 0 || begins[i] > ends[i] || ends[i] > pairs.count)
      throw Error(Error::Kind::Value,
                  "Invalid segment range at index " + std::to_string(i) +
                      ": [" + std::to_string(begins[i]) + ", " +
                      std::to_string(ends[i]) + "), expected 0 <= start <= " +
                      "end <= " + std::to_string(pairs.count));
}

static void sortSegmentsOnHost(const Pairs &pairs, const int32_t *begins,
                               const int32_t *ends, int64_t segments) {
  checkSegments(pairs, begins, ends, segments);
  BitRange all{0, 8 * sizeOf(pairs.kind)};
  int64_t most = 0;
  for (int64_t i = 0; i < segments; ++i)
    most = std::max<int64_t>(most, ends[i] - begins[i]);
  auto sortSome = [&](int64_t first, int64_t last) {
    for (int64_t i = first; i < last; ++i)
      if (ends[i] - begins[i] > 1)
        sortRange(pairs, begins[i], ends[i], all);
  };
  // Long segments are sorted by all threads, one after the other.
  if (most > 4 * partLength)
    return sortSome(0, segments);
  int64_t grain = partLength * segments / std::max<int64_t>(1, pairs.count) + 1;
  ThreadPool::parallelFor(0, segments, grain, sortSome);
}

void CpuDevice::sortSegments(const Pairs &pairs, const int32_t *begins,
                             const int32_t *ends, int64_t segments,
                             const Stream *) {
  size_t bytes = pairs.count * (sizeOf(pairs.kind) + pairs.valueSize);
  recordOrRun(bytes,
              [=] { sortSegmentsOnHost(pairs, begins, ends, segments); });
}

//===----------------------------------------------------------------------===//
// Runs
//===----------------------------------------------------------------------===//

template <typename T> static void findRunsOnHost(const Runs &runs) {
  auto *numbers = static_cast<const T *>(runs.numbers);
  auto *runNumbers = static_cast<T *>(runs.runNumbers);
  int64_t parts =
      std::clamp<int64_t>(runs.count / partLength, 1, ThreadPool::size());
  int64_t length = (runs.count + parts - 1) / parts;
  auto endOf = [&](int64_t part) {
    return std::min(runs.count, (part + 1) * length);
  };
  auto isStart = [&](int64_t i) {
    return i == 0 || numbers[i] != numbers[i - 1];
  };
  // The places of the runs of each part; parts begin where runs may go on.
  std::vector<int64_t> places(parts);
  ThreadPool::parallelFor(0, parts, 1, [&](int64_t begin, int64_t end) {
    for (int64_t part = begin; part < end; ++part)
      for (int64_t i = part * length; i < endOf(part); ++i)
        places[part] += isStart(i);
  });
  int64_t total = 0;
  for (int64_t &place : places)
    total += std::exchange(place, total);
  ThreadPool::parallelFor(0, parts, 1, [&](int64_t begin, int64_t end) {
    for (int64_t part = begin; part < end; ++part) {
      int64_t run = places[part];
      int64_t stop = part + 1 < parts ? places[part + 1] : total;
      for (int64_t i = part * length; run < stop; ++run) {
        while (!isStart(i))
          ++i;
        int64_t start = i++;
        while (i < runs.count && !isStart(i))
          ++i;
        runNumbers[run] = numbers[start];
        runs.runLengths[run] = static_cast<int32_t>(i - start);
      }
    }
  });
  *runs.runCount = static_cast<int32_t>(total);
}

void CpuDevice::findRuns(const Runs &runs, const Stream *) {
  recordOrRun(runs.count * (2 * runs.size + 4), [=] {
    runs.size == 4 ? findRunsOnHost<uint32_t>(runs)
                   : findRunsOnHost<uint64_t>(runs);
  });
}
