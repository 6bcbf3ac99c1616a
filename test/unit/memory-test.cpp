//===- memory-test.cpp - Allocation, copies and fills on the host ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Error.h"
#include "warp/Memory.h"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <gtest/gtest.h>
#include <numeric>
#include <random>
#include <string>
#include <unistd.h>
#include <vector>

using namespace warp;

namespace {

ArrayDescriptor view(void *data, std::vector<int> shape,
                     std::vector<int> strides) {
  ArrayDescriptor array;
  array.data = data;
  array.ndim = static_cast<int>(shape.size());
  std::copy(shape.begin(), shape.end(), array.shape);
  std::copy(strides.begin(), strides.end(), array.strides);
  return array;
}

ArrayDescriptor packed(void *data, std::vector<int> shape, int size) {
  std::vector<int> strides(shape.size());
  for (size_t i = shape.size(); i-- > 0; size *= shape[i])
    strides[i] = size;
  return view(data, shape, strides);
}

void copy(const ArrayDescriptor &dst, const ArrayDescriptor &src,
          size_t elementSize) {
  copyArray({&dst, cpuDevice}, {&src, cpuDevice}, elementSize);
}

} // namespace

TEST(Memory, BuffersAreAligned) {
  for (size_t size : {1, 63, 64, 100000, 9000000}) {
    Buffer buffer(cpuDevice, size);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(buffer.data()) % 64, 0u);
    std::memset(buffer.data(), 1, size);
  }
  EXPECT_EQ(Buffer(cpuDevice, 0).data(), nullptr);
}

TEST(Memory, OutOfMemoryNamesRequestAndFree) {
  for (size_t size : {size_t(1) << 46, size_t(1) << 62, ~size_t(0)}) {
    try {
      Buffer buffer(cpuDevice, size);
      FAIL() << "allocated " << size;
    } catch (const Error &error) {
      EXPECT_EQ(error.kind, Error::Kind::Memory);
      EXPECT_NE(error.message.find("out of memory on 'cpu', requested "),
                std::string::npos);
      EXPECT_NE(error.message.find("free "), std::string::npos);
    }
  }
}

TEST(Memory, FillsPatternsOfAnySize) {
  for (size_t size : {1, 2, 3, 4, 5, 8, 12, 16, 36, 100, 5000})
    for (size_t count : {0, 1, 2, 7, 1000, 50000}) {
      std::string pattern(size, 0);
      std::iota(pattern.begin(), pattern.end(), 3);
      std::string memory(size * count + 8, '#');
      fillMemory(memory.data(), cpuDevice, pattern.data(), size, count);
      for (size_t i = 0; i < count; ++i)
        ASSERT_EQ(memory.compare(i * size, size, pattern), 0)
            << size << " " << i;
      EXPECT_EQ(memory.substr(size * count), "########");
    }
}

TEST(Memory, CopyOfOverlappingRangesMoves) {
  std::vector<int> numbers(2000000);
  std::iota(numbers.begin(), numbers.end(), 0);
  copyMemory(numbers.data() + 1, cpuDevice, numbers.data(), cpuDevice,
             (numbers.size() - 1) * 4);
  for (size_t i = 1; i < numbers.size(); ++i)
    ASSERT_EQ(numbers[i], static_cast<int>(i) - 1);
}

TEST(Copy, TransposedAndReversed) {
  std::vector<int> source(6), target(6, -1);
  std::iota(source.begin(), source.end(), 0);
  copy(packed(target.data(), {3, 2}, 4), view(source.data(), {3, 2}, {4, 12}),
       4);
  EXPECT_EQ(target, (std::vector<int>{0, 3, 1, 4, 2, 5}));
  copy(packed(target.data(), {6}, 4), view(source.data() + 5, {6}, {-4}), 4);
  EXPECT_EQ(target, (std::vector<int>{5, 4, 3, 2, 1, 0}));
}

// A view of itself, transposed: the result is as if copied from a duplicate.
TEST(Copy, OverlappingViews) {
  std::vector<int> numbers(9);
  std::iota(numbers.begin(), numbers.end(), 0);
  copy(packed(numbers.data(), {3, 3}, 4), view(numbers.data(), {3, 3}, {4, 12}),
       4);
  EXPECT_EQ(numbers, (std::vector<int>{0, 3, 6, 1, 4, 7, 2, 5, 8}));
}

