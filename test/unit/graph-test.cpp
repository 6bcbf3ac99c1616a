//===- graph-test.cpp - Captures and graphs -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The CPU part runs anywhere; the CUDA part runs against the fake driver, or
// on a GPU with WARP_CUDA_DRIVER=libcuda.so.1, like cuda-runtime-test.cpp.
//
//===----------------------------------------------------------------------===//

#include "Runtime/GraphImpl.h"
#include "warp/Runtime.h"

#include <cstdlib>
#include <cstring>
#include <gtest/gtest.h>
#include <stdexcept>
#include <thread>
#include <vector>

using namespace warp;

static const int chooseDriver = setenv("WARP_CUDA_DRIVER", WARP_FAKE_CUDA, 0);

namespace {

using Numbers = std::vector<int>;

Numbers download(const void *data, size_t count) {
  Numbers numbers(count);
  copyMemory(numbers.data(), cpuDevice, data, 0, count * 4);
  synchronizeDevice(0);
  return numbers;
}

class CudaGraphs : public testing::Test {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    if (cudaDeviceCount() == 0)
      GTEST_SKIP() << cudaUnavailableReason();
  }

  void set(Buffer &buffer, int value) {
    fillMemory(buffer.data(), 0, &value, 4, buffer.size() / 4);
  }
};

int *numbersOf(const Buffer &buffer) {
  return static_cast<int *>(buffer.data());
}

} // namespace

//===----------------------------------------------------------------------===//
// CPU
//===----------------------------------------------------------------------===//

TEST(HostGraphs, BelongToTheirThread) {
  Numbers a(3, 1);
  auto capture = Capture::begin(cpuDevice);
  std::thread([&] {
    EXPECT_FALSE(isCapturing(cpuDevice));
    setMemory(a.data(), cpuDevice, 0, 12);
  }).join();
  EXPECT_EQ(a, Numbers(3));
  EXPECT_EQ(capture->end()->size(), 0u);
}

// Functions of the host run at each replay, in order, also from within another
// graph; their exceptions leave the replay.
TEST(HostGraphs, CallFunctionsOfTheHost) {
  Numbers a(2, 1), seen;
  auto capture = Capture::begin(cpuDevice);
  int value = 5;
  fillMemory(a.data(), cpuDevice, &value, 4, 2);
  capture->addHost([&] { seen.push_back(a[1]); }, "look");
  value = 7;
  fillMemory(a.data(), cpuDevice, &value, 4, 2);
  std::shared_ptr<Graph> graph = capture->end();
  EXPECT_EQ(graph->size(), 3u);
  EXPECT_FALSE(graph->isShort());
  EXPECT_EQ(seen, Numbers());
  graph->launch();
  graph->launch();
  EXPECT_EQ(seen, Numbers({5, 5}));
  EXPECT_EQ(a, Numbers({7, 7}));
  auto outer = Capture::begin(cpuDevice);
  graph->launch();
  outer->addHost([] { throw std::runtime_error("stop"); }, "stop");
  std::shared_ptr<Graph> both = outer->end();
  EXPECT_THROW(both->launch(), std::runtime_error);
  EXPECT_EQ(seen.size(), 3u);
}

//===----------------------------------------------------------------------===//
// CUDA
//===----------------------------------------------------------------------===//

TEST_F(CudaGraphs, RefusesToWait) {
  Buffer a(0, 400);
  auto capture = Capture::begin(0);
  set(a, 1);
  EXPECT_THROW(synchronizeDevice(0), Error);
  EXPECT_THROW(currentStream(0)->synchronize(), Error);
  EXPECT_EQ(capture->end()->size(), 1u);
}

TEST_F(CudaGraphs, AllocatesAndFreesInside) {
  Buffer result(0, 400);
  std::shared_ptr<Graph> graph;
  {
    auto capture = Capture::begin(0);
    {
      Buffer temporary(0, 400);
      set(temporary, 8);
      copyMemory(result.data(), 0, temporary.data(), 0, 400);
    }
    graph = capture->end();
  }
  std::vector<std::unique_ptr<Buffer>> others;
  for (int i = 0; i < 10; ++i) {
    others.push_back(std::make_unique<Buffer>(0, 400));
    set(*others.back(), 1);
  }
  graph->launch();
  EXPECT_EQ(download(result.data(), 100), Numbers(100, 8));
  EXPECT_EQ(download(others[0]->data(), 100), Numbers(100, 1));
}

