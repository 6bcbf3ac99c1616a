//===- device-copy-test.cpp - Strided copies and fills on every device ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "warp/Error.h"

#include <random>

using namespace warp;
using namespace warp::test;

namespace {
class DeviceCopy : public DeviceSuite {
protected:
  void copy(const ArrayDescriptor &dst, const ArrayDescriptor &src, int size) {
    copyArray({&dst, number}, {&src, number}, size);
  }
};
} // namespace

WARP_TEST_DEVICES(DeviceCopy);

TEST_P(DeviceCopy, TransposedAndReversed) {
  Numbers<int> source(number, iota(6)), target(number, 6, -1);
  copy(packed(target.data(), {3, 2}, 4), view(source.data(), {3, 2}, {4, 12}),
       4);
  EXPECT_EQ(target.get(), (std::vector<int>{0, 3, 1, 4, 2, 5}));
  copy(packed(target.data(), {6}, 4), view(source.data() + 5, {6}, {-4}), 4);
  EXPECT_EQ(target.get(), (std::vector<int>{5, 4, 3, 2, 1, 0}));
}

// A view of itself, transposed: the result is as if copied from a duplicate.
TEST_P(DeviceCopy, OverlappingViews) {
  Numbers<int> numbers(number, iota(9));
  copy(packed(numbers.data(), {3, 3}, 4), view(numbers.data(), {3, 3}, {4, 12}),
       4);
  EXPECT_EQ(numbers.get(), (std::vector<int>{0, 3, 6, 1, 4, 7, 2, 5, 8}));
}

// Elements that move along their row, either way: one range of bytes.
TEST_P(DeviceCopy, OverlappingRows) {
  Numbers<int> numbers(number, iota(7));
  copy(packed(numbers.data() + 1, {6}, 4), packed(numbers.data(), {6}, 4), 4);
  EXPECT_EQ(numbers.get(), (std::vector<int>{0, 0, 1, 2, 3, 4, 5}));
  copy(packed(numbers.data(), {4}, 4), packed(numbers.data() + 3, {4}, 4), 4);
  EXPECT_EQ(numbers.get(), (std::vector<int>{2, 3, 4, 5, 3, 4, 5}));
}

// Random shapes, strides with gaps and element sizes against a plain loop.
TEST_P(DeviceCopy, RandomViewsAgreeWithAPlainLoop) {
  std::mt19937 random(7);
  auto upTo = [&](int n) { return static_cast<int>(random() % n); };
  for (int round = 0; round < 2000; ++round) {
    int rank = 1 + upTo(4),
        size = std::vector{1, 2, 3, 4, 8, 12, 16, 36}[upTo(8)];
    std::vector<int> shape(rank), order(rank);
    for (int &extent : shape)
      extent = upTo(12) == 0 ? 0 : 1 + upTo(5);
    std::iota(order.begin(), order.end(), 0);
    auto layOut = [&](int64_t &bytes) {
      std::shuffle(order.begin(), order.end(), random);
      std::vector<int> strides(rank);
      int64_t stride = size;
      for (int d : order) {
        stride += upTo(3) == 0 ? size * upTo(3) : 0;
        strides[d] = static_cast<int>(stride);
        stride *= std::max(1, shape[d]);
      }
      bytes = stride + size;
      return strides;
    };
    int64_t dstBytes, srcBytes;
    std::vector<int> dstStrides = layOut(dstBytes),
                     srcStrides = layOut(srcBytes);
    std::vector<char> expected(dstBytes, '.'), from(srcBytes);
    for (char &c : from)
      c = static_cast<char>(random());
    Numbers<char> source(number, from), target(number, expected);
    int index[4] = {0, 0, 0, 0}, extent[4] = {1, 1, 1, 1};
    std::copy(shape.begin(), shape.end(), extent);
    for (index[0] = 0; index[0] < extent[0]; ++index[0])
      for (index[1] = 0; index[1] < extent[1]; ++index[1])
        for (index[2] = 0; index[2] < extent[2]; ++index[2])
          for (index[3] = 0; index[3] < extent[3]; ++index[3]) {
            int64_t to = 0, at = 0;
            for (int d = 0; d < rank; ++d) {
              to += int64_t(index[d]) * dstStrides[d];
              at += int64_t(index[d]) * srcStrides[d];
            }
            std::copy_n(from.begin() + at, size, expected.begin() + to);
          }
    copy(view(target.data(), shape, dstStrides),
         view(source.data(), shape, srcStrides), size);
    ASSERT_EQ(target.get(), expected) << "round " << round;
  }
}

// Every pairing of packed and strided views, host and device.
TEST_P(DeviceCopy, StridedViewsOfAnyMemory) {
  const std::vector<int> plain{12, 4}, gaps{4, 24};
  for (bool upwards : {false, true})
    for (bool srcStrided : {false, true})
      for (bool dstStrided : {false, true}) {
        int here = upwards ? cpuDevice : number,
            there = upwards ? number : cpuDevice;
        Numbers<int> from(here, iota(24)), to(there, 24);
        ArrayDescriptor src =
            view(from.data(), {4, 3}, srcStrided ? gaps : plain);
        ArrayDescriptor dst =
            view(to.data(), {4, 3}, dstStrided ? gaps : plain);
        copyArray({&dst, there}, {&src, here}, 4);
        std::vector<int> result = to.get();
        for (int i = 0; i < 4; ++i)
          for (int j = 0; j < 3; ++j)
            EXPECT_EQ(result[dstStrided ? i + 6 * j : 3 * i + j],
                      srcStrided ? i + 6 * j : 3 * i + j);
      }
}

TEST_P(DeviceCopy, FillsStridedViews) {
  Numbers<int> numbers(number, 20, -1);
  int value = 5;
  ArrayDescriptor every = view(numbers.data(), {4, 2}, {20, 8}),
                  none = view(numbers.data(), {0, 2}, {20, 8});
  fillArray({&none, number}, &value, 4);
  EXPECT_EQ(numbers.get(), std::vector<int>(20, -1));
  fillArray({&every, number}, &value, 4);
  std::vector<int> back = numbers.get();
  for (int i = 0; i < 20; ++i)
    EXPECT_EQ(back[i], i % 5 == 0 || i % 5 == 2 ? 5 : -1) << i;
}

TEST_P(DeviceCopy, RejectsDifferentShapes) {
  Numbers<int> a(number, 6), b(number, 6);
  try {
    copy(packed(a.data(), {2, 3}, 4), packed(b.data(), {6}, 4), 4);
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Value);
    EXPECT_EQ(error.message,
              "copy expects arrays of one shape, but got (2, 3) and (6,)");
  }
}
