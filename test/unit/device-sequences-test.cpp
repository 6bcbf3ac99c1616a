//===- device-sequences-test.cpp - Scans, sorts, runs on every device -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Results are compared where kernels run; the fake driver takes all calls and
// the tests look at its launches.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "warp/Error.h"
#include "warp/SparseProduct.h"
#include "warp/TreeBuild.h"

#include <algorithm>
#include <limits>
#include <random>

using namespace warp;
using namespace warp::test;

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

class DeviceSequences : public DeviceSuite {
protected:
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
    Numbers<Key> there(number, sorted);
    Numbers<Value> valuesThere(number, values);
    sortPairs(
        number,
        {typeOf<Key>(), there.data(), valuesThere.data(), sizeof(Value), count},
        0, 8 * sizeof(Key));
    sorted = there.get();
    values = valuesThere.get();
    if (!runsKernels())
      return;
    values.resize(count);
    EXPECT_EQ(values, order) << count;
    for (int64_t i = 0; i < count; ++i)
      ASSERT_EQ(std::memcmp(&sorted[i], &keys[order[i]], sizeof(Key)), 0);
  }
};

} // namespace

WARP_TEST_DEVICES(DeviceSequences);

TEST_P(DeviceSequences, SortsAreStableAndTotal) {
  for (int64_t count : lengths) {
    checkSort<int32_t, uint32_t>(count);
    checkSort<uint32_t, uint64_t>(count);
    checkSort<float, uint32_t>(count);
    checkSort<int64_t, uint32_t>(count);
    checkSort<uint64_t, uint64_t>(count);
    checkSort<double, uint64_t>(count);
  }
  // 18 pairs for each of 256 threads.
  if (!runsKernels())
    EXPECT_EQ(lastLaunch(), "(44, 1, 1) x (256, 1, 1)");
}

TEST_P(DeviceSequences, ZerosAreEqualAndNaNComesLast) {
  float nan = std::numeric_limits<float>::quiet_NaN();
  float infinity = std::numeric_limits<float>::infinity();
  std::vector<float> list = {-nan, 0.0f, nan, infinity, -0.0f, -infinity};
  list.resize(12);
  Numbers<float> keys(number, list);
  Numbers<uint32_t> values(number, {0, 1, 2, 3, 4, 5, 0, 0, 0, 0, 0, 0});
  sortPairs(number, {NumberType::Float32, keys.data(), values.data(), 4, 6}, 0,
            32);
  std::vector<uint32_t> found = values.get();
  found.resize(6);
  if (runsKernels())
    EXPECT_EQ(found, (std::vector<uint32_t>{5, 1, 4, 3, 0, 2}));
}

TEST_P(DeviceSequences, SortsBySomeBits) {
  Numbers<uint32_t> keys(number, {0x31, 0x12, 0x21, 0x10, 0, 0, 0, 0}),
      values(number, {0, 1, 2, 3, 0, 0, 0, 0});
  Pairs pairs{NumberType::UInt32, keys.data(), values.data(), 4, 4};
  sortPairs(number, pairs, 4, 4);
  EXPECT_EQ(keys.get()[0], 0x31u);
  // One pass leaves the result behind the pairs, or in their place.
  size_t at = sortPairsAnywhere(number, pairs, 4, 6) ? 4 : 0;
  EXPECT_EQ(at, isHost() ? 0u : 4u);
  std::vector<uint32_t> found = values.get();
  if (runsKernels())
    EXPECT_EQ(std::vector<uint32_t>(&found[at], &found[at + 4]),
              (std::vector<uint32_t>{1, 3, 2, 0}));
}

TEST_P(DeviceSequences, SegmentsAreSortedAlone) {
  constexpr int32_t count = 300000;
  std::vector<int32_t> keys = anyKeys<int32_t>(count), expected = keys;
  std::vector<int32_t> begins, ends;
  std::mt19937 random(1);
  for (int32_t begin = 3; begin < count;) {
    int32_t end = std::min<int32_t>(count, begin + random() % 5000);
    begins.push_back(begin);
    ends.push_back(end);
    std::sort(expected.begin() + begin, expected.begin() + end);
    begin = end + random() % 3;
  }
  keys.resize(2 * count);
  Numbers<int32_t> there(number, keys), values(number, 2 * count),
      from(number, begins), to(number, ends);
  Pairs pairs{NumberType::Int32, there.data(), values.data(), 4, count};
  sortSegments(number, pairs, from.data(), to.data(), 0);
  sortSegments(number, pairs, from.data(), to.data(), begins.size());
  keys = there.get();
  keys.resize(count);
  if (runsKernels())
    EXPECT_EQ(keys, expected);
  int32_t beyond = count + 1;
  upload(to.data() + ends.size() - 1, number, &beyond, 4);
  auto sortAgain = [&] {
    sortSegments(number, pairs, from.data(), to.data(), begins.size());
  };
  // Segments of GPU memory are not known to the host.
  if (isHost())
    EXPECT_THROW(sortAgain(), Error);
  else
    EXPECT_NO_THROW(sortAgain());
}

