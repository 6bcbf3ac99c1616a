//===- cuda-reclaim-test.cpp - Frees, peers, faults on a fake driver ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The runtime's calls of the driver when memory is freed while streams may
// still use it. The fake driver logs events, waits and frees with the number of
// the stream, and can pretend that streams never finish.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "Runtime/Support.h"
#include "Runtime/cuda/Device.h"
#include "warp/MemoryTracker.h"
#include "warp/Peers.h"
#include "warp/Runtime.h"

#include <cstdlib>
#include <cstring>
#include <gtest/gtest.h>
#include <string>
#include <sys/wait.h>
#include <unistd.h>

using namespace warp;
using namespace warp::test;

namespace {

class Reclaim : public testing::Test {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    takeLog = fakeSymbol<const char *()>("fakeCudaTakeStreamLog");
    if (!takeLog)
      GTEST_SKIP() << "needs the fake driver";
    setBusy = fakeSymbol<void(bool)>("fakeCudaSetBusy");
    setFault = fakeSymbol<void(int)>("fakeCudaSetFault");
    // The effects of earlier tests are over.
    Buffer(0, 16);
    takeLog();
  }
  void TearDown() override {
    if (!takeLog)
      return;
    setFault(0);
    setBusy(false);
  }

  static std::string number(void *stream) {
    return std::to_string(fakeSymbol<int(void *)>("fakeCudaNumberOf")(stream));
  }
  static std::string number(const Stream &stream) {
    return number(stream.handle());
  }
  static std::string reclaimNumber() { return number(cudaDevice(0).reclaim); }
  static void work(const Buffer &buffer, const Stream *stream = nullptr) {
    setMemory(buffer.data(), 0, 1, buffer.size(), stream);
  }

  const char *(*takeLog)() = nullptr;
  void (*setBusy)(bool) = nullptr;
  void (*setFault)(int) = nullptr;
};

} // namespace

TEST_F(Reclaim, OneStreamFreesInOrder) {
  auto buffer = std::make_unique<Buffer>(0, 64);
  work(*buffer);
  buffer.reset();
  EXPECT_EQ(takeLog(), "free:" + number(*currentStream(0)));
}

TEST_F(Reclaim, FreesWaitForAllBusyStreams) {
  setBusy(true);
  auto first = std::make_unique<Buffer>(0, 64);
  auto second = std::make_unique<Buffer>(0, 64);
  Stream idle(0), other(0);
  work(*first);
  work(*first, &other);
  takeLog();
  first.reset();
  std::string r = reclaimNumber();
  EXPECT_EQ(takeLog(), "record:" + number(*currentStream(0)) + " wait:" + r +
                           " record:" + number(other) + " wait:" + r +
                           " free:" + r);
  // Nothing was queued since.
  second.reset();
  EXPECT_EQ(takeLog(), "free:" + r);
}

TEST_F(Reclaim, WorkOfAStreamThatIsGoneCounts) {
  setBusy(true);
  auto buffer = std::make_unique<Buffer>(0, 64);
  std::string gone;
  {
    Stream other(0);
    work(*buffer, &other);
    gone = number(other);
    takeLog();
  }
  std::string r = reclaimNumber();
  EXPECT_EQ(takeLog(), "record:" + gone + " wait:" + r);
  buffer.reset();
  EXPECT_EQ(takeLog(), "record:" + number(*currentStream(0)) + " wait:" + r +
                           " free:" + r);
  // Once that is over the current stream is the only one again.
  setBusy(false);
  Buffer(0, 64);
  EXPECT_EQ(takeLog(), "free:" + number(*currentStream(0)));
}

TEST_F(Reclaim, BorrowedStreamsCountOnce) {
  setBusy(true);
  Stream owner(0);
  auto buffer = std::make_unique<Buffer>(0, 64);
  Stream a(0, owner.handle()), b(0, owner.handle());
  EXPECT_EQ(a.use(), b.use());
  work(*buffer, &a);
  work(*buffer, &b);
  takeLog();
  buffer.reset();
  std::string log = takeLog();
  std::string record = "record:" + number(owner) + " ";
  EXPECT_NE(log.find(record), std::string::npos) << log;
  EXPECT_EQ(log.find(record), log.rfind(record)) << log;
}