TEST_F(CudaGraphs, OtherStreamsJoin) {
  Buffer a(0, 400), b(0, 400);
  Stream side(0);
  std::shared_ptr<Stream> main = currentStream(0);
  auto capture = Capture::begin(0);
  Event fork(0), join(0);
  fork.record(*main);
  waitEvent(side, fork);
  EXPECT_TRUE(side.isCapturing());
  setMemory(b.data(), 0, 1, 400, &side);
  join.record(side);
  waitEvent(*main, join);
  copyMemory(a.data(), 0, b.data(), 0, 400);
  auto graph = capture->end();
  EXPECT_FALSE(side.isCapturing());
  graph->launch();
  EXPECT_EQ(download(a.data(), 100), Numbers(100, 0x01010101));
}

// Siblings of one fork are joined by each other, and the last by the stream
// that is captured; or by that, one after the other.
TEST_F(CudaGraphs, SiblingsJoinOnAnyWay) {
  for (bool byEachOther : {true, false}) {
    Buffer parts(0, 1200), sums(0, 1200);
    std::vector<std::unique_ptr<Stream>> sides;
    std::vector<std::unique_ptr<Event>> joins;
    std::shared_ptr<Stream> main = currentStream(0);
    auto capture = Capture::begin(0);
    Event fork(0);
    fork.record(*main);
    for (int i = 0; i < 3; ++i) {
      sides.push_back(std::make_unique<Stream>(0));
      waitEvent(*sides[i], fork);
      EXPECT_TRUE(sides[i]->isCapturing());
      setMemory(static_cast<char *>(parts.data()) + 400 * i, 0, i + 1, 400,
                sides[i].get());
    }
    for (int i = 0; i < 3; ++i) {
      joins.push_back(std::make_unique<Event>(0));
      joins[i]->record(*sides[i]);
      bool isLast = i == 2;
      waitEvent(byEachOther && !isLast ? *sides[i + 1] : *main, *joins[i]);
    }
    copyMemory(sums.data(), 0, parts.data(), 0, 1200);
    auto graph = capture->end();
    for (const auto &side : sides)
      EXPECT_FALSE(side->isCapturing());
    graph->launch();
    Numbers found = download(sums.data(), 300);
    for (int i = 0; i < 300; ++i)
      EXPECT_EQ(found[i], 0x01010101 * (i / 100 + 1));
  }
}

// An event says what its stream had done by then. With drivers that tell edges,
// which the fake one does not, a capture ends behind all streams all the same.
TEST_F(CudaGraphs, WorkBehindTheJoinIsNotJoined) {
  if (std::string(getenv("WARP_CUDA_DRIVER")) != WARP_FAKE_CUDA)
    GTEST_SKIP() << "not the fake driver";
  Buffer a(0, 400);
  Stream side(0);
  std::shared_ptr<Stream> main = currentStream(0);
  auto capture = Capture::begin(0);
  Event fork(0), join(0);
  fork.record(*main);
  waitEvent(side, fork);
  setMemory(a.data(), 0, 1, 400, &side);
  join.record(side);
  waitEvent(*main, join);
  setMemory(a.data(), 0, 2, 400, &side);
  EXPECT_THROW(capture->end(), Error);
  EXPECT_FALSE(main->isCapturing());
}

TEST_F(CudaGraphs, StreamsThatDoNotJoinAreAnError) {
  Buffer a(0, 400);
  Stream side(0);
  auto capture = Capture::begin(0);
  Event fork(0);
  fork.record(*currentStream(0));
  waitEvent(side, fork);
  setMemory(a.data(), 0, 1, 400, &side);
  try {
    capture->end();
    FAIL();
  } catch (const Error &error) {
    EXPECT_NE(error.message.find("was not joined"), std::string::npos);
  }
  EXPECT_FALSE(currentStream(0)->isCapturing());
}

TEST_F(CudaGraphs, BranchesAndLoops) {
  if (!supportsConditionalGraphs())
    GTEST_SKIP() << "the driver has no conditional nodes";
  Numbers start = {1, 1, 1, 0, 9};
  Buffer list(0, 20), moved(0, 16), yes(0, 4), no(0, 4);
  set(yes, 0);
  set(no, 0);
  copyMemory(list.data(), 0, start.data(), cpuDevice, 20);
  synchronizeDevice(0);
  auto capture = Capture::begin(0);
  auto loop = capture->addCondition(numbersOf(list), false);
  capture->beginBody(loop, true);
  copyMemory(moved.data(), 0, numbersOf(list) + 1, 0, 16);
  copyMemory(list.data(), 0, moved.data(), 0, 16);
  capture->updateCondition(loop, numbersOf(list), false);
  capture->endBody();
  auto first = capture->addCondition(numbersOf(list), false);
  auto second = capture->addCondition(numbersOf(list), true);
  for (auto [condition, target] : {std::pair(first, &yes), {second, &no}}) {
    capture->beginBody(condition, false);
    set(*target, 1);
    capture->endBody();
  }
  auto graph = capture->end();
  graph->launch();
  EXPECT_EQ(download(list.data(), 5), (Numbers{0, 9, 9, 9, 9}));
  EXPECT_EQ(download(yes.data(), 1), Numbers{0});
  EXPECT_EQ(download(no.data(), 1), Numbers{1});
}

