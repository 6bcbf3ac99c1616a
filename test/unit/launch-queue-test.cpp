//===- launch-queue-test.cpp - Launches that wait for their code ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The fake driver loads no code while its gate is closed, so that launches wait
// for as long as a test likes.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "Runtime/GraphTrace.h"
#include "warp/Background.h"
#include "warp/Graph.h"
#include "warp/Handle.h"
#include "warp/KernelCache.h"
#include "warp/LaunchQueue.h"
#include "warp/Runtime.h"
#include "warp/Sequences.h"
#include "warp/SparseProduct.h"
#include "warp/TreeBuild.h"

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <gtest/gtest.h>
#include <string>
#include <thread>

using namespace warp;
using namespace warp::test;

namespace {

std::unique_ptr<Kernel> makeKernel(const std::string &name,
                                   bool debug = false) {
  KernelOptions options;
  options.debug = debug;
  return std::make_unique<Kernel>(
      Module::fromText("func.func @" + name + R"((%x: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %w = warp.add(%v, %v) : (f32, f32) -> f32
  warp.store %w, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
})"),
      name, options);
}

/// A launch as the binding makes it: true if it waits.
bool launch(Kernel &kernel, const Stream *stream = nullptr, int blockDim = 0) {
  std::vector<char> params(kernel.parameterSize());
  ArrayDescriptor x = packed(nullptr, {100}, sizeof(float));
  std::memcpy(params.data() + kernel.parameters()[0].offset, &x, sizeof x);
  LaunchDim dim;
  dim.extent[0] = 100;
  Kernel::Plan plan = kernel.tryPrepare(0, dim, params.data(), blockDim);
  if ((!plan.variant || Kernel::mustQueue(0)) &&
      kernel.queue(plan, 0, dim, params.data(), stream, blockDim)) {
    std::memset(params.data(), 0xff, params.size());
    return true;
  }
  kernel.launch(0, dim, params.data(), stream, blockDim);
  return false;
}

std::string errorOf(const std::function<void()> &call) {
  try {
    call();
  } catch (const Error &error) {
    return error.message;
  }
  return "";
}

class LaunchQueueTest : public testing::Test {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    setGate = fakeSymbol<void(bool)>("fakeCudaSetGate");
    setTakesCode = fakeSymbol<void(bool)>("fakeCudaSetTakesCode");
    takeOrder = fakeSymbol<const char *()>("fakeCudaTakeOrder");
    if (!setGate)
      GTEST_SKIP() << "needs the fake driver";
    KernelCache::get().setEnabled(false);
    synchronizeDevice(0);
    Stream warmUp(0);
    takeOrder();
    setGate(false);
  }
  void TearDown() override {
    if (!setGate)
      return;
    setGate(true);
    setTakesCode(true);
    setWaitHooks({});
    setLazyCompile(true);
    waitForBackground();
    EXPECT_EQ(errorOf([] { finishQueuedLaunches(); }), "");
  }

  /// Opens the gate while the calling thread waits.
  std::thread openSoon() {
    return std::thread([this] {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      setGate(true);
    });
  }

  void (*setGate)(bool) = nullptr;
  void (*setTakesCode)(bool) = nullptr;
  const char *(*takeOrder)() = nullptr;
};

} // namespace

// Operations behind a launch without code come behind it, on every stream, with
// the values that they had then.
TEST_F(LaunchQueueTest, KeepsTheOrder) {
  auto first = makeKernel("first"), second = makeKernel("second");
  Stream other(0);
  Event event(0);
  Buffer a(0, 16), b(0, 16);
  auto gone = std::make_unique<Buffer>(0, 16);
  setMemory(a.data(), 0, 1, 16);
  takeOrder();
  EXPECT_TRUE(launch(*first));
  char source[16] = "abcdefghijklmno";
  copyMemory(b.data(), 0, source, cpuDevice, 16);
  std::memset(source, 'z', 16);
  event.record(*currentStream(0));
  waitEvent(other, event);
  EXPECT_TRUE(launch(*second, &other));
  copyMemory(a.data(), 0, b.data(), 0, 16);
  setMemory(b.data(), 0, 7, 16);
  gone = nullptr;
  EXPECT_EQ(queuedOperations(), 8);
  EXPECT_STREQ(takeOrder(), "");
  std::thread opener = openSoon();
  char back[16], filled[16];
  copyMemory(back, cpuDevice, a.data(), 0, 16);
  opener.join();
  EXPECT_EQ(queuedOperations(), 0);
  EXPECT_STREQ(back, "abcdefghijklmno");
  std::string order = takeOrder();
  EXPECT_EQ(order.rfind("launch upload record wait launch copy fill ", 0), 0u)
      << order;
  EXPECT_NE(order.find("free"), std::string::npos) << order;
  copyMemory(filled, cpuDevice, b.data(), 0, 16);
  EXPECT_EQ(filled[15], 7);
}