// Random shapes, strides with gaps and element sizes against a plain loop.
TEST(Copy, RandomViewsAgreeWithAPlainLoop) {
  std::mt19937 random(7);
  auto upTo = [&](int n) { return static_cast<int>(random() % n); };
  for (int round = 0; round < 2000; ++round) {
    int rank = 1 + upTo(4),
        size = std::vector{1, 2, 3, 4, 8, 12, 16, 36}[upTo(8)];
    std::vector<int> shape(rank), order(rank);
    for (int &extent : shape)
      extent = upTo(12) == 0 ? 0 : 1 + upTo(6);
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
    std::string target(dstBytes, '.'), expected = target, source(srcBytes, 0);
    for (char &c : source)
      c = static_cast<char>(random());
    int index[4] = {0, 0, 0, 0}, extent[4] = {1, 1, 1, 1};
    std::copy(shape.begin(), shape.end(), extent);
    for (index[0] = 0; index[0] < extent[0]; ++index[0])
      for (index[1] = 0; index[1] < extent[1]; ++index[1])
        for (index[2] = 0; index[2] < extent[2]; ++index[2])
          for (index[3] = 0; index[3] < extent[3]; ++index[3]) {
            int64_t to = 0, from = 0;
            for (int d = 0; d < rank; ++d) {
              to += int64_t(index[d]) * dstStrides[d];
              from += int64_t(index[d]) * srcStrides[d];
            }
            expected.replace(to, size, source, from, size);
          }
    copy(view(target.data(), shape, dstStrides),
         view(source.data(), shape, srcStrides), size);
    ASSERT_EQ(target, expected) << "round " << round;
  }
}

TEST(Copy, FillsStridedViews) {
  std::vector<int> numbers(20, -1);
  int value = 5;
  ArrayDescriptor every = view(numbers.data(), {4, 2}, {20, 8});
  fillArray({&every, cpuDevice}, &value, 4);
  for (int i = 0; i < 20; ++i)
    EXPECT_EQ(numbers[i], i % 5 == 0 || i % 5 == 2 ? 5 : -1) << i;
}

TEST(Copy, RejectsDifferentShapes) {
  int a[6], b[6];
  try {
    copy(packed(a, {2, 3}, 4), packed(b, {6}, 4), 4);
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Value);
    EXPECT_EQ(error.message,
              "copy expects arrays of one shape, but got (2, 3) and (6,)");
  }
}

TEST(Device, MissingDeviceIsAnError) {
  EXPECT_EQ(deviceInfo(cpuDevice).alias, "cpu");
  EXPECT_GT(deviceMemory(cpuDevice).second, 0u);
  try {
    deviceInfo(cudaDeviceCount() + 3);
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Runtime);
    EXPECT_EQ(error.message.rfind("no device 'cuda:", 0), 0u);
  }
}

// Run by the test below in a process that has no driver.
TEST(DISABLED_NoCuda, IsAState) {
  EXPECT_EQ(cudaDeviceCount(), 0);
  EXPECT_EQ(cudaDriverVersion(), 0);
  EXPECT_EQ(cudaUnavailableReason().rfind("no CUDA driver: ", 0), 0u);
  Buffer buffer(cpuDevice, 100, true);
  EXPECT_NE(buffer.data(), nullptr);
  EXPECT_FALSE(buffer.pinned());
  synchronizeAll();
  EXPECT_THROW(Buffer(0, 100), Error);
  EXPECT_THROW(Stream(0), Error);
  EXPECT_THROW(currentStream(0), Error);
}

TEST(Device, AbsentDriverIsAState) {
  char self[4096] = {};
  ASSERT_GT(readlink("/proc/self/exe", self, sizeof(self) - 1), 0);
  std::string command = "WARP_CUDA_DRIVER=/nowhere/libcuda.so " +
                        std::string(self) +
                        " --gtest_also_run_disabled_tests"
                        " --gtest_filter='DISABLED_NoCuda.*' --gtest_brief=1";
  EXPECT_EQ(std::system(command.c_str()), 0);
}
