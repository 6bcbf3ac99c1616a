//===- device-memory-test.cpp - Allocation and fills on every device ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "warp/Error.h"
#include "warp/Peers.h"

using namespace warp;
using namespace warp::test;

namespace {
class DeviceMemory : public DeviceSuite {};
} // namespace

WARP_TEST_DEVICES(DeviceMemory);

TEST_P(DeviceMemory, IsDescribed) {
  EXPECT_EQ(device().index, number);
  EXPECT_EQ(device().info.alias, isHost() ? "cpu" : "cuda:0");
  EXPECT_FALSE(device().info.name.empty());
  EXPECT_GT(device().info.smCount, 0);
  auto [free, total] = device().memoryUse();
  EXPECT_GT(free, 0u);
  EXPECT_LE(free, total);
}

TEST_P(DeviceMemory, IsOfTheKindThatWasSaid) {
  for (size_t size : {1, 63, 64, 100000, 9000000}) {
    auto [memory, kind] = device().allocate(size, false, nullptr);
    ASSERT_NE(memory, nullptr);
    EXPECT_EQ(device().kindOf(memory), kind) << size;
    EXPECT_EQ(kind == MemoryKind::Host, isHost());
    device().fill(memory, "x", 1, size, nullptr);
    device().free(memory, size, kind);
  }
  EXPECT_EQ(device().kindOf(nullptr), MemoryKind::Unknown);
  EXPECT_EQ(Buffer(number, 0).data(), nullptr);
}

TEST_P(DeviceMemory, OutOfMemoryNamesRequestAndFree) {
  try {
    Buffer buffer(number, size_t(1) << 46);
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Memory);
    EXPECT_NE(error.message.find("out of memory on '" + device().info.alias +
                                 "', requested 64.0 TiB, free "),
              std::string::npos)
        << error.message;
  }
  EXPECT_NE(Buffer(number, 1000).data(), nullptr);
}

TEST_P(DeviceMemory, IsReachableByItsOwner) {
  Buffer own(number, 64), host(cpuDevice, 64), pinned(cpuDevice, 64, true);
  EXPECT_TRUE(canAccess(number, number, own.data()));
  EXPECT_TRUE(canAccess(number, cpuDevice, pinned.data()));
  EXPECT_TRUE(device().canReach(hostDevice(), pinned.data()));
  EXPECT_EQ(canAccess(number, cpuDevice, host.data()), isHost());
  EXPECT_EQ(canAccess(cpuDevice, number, own.data()), isHost());
}

TEST_P(DeviceMemory, CopiesThereAndBack) {
  for (size_t count : {0, 1, 1000, 1000000}) {
    std::vector<int> numbers = iota(count);
    Numbers<int> first(number, numbers), second(number, count, -1);
    copyMemory(second.data(), number, first.data(), number, count * 4);
    EXPECT_EQ(second.get(), numbers);
  }
}

TEST_P(DeviceMemory, CopiesThroughPinnedMemory) {
  Buffer pinned(cpuDevice, 4000, true);
  EXPECT_TRUE(pinned.pinned());
  std::vector<int> numbers = iota(1000);
  std::memcpy(pinned.data(), numbers.data(), 4000);
  Numbers<int> there(number, 1000, 0);
  upload(there.data(), number, pinned.data(), 4000);
  EXPECT_EQ(there.get(), numbers);
  setMemory(there.data(), number, 0, 4000);
  download(pinned.data(), there.data(), number, 4000);
  device().synchronize();
  EXPECT_EQ(static_cast<int *>(pinned.data())[999], 0);
}

// Bytes behind the last pattern stay.
TEST_P(DeviceMemory, FillsPatternsOfAnySize) {
  for (size_t size : {1, 2, 3, 4, 5, 6, 8, 12, 16, 36, 100, 5000})
    for (size_t count : {0, 1, 2, 7, 1000, 50000}) {
      std::string pattern(size, 0);
      std::iota(pattern.begin(), pattern.end(), 3);
      if (size == 8)
        pattern = "abcdabcd";
      size_t bytes = size * count;
      if (bytes > size_t(20) << 20)
        continue;
      Numbers<char> memory(number, bytes + 8, '#');
      fillMemory(memory.data(), number, pattern.data(), size, count);
      std::vector<char> back = memory.get();
      std::string text(back.begin(), back.end());
      for (size_t i = 0; i < count; ++i)
        ASSERT_EQ(text.compare(i * size, size, pattern), 0) << size << " " << i;
      EXPECT_EQ(text.substr(bytes), "########");
    }
}

TEST_P(DeviceMemory, InitialisesWhileAGraphIsCaptured) {
  std::vector<int> contents = iota(100);
  Numbers<int> zeros(number, 100, 7), written(number, 100, 7);
  std::unique_ptr<Capture> capture = Capture::begin(number);
  clearNewMemory(zeros.data(), number, 400);
  writeNewMemory(written.data(), number, contents.data(), 400);
  clearNewMemory(nullptr, number, 0);
  EXPECT_EQ(capture->end()->size(), 0u);
  EXPECT_EQ(zeros.get(), std::vector<int>(100));
  EXPECT_EQ(written.get(), contents);
}

TEST(Device, MissingNumbersAreErrors) {
  for (int number : {cudaDeviceCount() + 3, -2})
    try {
      deviceAt(number);
      FAIL();
    } catch (const Error &error) {
      EXPECT_EQ(error.kind, Error::Kind::Runtime);
      EXPECT_EQ(error.message.rfind("no device 'cuda:", 0), 0u);
    }
}