TEST_P(DeviceSequences, ScansOfIntegersWrap) {
  for (int64_t count : lengths) {
    std::vector<int32_t> in = anyKeys<int32_t>(count);
    Numbers<int32_t> from(number, in), to(number, count);
    for (bool inclusive : {false, true}) {
      scanNumbers(number, NumberType::Int32, 1, {to.data(), 4},
                  {from.data(), 4}, count, inclusive);
      std::vector<int32_t> out = to.get();
      uint32_t sum = 0;
      for (int64_t i = 0; runsKernels() && i < count; ++i) {
        uint32_t with = sum + static_cast<uint32_t>(in[i]);
        ASSERT_EQ(static_cast<uint32_t>(out[i]), inclusive ? with : sum);
        sum = with;
      }
    }
  }
  // 32 numbers for each of 256 threads.
  if (!runsKernels())
    EXPECT_EQ(lastLaunch(), "(25, 1, 1) x (256, 1, 1)");
}

TEST_P(DeviceSequences, ScansOfFloatsKeepTheirPrecision) {
  constexpr int64_t count = 100000;
  Numbers<float> numbers(number, 2 * count, 0.1f);
  // Every other number, in place.
  scanNumbers(number, NumberType::Float32, 1, {numbers.data(), 8},
              {numbers.data(), 8}, count, true);
  std::vector<float> found = numbers.get();
  // The CPU rounds once.
  double unit = isHost() ? 1e-7 : 1e-6;
  for (int64_t i = 0; runsKernels() && i < count; ++i)
    ASSERT_NEAR(found[2 * i], double(0.1f) * (i + 1), unit * (i + 1));
  EXPECT_EQ(found[1], 0.1f);
}

TEST_P(DeviceSequences, RunsOfAnyLength) {
  for (int64_t count : lengths) {
    std::vector<uint64_t> numbers(count), expected;
    std::vector<int32_t> lengthsExpected;
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
    Numbers<uint64_t> from(number, numbers), to(number, count);
    Numbers<int32_t> lengthsThere(number, count), runs(number, 1, -1);
    findRuns(number, {8, from.data(), count, to.data(), lengthsThere.data(),
                      runs.data()});
    int32_t found = runs.get()[0];
    if (!runsKernels() && count > 0)
      continue;
    ASSERT_EQ(found, static_cast<int32_t>(expected.size()));
    std::vector<uint64_t> values = to.get();
    std::vector<int32_t> lengthsFound = lengthsThere.get();
    values.resize(found);
    lengthsFound.resize(found);
    EXPECT_EQ(values, expected);
    EXPECT_EQ(lengthsFound, lengthsExpected);
  }
}

TEST_P(DeviceSequences, GraphsRepeatThem) {
  Numbers<int32_t> keys(number, {3, 1, 2, 0, 0, 0}),
      values(number, {0, 1, 2, 0, 0, 0});
  std::unique_ptr<Capture> capture = Capture::begin(number);
  sortPairs(number, {NumberType::Int32, keys.data(), values.data(), 4, 3}, 0,
            32);
  scanNumbers(number, NumberType::Int32, 1, {keys.data(), 4}, {keys.data(), 4},
              3, true);
  std::shared_ptr<Graph> graph = capture->end();
  EXPECT_GT(graph->size(), 1u);
  EXPECT_EQ(keys.get()[0], 3);
  graph->launch();
  std::vector<int32_t> sums = keys.get(), order = values.get();
  if (!runsKernels())
    return;
  EXPECT_EQ(sums[2], 6);
  EXPECT_EQ(order[0], 1);
}

// y = 2 A x of a diagonal matrix, where the device has that.
TEST_P(DeviceSequences, SparseProductsAreThereOrRefused) {
  Numbers<int32_t> offsets(number, {0, 1, 2, 3}), columns(number, {0, 1, 2});
  Numbers<float> values(number, {1, 2, 3}), x(number, {5, 6, 7}), y(number, 3);
  SparseProduct product{NumberType::Float32,
                        3,
                        3,
                        offsets.data(),
                        columns.data(),
                        values.data(),
                        3,
                        x.data(),
                        y.data(),
                        2.0,
                        0.0};
  if (isHost()) {
    EXPECT_THROW(multiplyRows(number, product), Error);
    return;
  }
  multiplyRows(number, product);
  std::vector<float> found = y.get();
  if (runsKernels())
    EXPECT_EQ(found, (std::vector<float>{10, 24, 42}));
  product.kind = NumberType::Int32;
  EXPECT_THROW(multiplyRows(number, product), Error);
}

TEST_P(DeviceSequences, BuildsOfHierarchiesAreThereOrRefused) {
  std::vector<float> corners(30, 1.0f);
  Numbers<float> lower(number, 30), upper(number, corners), scale(number, 1);
  Numbers<int32_t> found(number, 2);
  TreeShape shape(10);
  Numbers<char> nodes(number, shape.nodes() * TreeShape::nodeBytes),
      blocks(number, shape.blocks * TreeShape::blockBytes(false));
  TreeBuild build{lower.data(), 10,          upper.data(), 10,
                  false,        false,       nodes.data(), blocks.data(),
                  scale.data(), found.data()};
  if (isHost()) {
    EXPECT_THROW(buildTree(number, build), Error);
    return;
  }
  buildTree(number, build);
  refitTree(number, build);
  build.count = 0;
  buildTree(number, build);
  if (runsKernels())
    EXPECT_EQ(found.get()[1], 0);
}