// A handle keeps its words for launches that wait, and slots that go and come
// again meanwhile end with the words of their last owner.
TEST_F(LaunchQueueTest, HandlesChangeBehindLaunches) {
  auto kernel = makeKernel("handles");
  auto handle = std::make_unique<GeometryHandle>(GeometryKind::Mesh, 0);
  const uint64_t first = 7, second = 8, third = 9;
  handle->write(&first, sizeof first);
  auto *words = reinterpret_cast<const uint64_t *>(handleAddress(handle->id()));
  uint64_t tag = words[0];
  ASSERT_NE(tag, 0u);
  ASSERT_EQ(words[1], first);
  EXPECT_TRUE(launch(*kernel));
  handle->write(&second, sizeof second);
  writeHandleWord(handle->id(), 2, third);
  EXPECT_EQ(words[1], first);
  EXPECT_EQ(words[2], 0u);
  uint64_t id = handle->id();
  handle = nullptr;
  EXPECT_EQ(words[0], tag);
  EXPECT_NE(describeHandle(id, GeometryKind::Mesh, 0), "");
  std::unique_ptr<GeometryHandle> last;
  for (int i = 0; i < 1500; ++i) {
    last = std::make_unique<GeometryHandle>(GeometryKind::Bvh, 0);
    uint64_t value = i;
    last->write(&value, sizeof value);
  }
  EXPECT_EQ(words[1], first);
  setGate(true);
  synchronizeDevice(0);
  auto *at = reinterpret_cast<const uint64_t *>(handleAddress(last->id()));
  EXPECT_NE(at[0], 0u);
  EXPECT_EQ(at[1], 1499u);
  last = nullptr;
  EXPECT_EQ(at[0], 0u);
}

// Sorts, scans, runs, products, builds and copies of views wait with their
// arguments as they were, and the memory that they use goes behind them.
TEST_F(LaunchQueueTest, LibraryCallsWait) {
  auto kernel = makeKernel("library");
  auto buffer = std::make_unique<Buffer>(0, 1 << 16);
  char *at = static_cast<char *>(buffer->data());
  auto *numbers = reinterpret_cast<int32_t *>(at);
  Pairs pairs{NumberType::Int32, at, at + 4096, 4, 100};
  std::vector<std::function<void()>> calls = {
      [&] {
        Sequence out{at, 4}, in{at + 4096, 4};
        scanNumbers(0, NumberType::Int32, 1, out, in, 100, true);
      },
      [&] { sortPairs(0, pairs, 0, 32); },
      [&] { sortSegments(0, pairs, numbers, numbers + 64, 4); },
      [&] {
        findRuns(0, {4, at, 100, at + 4096, numbers + 2048, numbers + 4096});
      },
      [&] {
        TreeBuild build{
            at,        8,          at + 1024,
            4,         false,      true,
            at + 8192, at + 16384, reinterpret_cast<float *>(at + 32768),
            numbers};
        buildTree(0, build);
        refitTree(0, build);
      },
      [&] {
        SparseProduct product{NumberType::Float32, 8,         1,  numbers,
                              numbers + 64,        at + 8192, 16, at + 16384,
                              at + 32768,          1.0,       0.0};
        multiplyRows(0, product);
      },
      [&] {
        ArrayDescriptor to = packed(at, {16, 16}, 4);
        ArrayDescriptor from = packed(at + 8192, {16, 16}, 4);
        std::swap(from.strides[0], from.strides[1]);
        copyArray({&to, 0}, {&from, 0}, 4);
        float one = 1;
        fillArray({&from, 0}, &one, 4);
      }};
  // Kernels of the library are loaded once, which is not of the order.
  setGate(true);
  for (const auto &call : calls)
    call();
  synchronizeDevice(0);
  std::vector<std::string> alone;
  for (const auto &call : calls) {
    takeOrder();
    call();
    alone.push_back(takeOrder());
    EXPECT_NE(alone.back(), "");
  }
  setGate(false);
  EXPECT_TRUE(launch(*kernel));
  std::string expected = "launch";
  for (size_t i = 0; i < calls.size(); ++i) {
    int before = queuedOperations();
    calls[i]();
    EXPECT_GT(queuedOperations(), before) << i;
    expected += " " + alone[i];
  }
  int before = queuedOperations();
  buffer = nullptr;
  EXPECT_EQ(queuedOperations(), before + 1);
  EXPECT_STREQ(takeOrder(), "");
  setGate(true);
  synchronizeDevice(0);
  std::string order = takeOrder();
  EXPECT_EQ(order.rfind(expected, 0), 0u) << order << "\n" << expected;
  EXPECT_NE(order.find("free", expected.size()), std::string::npos) << order;
}

