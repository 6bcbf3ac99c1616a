//===- sequences-test.cpp - Scans, sorts and runs on the host -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Error.h"
#include "warp/Graph.h"
#include "warp/Sequences.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <gtest/gtest.h>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

using namespace warp;

namespace {

/// Lengths around those that blocks, parts and insertion end at.
const int64_t lengths[] = {0, 1, 2, 47, 48, 49, 1000, 16384, 16385, 200001};

template <typename Key> constexpr NumberType typeOf() {
  if constexpr (std::is_same_v<Key, int32_t>)
    return NumberType::Int32;
  else if constexpr (std::is_same_v<Key, uint32_t>)
    return NumberType::UInt32;
  else if constexpr (std::is_same_v<Key, float>)
    return NumberType::Float32;
  else if constexpr (std::is_same_v<Key, int64_t>)
    return NumberType::Int64;
  else if constexpr (std::is_same_v<Key, uint64_t>)
    return NumberType::UInt64;
  else
    return NumberType::Float64;
}

/// Any bits: numbers of all sizes, infinities and NaN of both signs.
template <typename Key> std::vector<Key> anyKeys(int64_t count) {
  std::mt19937_64 random(count);
  std::vector<Key> keys(count);
  for (Key &key : keys) {
    uint64_t bits = random() >> (random() % 64);
    std::memcpy(&key, &bits, sizeof(Key));
  }
  return keys;
}

template <typename Key> bool comesBefore(Key a, Key b) {
  if (a != a || b != b)
    return a == a && b != b;
  return a < b;
}

/// Sorts with the values 0, 1, ... and compares with std::sort.
template <typename Key, typename Value> void checkSort(int64_t count) {
  std::vector<Key> keys = anyKeys<Key>(count), sorted = keys;
  std::vector<Value> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::vector<Value> values = order;
  std::sort(order.begin(), order.end(), [&](Value a, Value b) {
    return comesBefore(keys[a], keys[b]) ||
           (!comesBefore(keys[b], keys[a]) && a < b);
  });
  sorted.resize(2 * count);
  values.resize(2 * count);
  sortPairs(cpuDevice,
            {typeOf<Key>(), sorted.data(), values.data(), sizeof(Value), count},
            0, 8 * sizeof(Key));
  values.resize(count);
  EXPECT_EQ(values, order) << count;
  for (int64_t i = 0; i < count; ++i)
    ASSERT_EQ(std::memcmp(&sorted[i], &keys[order[i]], sizeof(Key)), 0);
}

} // namespace

TEST(Sequences, SortsAreStableAndTotal) {
  for (int64_t count : lengths) {
    checkSort<int32_t, uint32_t>(count);
    checkSort<uint32_t, uint64_t>(count);
    checkSort<float, uint32_t>(count);
    checkSort<int64_t, uint32_t>(count);
    checkSort<uint64_t, uint64_t>(count);
    checkSort<double, uint64_t>(count);
  }
}

TEST(Sequences, ZerosAreEqualAndNaNComesLast) {
  float nan = std::numeric_limits<float>::quiet_NaN();
  float infinity = std::numeric_limits<float>::infinity();
  std::vector<float> keys = {-nan, 0.0f, nan, infinity, -0.0f, -infinity};
  keys.resize(12);
  std::vector<uint32_t> values = {0, 1, 2, 3, 4, 5, 0, 0, 0, 0, 0, 0};
  sortPairs(cpuDevice, {NumberType::Float32, keys.data(), values.data(), 4, 6},
            0, 32);
  values.resize(6);
  EXPECT_EQ(values, (std::vector<uint32_t>{5, 1, 4, 3, 0, 2}));
}

TEST(Sequences, SortsBySomeBits) {
  std::vector<uint32_t> keys = {0x31, 0x12, 0x21, 0x10, 0, 0, 0, 0};
  std::vector<uint32_t> values = {0, 1, 2, 3, 0, 0, 0, 0};
  sortPairs(cpuDevice, {NumberType::UInt32, keys.data(), values.data(), 4, 4},
            4, 6);
  values.resize(4);
  EXPECT_EQ(values, (std::vector<uint32_t>{1, 3, 2, 0}));
}

