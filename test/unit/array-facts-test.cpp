//===- array-facts-test.cpp - Facts of array descriptors ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Array.h"

#include "gtest/gtest.h"

#include <algorithm>
#include <random>

using namespace warp;

namespace {

ArrayDescriptor describe(uint64_t data, std::vector<int32_t> shape,
                         std::vector<int32_t> strides, uint64_t grad = 0) {
  ArrayDescriptor array;
  array.data = reinterpret_cast<void *>(data);
  array.grad = reinterpret_cast<void *>(grad);
  array.ndim = int32_t(shape.size());
  std::copy(shape.begin(), shape.end(), array.shape);
  std::copy(strides.begin(), strides.end(), array.strides);
  return array;
}

bool has(const ArrayDescriptor &array, int32_t fact, size_t elementSize = 4) {
  int32_t facts = arrayFacts(array, elementSize);
  EXPECT_TRUE(facts & arrayKnown);
  EXPECT_EQ(facts & ~arrayFactMask, 0);
  return facts & fact;
}

} // namespace

TEST(ArrayFacts, PackedIsRowMajor) {
  EXPECT_TRUE(has(describe(64, {3, 5}, {20, 4}), arrayPacked));
  EXPECT_FALSE(has(describe(64, {3, 5}, {24, 4}), arrayPacked));
  EXPECT_FALSE(has(describe(64, {3, 5}, {4, 12}), arrayPacked));
  EXPECT_FALSE(has(describe(64, {3, 5}, {20, 4}), arrayPacked, 8));
  // The stride of one element does not matter.
  EXPECT_TRUE(has(describe(64, {1, 5}, {-7, 4}), arrayPacked));
}

TEST(ArrayFacts, AlignmentIsOfDataAndGradient) {
  // 12 bytes are a multiple of 4, 16 and more of 16.
  EXPECT_TRUE(has(describe(68, {3}, {12}), arrayAligned, 12));
  EXPECT_FALSE(has(describe(66, {3}, {12}), arrayAligned, 12));
  EXPECT_TRUE(has(describe(80, {3}, {32}, 96), arrayAligned, 32));
  EXPECT_FALSE(has(describe(72, {3}, {32}, 96), arrayAligned, 32));
  EXPECT_FALSE(has(describe(80, {3}, {32}, 104), arrayAligned, 32));
}

TEST(ArrayFacts, FarRowsAreMultiplesOf2KiBApart) {
  EXPECT_TRUE(has(describe(64, {3, 5}, {4096, 4}), arrayFarRows));
  EXPECT_TRUE(has(describe(64, {3, 5}, {-2048, 4}), arrayFarRows));
  EXPECT_FALSE(has(describe(64, {3, 5}, {2052, 4}), arrayFarRows));
  EXPECT_FALSE(has(describe(64, {1, 5}, {2048, 4}), arrayFarRows));
  EXPECT_FALSE(has(describe(64, {5}, {2048}), arrayFarRows));
}

TEST(ArrayFacts, LongArraysHave2To31Elements) {
  EXPECT_FALSE(has(describe(64, {INT32_MAX}, {0}), arrayLong));
  EXPECT_TRUE(has(describe(64, {1 << 16, 1 << 15}, {0, 0}), arrayLong));
}

// Against the addresses of all elements.
TEST(ArrayFacts, SpanHoldsAllElements) {
  std::mt19937 random(7);
  auto pick = [&](int least, int most) {
    return std::uniform_int_distribution(least, most)(random);
  };
  int spans = 0;
  for (int round = 0; round < 3000; ++round) {
    ArrayDescriptor array = describe(4096, {}, {});
    array.ndim = pick(1, 4);
    int32_t stride = 4;
    for (int d = array.ndim - 1; d >= 0; --d) {
      array.shape[d] = pick(0, 9) ? pick(1, 4) : 0;
      array.strides[d] = pick(0, 5) ? stride : pick(-20, 20);
      stride *= std::max(array.shape[d], 1);
    }
    if (!has(array, arraySpan))
      continue;
    ++spans;
    int64_t lowest = INT64_MAX, highest = INT64_MIN;
    int64_t count = 1;
    for (int d = 0; d < array.ndim; ++d)
      count *= array.shape[d];
    for (int64_t i = 0; i < count; ++i) {
      int64_t rest = i, offset = 0;
      for (int d = array.ndim - 1; d >= 0; rest /= array.shape[d--])
        offset += rest % array.shape[d] * array.strides[d];
      lowest = std::min(lowest, offset);
      highest = std::max(highest, offset + 4);
    }
    int64_t span = int64_t(array.shape[0]) * array.strides[0];
    EXPECT_EQ(span, count ? highest : 0);
    EXPECT_TRUE(!count || lowest == 0);
  }
  EXPECT_GT(spans, 500);
  EXPECT_FALSE(has(describe(0, {3}, {4}), arraySpan));
}

TEST(ArrayFacts, ViewsOfProgramsHaveThem) {
  alignas(16) float data[32], gradient[32];
  int32_t whole = view(data, {4, 8}).descriptor.flags;
  EXPECT_TRUE(whole & arrayPacked && whole & arrayAligned);
  int32_t column = view(data, {4}, {8}).descriptor.flags;
  EXPECT_TRUE(column & arrayKnown && !(column & arrayPacked));
  struct Pair {
    double x, y;
  };
  auto *odd = reinterpret_cast<Pair *>(gradient + 1);
  auto *pairs = reinterpret_cast<Pair *>(data);
  EXPECT_TRUE(view(pairs, {4}).descriptor.flags & arrayAligned);
  EXPECT_FALSE(view(pairs, {4}, {}, odd).descriptor.flags & arrayAligned);
  Array<float> owned(cpuDevice, {8});
  EXPECT_EQ(ArrayArgument<float>(owned).descriptor.flags,
            view(owned.data(), {8}).descriptor.flags);
}