// Kernels, events and streams may go while launches need them.
TEST_F(LaunchQueueTest, OwnersMayGo) {
  auto kernel = makeKernel("owner");
  auto event = std::make_unique<Event>(0);
  EXPECT_TRUE(launch(*kernel));
  event->record(*currentStream(0));
  event = nullptr;
  kernel = nullptr;
  EXPECT_EQ(queuedOperations(), 3);
  setGate(true);
  synchronizeDevice(0);
  EXPECT_STREQ(takeOrder(), "launch record");
  // A stream that is not the current one any more.
  setGate(false);
  kernel = makeKernel("streams");
  auto stream = std::make_unique<Stream>(0);
  takeOrder();
  EXPECT_TRUE(launch(*kernel, stream.get()));
  std::thread opener = openSoon();
  stream = nullptr;
  opener.join();
  EXPECT_EQ(queuedOperations(), 0);
  EXPECT_EQ(std::string(takeOrder()).rfind("launch", 0), 0u);
}

// Memory that is new takes no part in the order.
TEST_F(LaunchQueueTest, AllocationsDoNotWait) {
  auto kernel = makeKernel("allocations");
  EXPECT_TRUE(launch(*kernel));
  Buffer zeros(0, 16);
  clearNewMemory(zeros.data(), 0, 16);
  EXPECT_EQ(queuedOperations(), 1);
  EXPECT_STREQ(takeOrder(), "fill");
  setGate(true);
}

TEST_F(LaunchQueueTest, GoesOnWhenTheCodeIsThere) {
  auto kernel = makeKernel("ready");
  EXPECT_TRUE(launch(*kernel));
  EXPECT_TRUE(launch(*kernel));
  setGate(true);
  waitForBackground();
  EXPECT_FALSE(launch(*kernel));
  EXPECT_STREQ(takeOrder(), "launch launch launch");
}

/// Each of these waits.
TEST_F(LaunchQueueTest, AnswersWaitForTheCode) {
  auto expectWait = [&](const char *what, const std::function<void()> &ask) {
    setGate(false);
    auto kernel = makeKernel("answers");
    EXPECT_TRUE(launch(*kernel)) << what;
    std::thread opener = openSoon();
    ask();
    EXPECT_EQ(queuedOperations(), 0) << what;
    opener.join();
  };
  Event event(0), timed(0, true), later(0, true);
  timed.record(*currentStream(0));
  later.record(*currentStream(0));
  expectWait("device", [] { synchronizeDevice(0); });
  expectWait("all", [] { synchronizeAll(); });
  expectWait("stream", [] { currentStream(0)->synchronize(); });
  expectWait("busy streams", [] { synchronizeBusyStreams(); });
  expectWait("stream query", [] { (void)currentStream(0)->isComplete(); });
  expectWait("event", [&] { event.synchronize(); });
  expectWait("event query", [&] { (void)event.isComplete(); });
  expectWait("time", [&] { elapsedMilliseconds(timed, later); });
  expectWait("join", [] { joinStreams(*currentStream(0)); });
  expectWait("stream that goes", [] { Stream gone(0); });
  expectWait("share", [] { setLazyCompile(false); });
}

