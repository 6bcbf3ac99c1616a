//===- device-queues-test.cpp - Streams, events, graphs on every device ---===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "warp/Error.h"

using namespace warp;
using namespace warp::test;

namespace {

class DeviceQueues : public DeviceSuite {
protected:
  /// True, once the error is checked, for a device that does not queue work.
  bool refusesQueues() {
    if (!isHost())
      return false;
    for (auto use : {+[](int device) { Stream stream(device); },
                     +[](int device) { Event event(device); },
                     +[](int device) { currentStream(device); }})
      try {
        use(number);
        ADD_FAILURE();
      } catch (const Error &error) {
        EXPECT_EQ(error.message, "'cpu' has no streams and events");
      }
    return true;
  }
};

class DeviceGraphs : public DeviceSuite {
protected:
  std::unique_ptr<Capture> begin() { return Capture::begin(number); }
};

} // namespace

WARP_TEST_DEVICES(DeviceQueues);
WARP_TEST_DEVICES(DeviceGraphs);

TEST_P(DeviceQueues, OrderWorkByEvents) {
  if (refusesQueues())
    return;
  Stream stream(number);
  Event start(number, true), end(number, true);
  start.record(stream);
  Numbers<char> numbers(number, 1 << 20);
  setMemory(numbers.data(), number, 1, numbers.size(), &stream);
  end.record(stream);
  waitEvent(*currentStream(number), end);
  joinStreams(*currentStream(number));
  end.synchronize();
  stream.synchronize();
  EXPECT_TRUE(stream.isComplete());
  EXPECT_TRUE(end.isComplete());
  EXPECT_FALSE(stream.isCapturing());
  EXPECT_TRUE(stream.isBlocking());
  EXPECT_GE(elapsedMilliseconds(start, end), 0.0f);
  EXPECT_EQ(numbers.get().back(), 1);
}

TEST_P(DeviceQueues, CurrentStreamCanBeReplaced) {
  if (refusesQueues())
    return;
  std::shared_ptr<Stream> before = currentStream(number);
  auto mine = std::make_shared<Stream>(number);
  setCurrentStream(number, mine);
  EXPECT_EQ(currentStream(number), mine);
  setCurrentStream(number, before);
  EXPECT_THROW(setCurrentStream(number, nullptr), Error);
}

TEST_P(DeviceQueues, RejectWhatBelongsElsewhere) {
  if (refusesQueues())
    return;
  EXPECT_THROW(Event(number, true, true), Error);
  if (cudaDeviceCount() < 2)
    return;
  Stream other(number + 1);
  Numbers<int> numbers(number, 10);
  EXPECT_THROW(setMemory(numbers.data(), number, 1, 40, &other), Error);
  EXPECT_THROW(Event(number).record(other), Error);
  EXPECT_THROW(setCurrentStream(number, std::make_shared<Stream>(number + 1)),
               Error);
}

TEST_P(DeviceQueues, AreWaitedFor) {
  Numbers<int> numbers(number, 100);
  setMemory(numbers.data(), number, 1, 400);
  device().synchronizeBusyStreams();
  device().synchronize();
  synchronizeAll();
  EXPECT_EQ(numbers.get()[99], 0x01010101);
}

TEST_P(DeviceGraphs, RecordAndReplay) {
  Numbers<int> a(number, 100, 1), b(number, 100, 2);
  std::unique_ptr<Capture> capture = begin();
  EXPECT_TRUE(isCapturing(number));
  copyMemory(a.data(), number, b.data(), number, 400);
  std::vector<int> pattern = {1, 2, 3, 4};
  fillMemory(b.data(), number, pattern.data(), 16, 25);
  std::fill(pattern.begin(), pattern.end(), -1);
  std::shared_ptr<Graph> graph = capture->end();
  EXPECT_FALSE(isCapturing(number));
  EXPECT_EQ(a.get(), std::vector<int>(100, 1));
  graph->launch();
  EXPECT_EQ(a.get(), std::vector<int>(100, 2));
  graph->launch();
  EXPECT_EQ(a.get()[7], 4);
}

TEST_P(DeviceGraphs, MayBeEmptyOrHoldNothing) {
  Numbers<int> numbers(number, 1, 3);
  std::unique_ptr<Capture> capture = begin();
  setMemory(numbers.data(), number, 0, 0);
  copyMemory(numbers.data(), number, nullptr, number, 0);
  std::shared_ptr<Graph> graph = capture->end();
  EXPECT_EQ(graph->size(), 0u);
  graph->launch();
  EXPECT_EQ(numbers.get()[0], 3);
}

TEST_P(DeviceGraphs, KeepFreedMemory) {
  Numbers<int> result(number, 100);
  std::unique_ptr<Capture> capture = begin();
  {
    Buffer temporary(number, 400);
    int value = 8;
    fillMemory(temporary.data(), number, &value, 4, 100);
    copyMemory(result.data(), number, temporary.data(), number, 400);
  }
  std::shared_ptr<Graph> graph = capture->end();
  Numbers<int> other(number, 100, 1);
  graph->launch();
  EXPECT_EQ(result.get(), std::vector<int>(100, 8));
  EXPECT_EQ(other.get(), std::vector<int>(100, 1));
}

TEST_P(DeviceGraphs, HoldBranchesAndLoops) {
  // The condition is the first number of a list that the loop moves along.
  Numbers<int> list(number, {1, 1, 1, 0, 9}), yes(number, 1), no(number, 1);
  std::unique_ptr<Capture> capture = begin();
  Capture::Condition loop = capture->addCondition(list.data(), false);
  capture->beginBody(loop, true);
  for (int i = 0; i < 4; ++i)
    copyMemory(list.data() + i, number, list.data() + i + 1, number, 4);
  capture->updateCondition(loop, list.data(), false);
  capture->endBody();
  for (bool negated : {false, true}) {
    capture->beginBody(capture->addCondition(list.data(), negated), false);
    setMemory(negated ? no.data() : yes.data(), number, 1, 4);
    capture->endBody();
  }
  capture->end()->launch();
  EXPECT_EQ(list.get(), (std::vector<int>{0, 9, 9, 9, 9}));
  EXPECT_EQ(yes.get()[0], 0);
  EXPECT_NE(no.get()[0], 0);
}

TEST_P(DeviceGraphs, RejectMisuse) {
  Numbers<int> value(number, 1, 1);
  std::unique_ptr<Capture> capture = begin();
  EXPECT_THROW(begin(), Error);
  EXPECT_THROW(capture->endBody(), Error);
  capture->beginBody(capture->addCondition(value.data(), false), false);
  EXPECT_THROW(capture->end(), Error);
  capture.reset();
  EXPECT_FALSE(isCapturing(number));
  EXPECT_EQ(begin()->end()->size(), 0u);
}