TEST_F(CudaGraphs, AbandonedCapturesLeaveNoTrace) {
  Buffer a(0, 4);
  set(a, 3);
  {
    auto capture = Capture::begin(0);
    set(a, 4);
    if (supportsConditionalGraphs())
      capture->beginBody(capture->addCondition(numbersOf(a), false), true);
    EXPECT_THROW(Capture::begin(0), Error);
  }
  EXPECT_FALSE(isCapturing(0));
  EXPECT_FALSE(currentStream(0)->isCapturing());
  EXPECT_EQ(download(a.data(), 1), Numbers{3});
}

TEST_F(CudaGraphs, ExternalCaptures) {
  EXPECT_THROW(Capture::begin(0, nullptr, CaptureMode::Relaxed, true), Error);
  auto outer = Capture::begin(0);
  auto inner = Capture::begin(0, nullptr, CaptureMode::ThreadLocal, true);
  std::shared_ptr<Graph> theirs = inner->end();
  EXPECT_THROW(theirs->launch(), Error);
  EXPECT_TRUE(currentStream(0)->isCapturing());
  EXPECT_EQ(outer->end()->size(), 0u);
}

TEST_F(CudaGraphs, GraphsInGraphs) {
  Buffer a(0, 400), b(0, 400);
  set(a, 1);
  set(b, 2);
  auto inner = Capture::begin(0);
  copyMemory(a.data(), 0, b.data(), 0, 400);
  std::shared_ptr<Graph> child = inner->end();
  auto outer = Capture::begin(0);
  set(b, 3);
  child->launch();
  set(b, 4);
  std::shared_ptr<Graph> graph = outer->end();
  child.reset();
  EXPECT_EQ(graph->size(), 3u);
  EXPECT_EQ(download(a.data(), 100), Numbers(100, 1));
  graph->launch();
  EXPECT_EQ(download(a.data(), 100), Numbers(100, 3));
}

// A loop with a branch inside, in a graph that is in a branch of another one.
TEST_F(CudaGraphs, GraphsWithBranchesInGraphs) {
  if (!supportsConditionalGraphs())
    GTEST_SKIP() << "the driver has no conditional nodes";
  Numbers start = {1, 1, 1, 0, 9};
  Buffer list(0, 20), moved(0, 16), seen(0, 4), yes(0, 4);
  set(seen, 0);
  set(yes, 1);
  auto inner = Capture::begin(0);
  auto loop = inner->addCondition(numbersOf(list), false);
  inner->beginBody(loop, true);
  copyMemory(moved.data(), 0, numbersOf(list) + 1, 0, 16);
  copyMemory(list.data(), 0, moved.data(), 0, 16);
  inner->beginBody(inner->addCondition(numbersOf(list), true), false);
  copyMemory(seen.data(), 0, numbersOf(list) + 1, 0, 4);
  inner->endBody();
  inner->updateCondition(loop, numbersOf(list), false);
  inner->endBody();
  std::shared_ptr<Graph> first = inner->end();
  auto middle = Capture::begin(0);
  middle->beginBody(middle->addCondition(numbersOf(yes), false), false);
  first->launch();
  middle->endBody();
  std::shared_ptr<Graph> second = middle->end();
  first.reset();
  auto outer = Capture::begin(0);
  second->launch();
  copyMemory(numbersOf(list) + 4, 0, seen.data(), 0, 4);
  std::shared_ptr<Graph> graph = outer->end();
  second.reset();
  for (int run = 0; run < 2; ++run) {
    copyMemory(list.data(), 0, start.data(), cpuDevice, 20);
    graph->launch();
    EXPECT_EQ(download(list.data(), 5), (Numbers{0, 9, 9, 9, 9}));
    EXPECT_EQ(download(seen.data(), 1), Numbers{9});
    set(seen, 0);
  }
  set(yes, 0);
  copyMemory(list.data(), 0, start.data(), cpuDevice, 20);
  graph->launch();
  EXPECT_EQ(download(list.data(), 5), (Numbers{1, 1, 1, 0, 0}));
}

TEST_F(CudaGraphs, GraphsOnOtherStreams) {
  Buffer a(0, 4);
  set(a, 0);
  synchronizeDevice(0);
  auto side = std::make_shared<Stream>(0);
  auto capture = Capture::begin(0, side);
  setMemory(a.data(), 0, 1, 4, side.get());
  auto graph = capture->end();
  graph->launch(side.get());
  side->synchronize();
  EXPECT_EQ(download(a.data(), 1), Numbers{0x01010101});
}