// A kernel that fails is named once, others run.
TEST_F(LaunchQueueTest, ErrorsAreRaisedOnce) {
  auto good = makeKernel("good"), bad = makeKernel("bad");
  setGate(true);
  EXPECT_TRUE(launch(*good));
  synchronizeDevice(0);
  takeOrder();
  setTakesCode(false);
  setGate(false);
  EXPECT_TRUE(launch(*bad));
  EXPECT_TRUE(launch(*bad));
  EXPECT_TRUE(launch(*good));
  EXPECT_STREQ(takeOrder(), "");
  setGate(true);
  EXPECT_NE(errorOf([] {
              synchronizeDevice(0);
            }).find("the CUDA driver rejects the code of 'bad'"),
            std::string::npos);
  synchronizeDevice(0);
  EXPECT_FALSE(launch(*good));
  EXPECT_STREQ(takeOrder(), "launch launch");
  // The next launch raises what is known by then, and does not happen.
  EXPECT_TRUE(launch(*bad));
  waitForBackground();
  EXPECT_NE(errorOf([&] { launch(*good); }).find("'bad'"), std::string::npos);
  EXPECT_STREQ(takeOrder(), "");
  EXPECT_FALSE(launch(*good));
  // With a driver that takes it the kernel runs.
  setTakesCode(true);
  EXPECT_TRUE(launch(*bad));
  synchronizeDevice(0);
  EXPECT_STREQ(takeOrder(), "launch launch");
}

// Errors of a launch itself are raised at once.
TEST_F(LaunchQueueTest, BadLaunchesDoNotWait) {
  auto kernel = makeKernel("wrong");
  EXPECT_NE(errorOf([&] {
              launch(*kernel, nullptr, 4096);
            }).find("expects 1 to 1024 threads per block"),
            std::string::npos);
  Stream second(1);
  setGate(true);
  EXPECT_NE(errorOf([&] {
              launch(*kernel, &second);
            }).find("expects a stream of 'cuda:0'"),
            std::string::npos);
  EXPECT_EQ(queuedOperations(), 0);
}

TEST_F(LaunchQueueTest, ACaptureHoldsWhatWaited) {
  auto kernel = makeKernel("captured");
  auto capture = Capture::begin(0);
  EXPECT_TRUE(launch(*kernel));
  EXPECT_TRUE(launch(*kernel));
  std::thread opener = openSoon();
  std::shared_ptr<Graph> graph = capture->end();
  opener.join();
  EXPECT_EQ(graph->size(), 2u);
  takeOrder();
  // An error of the compiler is that of the capture.
  setTakesCode(false);
  auto bad = makeKernel("captured_bad");
  auto second = Capture::begin(0);
  EXPECT_TRUE(launch(*bad));
  EXPECT_NE(errorOf([&] { second->end(); }).find("'captured_bad'"),
            std::string::npos);
}

// The trace of a capture has the operations that waited in their order, and
// keeps the kernels.
TEST_F(LaunchQueueTest, ATraceHoldsWhatWaited) {
  auto kernel = makeKernel("traced"), other = makeKernel("traced_other");
  Buffer a(0, 64), b(0, 64);
  auto capture = Capture::begin(0, nullptr, CaptureMode::Relaxed, false, true);
  EXPECT_TRUE(launch(*kernel));
  setMemory(a.data(), 0, 7, 64);
  EXPECT_TRUE(launch(*other));
  copyMemory(b.data(), 0, a.data(), 0, 64);
  EXPECT_TRUE(launch(*kernel));
  kernel = nullptr;
  other = nullptr;
  EXPECT_EQ(queuedOperations(), 5);
  std::thread opener = openSoon();
  std::shared_ptr<Graph> graph = capture->end();
  opener.join();
  ASSERT_NE(graph->operations(), nullptr);
  std::string found;
  for (const GraphOperation &operation : graph->operations()->operations) {
    found += operation.kind == GraphOperation::Kind::Launch
                 ? operation.kernel->name() + " "
             : operation.kind == GraphOperation::Kind::FillBytes ? "fill "
             : operation.kind == GraphOperation::Kind::CopyBytes ? "copy "
                                                                 : "? ";
  }
  EXPECT_EQ(found, "traced fill traced_other copy traced ");
  EXPECT_EQ(graph->size(), 5u);
}

