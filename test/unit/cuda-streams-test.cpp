//===- cuda-streams-test.cpp - Current streams on a fake driver -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Any thread may make another stream the current one of a device and let go of
// the one before while others are about to queue work there.
//
//===----------------------------------------------------------------------===//

#include "Runtime/cuda/Device.h"
#include "warp/Runtime.h"

#include <cstdlib>
#include <gtest/gtest.h>
#include <thread>
#include <vector>

using namespace warp;

static const int chooseDriver = setenv("WARP_CUDA_DRIVER", WARP_FAKE_CUDA, 0);

namespace {
class CurrentStream : public testing::Test {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    if (cudaDeviceCount() == 0)
      GTEST_SKIP() << "needs a driver";
    former = currentStream(0);
  }
  void TearDown() override {
    if (former)
      setCurrentStream(0, former);
  }
  std::shared_ptr<Stream> former;
};
} // namespace

TEST_F(CurrentStream, LivesUntilWorkIsQueued) {
  auto stream = std::make_shared<Stream>(0);
  std::weak_ptr<Stream> alive = stream;
  setCurrentStream(0, std::move(stream));
  {
    QueuedWork work(0, nullptr);
    EXPECT_EQ(work.stream(), alive.lock()->handle());
    setCurrentStream(0, former);
    EXPECT_FALSE(alive.expired());
  }
  EXPECT_TRUE(alive.expired());
}

TEST_F(CurrentStream, WorkOnANamedStreamKeepsNoOther) {
  auto stream = std::make_shared<Stream>(0);
  std::weak_ptr<Stream> alive = stream;
  setCurrentStream(0, std::move(stream));
  Stream named(0);
  QueuedWork work(0, &named);
  EXPECT_EQ(work.stream(), named.handle());
  setCurrentStream(0, former);
  EXPECT_TRUE(alive.expired());
}

TEST_F(CurrentStream, MayBeExchangedByManyThreads) {
  auto work = [] {
    for (int i = 0; i < 200; ++i) {
      setCurrentStream(0, std::make_shared<Stream>(0));
      Buffer buffer(0, 64);
      setMemory(buffer.data(), 0, 1, buffer.size());
      if (i % 50 == 0)
        synchronizeBusyStreams();
    }
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i)
    threads.emplace_back(work);
  for (std::thread &thread : threads)
    thread.join();
}