TEST(Sequences, SegmentsAreSortedAlone) {
  constexpr int32_t count = 300000;
  std::vector<int32_t> keys = anyKeys<int32_t>(count), expected = keys;
  std::vector<int32_t> values(2 * count), begins, ends;
  std::mt19937 random(1);
  for (int32_t begin = 3; begin < count;) {
    int32_t end = std::min<int32_t>(count, begin + random() % 5000);
    begins.push_back(begin);
    ends.push_back(end);
    std::sort(expected.begin() + begin, expected.begin() + end);
    begin = end + random() % 3;
  }
  keys.resize(2 * count);
  Pairs pairs{NumberType::Int32, keys.data(), values.data(), 4, count};
  sortSegments(cpuDevice, pairs, begins.data(), ends.data(), begins.size());
  keys.resize(count);
  EXPECT_EQ(keys, expected);
  ends.back() = count + 1;
  EXPECT_THROW(
      sortSegments(cpuDevice, pairs, begins.data(), ends.data(), begins.size()),
      Error);
}

TEST(Sequences, ScansOfIntegersWrap) {
  for (int64_t count : lengths) {
    std::vector<int32_t> in = anyKeys<int32_t>(count), out(count);
    for (bool inclusive : {false, true}) {
      scanNumbers(cpuDevice, NumberType::Int32, 1, {out.data(), 4},
                  {in.data(), 4}, count, inclusive);
      uint32_t sum = 0;
      for (int64_t i = 0; i < count; ++i) {
        uint32_t with = sum + static_cast<uint32_t>(in[i]);
        ASSERT_EQ(static_cast<uint32_t>(out[i]), inclusive ? with : sum);
        sum = with;
      }
    }
  }
}

TEST(Sequences, ScansOfFloatsAreRoundedOnce) {
  constexpr int64_t count = 100000;
  std::vector<float> numbers(2 * count, 0.1f);
  // Every other number, in place.
  scanNumbers(cpuDevice, NumberType::Float32, 1, {numbers.data(), 8},
              {numbers.data(), 8}, count, true);
  for (int64_t i = 0; i < count; ++i)
    ASSERT_NEAR(numbers[2 * i], double(0.1f) * (i + 1), 1e-7 * (i + 1));
  EXPECT_EQ(numbers[1], 0.1f);
}

TEST(Sequences, RunsOfAnyLength) {
  for (int64_t count : lengths) {
    std::vector<uint64_t> numbers(count), values(count), expected;
    std::vector<int32_t> lengthsFound(count), lengthsExpected;
    std::mt19937 random(count);
    for (int64_t i = 0; i < count; ++i)
      numbers[i] = i == 0 || random() % 9 == 0 ? random() % 4 : numbers[i - 1];
    for (int64_t i = 0; i < count; ++i) {
      if (i == 0 || numbers[i] != numbers[i - 1]) {
        expected.push_back(numbers[i]);
        lengthsExpected.push_back(0);
      }
      ++lengthsExpected.back();
    }
    int32_t runs = -1;
    findRuns(cpuDevice, {8, numbers.data(), count, values.data(),
                         lengthsFound.data(), &runs});
    ASSERT_EQ(runs, static_cast<int32_t>(expected.size()));
    values.resize(runs);
    lengthsFound.resize(runs);
    EXPECT_EQ(values, expected);
    EXPECT_EQ(lengthsFound, lengthsExpected);
  }
}

TEST(Sequences, GraphsRepeatThem) {
  std::vector<int32_t> keys = {3, 1, 2, 0, 0, 0}, values = {0, 1, 2, 0, 0, 0};
  auto capture = Capture::begin(cpuDevice);
  sortPairs(cpuDevice, {NumberType::Int32, keys.data(), values.data(), 4, 3}, 0,
            32);
  scanNumbers(cpuDevice, NumberType::Int32, 1, {keys.data(), 4},
              {keys.data(), 4}, 3, true);
  auto graph = capture->end();
  EXPECT_EQ(keys[0], 3);
  graph->launch();
  EXPECT_EQ(keys[2], 6);
  EXPECT_EQ(values[0], 1);
}