// A destroyed stream must not be waited for through its borrowers: work that
// was queued on it counts once, when its owner goes.
TEST_F(Reclaim, BorrowersOutliveTheStream) {
  setBusy(true);
  auto buffer = std::make_unique<Buffer>(0, 64);
  auto owner = std::make_unique<Stream>(0);
  auto borrower = std::make_unique<Stream>(0, owner->handle());
  work(*buffer, borrower.get());
  std::string record = "record:" + number(*owner);
  takeLog();
  owner.reset();
  EXPECT_NE(std::string(takeLog()).find(record), std::string::npos);
  EXPECT_FALSE(borrower->use()->exists());
  borrower.reset();
  buffer.reset();
  EXPECT_EQ(std::string(takeLog()).find(record), std::string::npos);
}

TEST_F(Reclaim, JoiningAStreamWaitsForTheOthers) {
  setBusy(true);
  Buffer buffer(0, 64);
  Stream other(0);
  work(buffer, &other);
  takeLog();
  joinStreams(*currentStream(0));
  std::string log = takeLog();
  EXPECT_NE(log.find("record:" + number(other)), std::string::npos) << log;
  EXPECT_TRUE(log.ends_with("wait:" + number(*currentStream(0)))) << log;
}

TEST_F(Reclaim, PinnedMemoryIsReusedWhenItsStreamsAreDone) {
  void *memory;
  {
    Buffer pinned(cpuDevice, 100000, true);
    memory = pinned.data();
    setBusy(true);
  }
  {
    Buffer other(cpuDevice, 100000, true);
    EXPECT_NE(other.data(), memory);
  }
  setBusy(false);
  Buffer first(cpuDevice, 100000, true), second(cpuDevice, 100000, true);
  EXPECT_TRUE(first.data() == memory || second.data() == memory);
}

TEST_F(Reclaim, StreamsOfAnotherDeviceAreRefused) {
  Stream other(1);
  Buffer buffer(0, 64);
  EXPECT_THROW(work(buffer, &other), Error);
  Event event(0);
  EXPECT_THROW(event.record(other), Error);
}

TEST_F(Reclaim, FaultsNameTheKernelLaunchedLast) {
  Buffer buffer(0, 64);
  cudaDevice(0).lastKernel = permanentName("saxpy");
  setFault(700);
  for (int i = 0; i < 2; ++i)
    try {
      synchronizeDevice(0);
      FAIL();
    } catch (const Error &error) {
      EXPECT_NE(error.message.find("launched last: 'saxpy'"), std::string::npos)
          << error.message;
    }
  EXPECT_THROW(Buffer(0, 64), Error);
  EXPECT_THROW(work(buffer), Error);
  // The CPU goes on.
  Buffer host(cpuDevice, 64);
  setMemory(host.data(), cpuDevice, 1, 64);
}

TEST_F(Reclaim, ChildrenAreToldToSpawn) {
  Buffer buffer(0, 64);
  pid_t child = fork();
  if (child == 0) {
    synchronizeBusyStreams();
    try {
      Buffer other(0, 64);
    } catch (const Error &error) {
      _exit(error.message.find("'spawn'") == std::string::npos ? 1 : 42);
    }
    _exit(2);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 42);
  work(buffer);
}

