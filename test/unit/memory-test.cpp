//===- memory-test.cpp - Host memory, and processes without a driver ------===//
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
#include <string>
#include <unistd.h>
#include <vector>

using namespace warp;

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

TEST(Memory, CopyOfOverlappingRangesMoves) {
  std::vector<int> numbers(2000000);
  std::iota(numbers.begin(), numbers.end(), 0);
  copyMemory(numbers.data() + 1, cpuDevice, numbers.data(), cpuDevice,
             (numbers.size() - 1) * 4);
  for (size_t i = 1; i < numbers.size(); ++i)
    ASSERT_EQ(numbers[i], static_cast<int>(i) - 1);
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