// A capture that is given up takes its launches with it, and a copy from the
// host into a graph reads where the host said.
TEST_F(LaunchQueueTest, CapturesTakeTheirLaunches) {
  auto kernel = makeKernel("given_up");
  Buffer a(0, 16);
  {
    auto capture = Capture::begin(0);
    EXPECT_TRUE(launch(*kernel));
    std::thread opener = openSoon();
    capture = nullptr;
    opener.join();
    EXPECT_EQ(queuedOperations(), 0);
  }
  setGate(false);
  kernel = makeKernel("before_upload");
  char source[16] = "first";
  auto capture = Capture::begin(0);
  EXPECT_TRUE(launch(*kernel));
  std::thread opener = openSoon();
  copyMemory(a.data(), 0, source, cpuDevice, 16);
  std::shared_ptr<Graph> graph = capture->end();
  opener.join();
  std::strcpy(source, "second");
  graph->launch();
  synchronizeDevice(0);
  EXPECT_STREQ(static_cast<char *>(a.data()), "second");
}

// An interrupt ends the wait and leaves the queue as it is.
TEST_F(LaunchQueueTest, AWaitCanBeInterrupted) {
  auto kernel = makeKernel("interrupted");
  EXPECT_TRUE(launch(*kernel));
  static int polls;
  polls = 0;
  WaitHooks hooks;
  hooks.poll = [](int done, int all, bool mayThrow) {
    ++polls;
    EXPECT_EQ(done, 0);
    EXPECT_EQ(all, 1);
    if (mayThrow)
      throw Error(Error::Kind::Runtime, "interrupted");
  };
  setWaitHooks(hooks);
  EXPECT_EQ(errorOf([] { synchronizeDevice(0); }), "interrupted");
  EXPECT_GE(polls, 1);
  EXPECT_EQ(queuedOperations(), 1);
  setWaitHooks({});
  setGate(true);
  synchronizeDevice(0);
  EXPECT_STREQ(takeOrder(), "launch");
}

TEST_F(LaunchQueueTest, IsNotUsedWhereItMayNot) {
  setGate(true);
  EXPECT_FALSE(launch(*makeKernel("debugged", /*debug=*/true)));
  setLazyCompile(false);
  EXPECT_FALSE(launch(*makeKernel("at_once")));
  EXPECT_STREQ(takeOrder(), "launch launch");
}

TEST_F(LaunchQueueTest, ManyThreadsLaunchAndWait) {
  setGate(true);
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t)
    threads.emplace_back([t] {
      for (int round = 0; round < 3; ++round) {
        auto kernel = makeKernel("threads_" + std::to_string(t));
        launch(*kernel);
        Buffer buffer(0, 64);
        char value = static_cast<char>(t), back[64];
        setMemory(buffer.data(), 0, value, 64);
        launch(*kernel);
        copyMemory(back, cpuDevice, buffer.data(), 0, 64);
        EXPECT_EQ(back[63], value);
      }
    });
  for (std::thread &thread : threads)
    thread.join();
}

// Kernels are compiled side by side, and the first error is that of the call.
TEST_F(LaunchQueueTest, LoadsSeveralKernels) {
  setGate(true);
  auto a = makeKernel("load_a"), b = makeKernel("load_b");
  Kernel::load({{a.get(), 0, 0}, {b.get(), 0, 0}, {b.get(), cpuDevice, 0}});
  setGate(false);
  EXPECT_FALSE(launch(*a));
  EXPECT_FALSE(launch(*b));
  setGate(true);
  setTakesCode(false);
  auto bad = makeKernel("load_bad");
  EXPECT_NE(errorOf([&] {
              Kernel::load({{bad.get(), 0, 0}, {a.get(), 0, 0}}, 1);
            }).find("'load_bad'"),
            std::string::npos);
}