TEST_F(Reclaim, MemoryKinds) {
  Buffer pool(0, 64), host(cpuDevice, 64);
  EXPECT_EQ(memoryKind(0, pool.data()), MemoryKind::Pool);
  EXPECT_EQ(memoryKind(cpuDevice, host.data()), MemoryKind::Host);
  setPoolEnabled(0, false);
  Buffer plain(0, 64);
  setPoolEnabled(0, true);
  EXPECT_EQ(memoryKind(0, plain.data()), MemoryKind::Device);
  EXPECT_THROW(setPoolEnabled(1, true), Error);
  void *managed = allocateManaged(0, 64);
  EXPECT_EQ(memoryKind(0, managed), MemoryKind::Managed);
  EXPECT_TRUE(canAccess(cpuDevice, 0, managed));
  EXPECT_FALSE(canAccess(cpuDevice, 0, pool.data()));
  freeManaged(0, managed);
}

TEST_F(Reclaim, MemoryOfAnotherProcess) {
  setPoolEnabled(0, false);
  Buffer plain(0, 64);
  setPoolEnabled(0, true);
  auto *inside = static_cast<char *>(plain.data()) + 8;
  auto [handle, offset] = exportMemory(0, inside);
  EXPECT_EQ(offset, 8u);
  void *opened = importMemory(0, handle);
  EXPECT_EQ(opened, plain.data());
  closeImported(0, opened);
  Buffer pooled(0, 64);
  EXPECT_THROW(exportMemory(0, pooled.data()), Error);
  Event event(0, false, true);
  Event same(0, event.ipcHandle());
  EXPECT_THROW(Event(0, true, true), Error);
}

TEST_F(Reclaim, Contexts) {
  EXPECT_EQ(mapContext(cudaContext(1)), 1);
  void *foreign = reinterpret_cast<void *>(uintptr_t(0x200));
  int index = mapContext(foreign);
  EXPECT_EQ(index, 2);
  EXPECT_EQ(mapContext(foreign), index);
  EXPECT_EQ(cudaContext(index), foreign);
  EXPECT_EQ(deviceInfo(index).alias, "cuda:2");
  Buffer buffer(index, 64);
  setMemory(buffer.data(), index, 1, 64);
}

// Last, since it cannot be undone: frees then look at all devices.
TEST_F(Reclaim, PeersUseMemoryToo) {
  EXPECT_TRUE(canPeersLink(0, 1));
  EXPECT_FALSE(isPoolAccessEnabled(0, 1));
  Buffer buffer(0, 64);
  EXPECT_FALSE(canAccess(1, 0, buffer.data()));
  setPoolAccessEnabled(0, 1, true);
  EXPECT_TRUE(canAccess(1, 0, buffer.data()));
  setPeerAccessEnabled(0, 1, true);
  EXPECT_TRUE(isPeerAccessEnabled(0, 1));
  setPeerAccessEnabled(0, 1, false);
  EXPECT_FALSE(isPeerAccessEnabled(0, 1));
  Buffer theirs(1, 64);
  setMemory(theirs.data(), 1, 1, 64);
  takeLog();
  Buffer(0, 64);
  std::string log = takeLog();
  EXPECT_NE(log.find("record:" + number(*currentStream(1))), std::string::npos)
      << log;
  setPoolAccessEnabled(0, 1, false);
}

TEST(MemoryTracker, NamesTheLargestUsers) {
  MemoryTracker tracker;
  char a = 0, b = 0, c = 0;
  tracker.add(&a, 1000, 0, false, "a.py:1 (f)");
  tracker.add(&b, 5000, 0, false, "b.py:2 (g)");
  tracker.add(&c, 9000, 1, false, "c.py:3 (h)");
  EXPECT_EQ(tracker.largestUsers(0),
            "4.9 KiB at b.py:2 (g), 1000 bytes at a.py:1 (f)");
  tracker.remove(&b);
  tracker.remove(&b);
  EXPECT_EQ(tracker.largestUsers(0), "1000 bytes at a.py:1 (f)");
  EXPECT_EQ(tracker.totals().at(0).peak, 6000u);
  EXPECT_EQ(tracker.totals().at(0).frees, 1u);
  EXPECT_EQ(tracker.live().size(), 2u);
  EXPECT_EQ(tracker.largestUsers(cpuDevice), "");
}
