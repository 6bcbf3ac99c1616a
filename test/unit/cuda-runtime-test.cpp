//===- cuda-runtime-test.cpp - Devices, memory and launches on CUDA -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Runs against the driver that WARP_CUDA_DRIVER names, by default a fake one
// made of host memory. With WARP_CUDA_DRIVER=libcuda.so.1 the same tests run
// on a GPU, apart from those that look inside the fake.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "Runtime/cuda/Kernel.h"
#include "warp/Background.h"
#include "warp/Graph.h"
#include "warp/KernelCache.h"
#include "warp/Runtime.h"

#include <cstdlib>
#include <cstring>
#include <gtest/gtest.h>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

using namespace warp;
using warp::test::chooseDriver;
using warp::test::fakeSymbol;

namespace {

bool isFake() { return fakeSymbol<size_t()>("fakeCudaBytesInUse") != nullptr; }

VariantKey keyOf(int rank, bool flat = false) {
  VariantKey key;
  key.device = 0;
  key.rank = rank;
  key.flat = flat;
  return key;
}

std::vector<int> iota(size_t count) {
  std::vector<int> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

std::vector<char> download(const void *data, int device, size_t bytes) {
  std::vector<char> host(bytes);
  copyMemory(host.data(), cpuDevice, data, device, bytes);
  synchronizeDevice(device);
  return host;
}

ArrayDescriptor view(void *data, std::vector<int> shape,
                     std::vector<int> strides) {
  ArrayDescriptor array;
  array.data = data;
  array.ndim = static_cast<int>(shape.size());
  std::copy(shape.begin(), shape.end(), array.shape);
  std::copy(strides.begin(), strides.end(), array.strides);
  return array;
}

/// A launch as kernels make it.
void launch(Kernel::Variant &variant, void *params, size_t size,
            const Stream *stream = nullptr, bool openBlock = false,
            int64_t bytes = 0) {
  variant.label = "test";
  Kernel::Plan plan;
  plan.variant = &variant;
  plan.device = 0;
  plan.openBlock = openBlock;
  plan.bytes = bytes;
  variant.current.load()->launch(plan, params, size, stream);
}

class Cuda : public testing::Test {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    if (cudaDeviceCount() == 0)
      GTEST_SKIP() << cudaUnavailableReason();
  }
};

} // namespace

TEST_F(Cuda, TellsWhichMemoryHostAndDeviceShare) {
  if (!isFake())
    GTEST_SKIP() << "depends on the machine";
  const DeviceInfo &gpu = deviceInfo(0), &host = deviceInfo(cpuDevice);
  EXPECT_TRUE(gpu.hasManagedMemory);
  EXPECT_TRUE(gpu.hasConcurrentManagedAccess);
  EXPECT_FALSE(gpu.hasDirectManagedAccessFromHost);
  EXPECT_FALSE(gpu.hasPageableMemoryAccess);
  EXPECT_FALSE(gpu.hasHostNativeAtomics);
  EXPECT_FALSE(host.hasManagedMemory || host.hasConcurrentManagedAccess);
}

TEST_F(Cuda, DescribesDevices) {
  const DeviceInfo &info = deviceInfo(0);
  EXPECT_EQ(info.alias, "cuda:0");
  EXPECT_FALSE(info.name.empty());
  EXPECT_GE(info.arch, 70);
  EXPECT_GT(info.smCount, 0);
  EXPECT_TRUE(info.isUva);
  EXPECT_FALSE(info.pciBusId.empty());
  auto [free, total] = deviceMemory(0);
  EXPECT_GT(free, 0u);
  EXPECT_LE(free, total);
  EXPECT_NE(cudaContext(0), nullptr);
}

TEST_F(Cuda, CopiesBetweenDevices) {
  if (cudaDeviceCount() < 2)
    GTEST_SKIP() << "one device";
  std::vector<int> numbers = iota(1000);
  Buffer first(0, 4000), second(1, 4000);
  copyMemory(first.data(), 0, numbers.data(), cpuDevice, 4000);
  copyMemory(second.data(), 1, first.data(), 0, 4000);
  std::vector<char> back = download(second.data(), 1, 4000);
  EXPECT_EQ(std::memcmp(back.data(), numbers.data(), 4000), 0);
}

TEST_F(Cuda, OutOfMemoryNamesRequestAndFree) {
  try {
    Buffer buffer(0, size_t(1) << 42);
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Memory);
    EXPECT_NE(error.message.find(
                  "out of memory on 'cuda:0', requested 4.0 TiB, free "),
              std::string::npos)
        << error.message;
  }
  Buffer usable(0, 1000);
}

// The pool gives up held memory before a request fails.
TEST_F(Cuda, TrimsThePool) {
  if (!isFake())
    GTEST_SKIP() << "needs a device with known memory";
  {
    Buffer most(0, size_t(60) << 20);
  }
  Buffer again(0, size_t(61) << 20);
}

TEST_F(Cuda, FreesWhatItAllocates) {
  auto *bytesInUse = fakeSymbol<size_t()>("fakeCudaBytesInUse");
  if (!bytesInUse)
    GTEST_SKIP() << "needs the fake driver";
  size_t before = bytesInUse();
  {
    Buffer pool(0, 1000), plain(1, 1000);
    EXPECT_EQ(bytesInUse(), before + 2000);
  }
  EXPECT_EQ(bytesInUse(), before);
}

TEST_F(Cuda, ManyThreads) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 16; ++t)
    threads.emplace_back([t] {
      for (int round = 0; round < 50; ++round) {
        std::vector<int> numbers(256, t);
        Buffer buffer(0, 1024);
        copyMemory(buffer.data(), 0, numbers.data(), cpuDevice, 1024);
        std::vector<int> back(256);
        copyMemory(back.data(), cpuDevice, buffer.data(), 0, 1024);
        EXPECT_EQ(back, numbers);
      }
    });
  for (std::thread &thread : threads)
    thread.join();
}

TEST_F(Cuda, RejectedCodeIsACompileError) {
  Code code;
  std::string ptx = "this is no PTX";
  code.binary.assign(ptx.begin(), ptx.end());
  code.entry = "nothing";
  try {
    deviceAt(0).assemble(code);
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Compile);
    EXPECT_NE(error.message.find("rejects the code of 'nothing'"),
              std::string::npos);
  }
}

//===----------------------------------------------------------------------===//
// Launches
//===----------------------------------------------------------------------===//

/// Adds 1 + x + 1000 y + 1000000 z to element x + dim[2] (y + dim[1] z).
static const char *const ptx = R"(
.version 8.0
.target sm_70
.address_size 64
.visible .entry mark(.param .align 8 .b8 p[32])
{
  .reg .b32 %r<24>;
  .reg .b64 %d<6>;
  .reg .pred %c<4>;
  mov.u32 %r0, %ctaid.x; mov.u32 %r1, %ntid.x; mov.u32 %r2, %tid.x;
  mad.lo.s32 %r3, %r0, %r1, %r2;
  mov.u32 %r0, %ctaid.y; mov.u32 %r1, %ntid.y; mov.u32 %r2, %tid.y;
  mad.lo.s32 %r4, %r0, %r1, %r2;
  mov.u32 %r0, %ctaid.z; mov.u32 %r1, %ntid.z; mov.u32 %r2, %tid.z;
  mad.lo.s32 %r5, %r0, %r1, %r2;
  ld.param.u32 %r6, [p+8];
  ld.param.u32 %r7, [p+4];
  ld.param.u32 %r8, [p];
  setp.ge.s32 %c0, %r3, %r6; @%c0 ret;
  setp.ge.s32 %c1, %r4, %r7; @%c1 ret;
  setp.ge.s32 %c2, %r5, %r8; @%c2 ret;
  mad.lo.s32 %r9, %r7, %r5, %r4;
  mad.lo.s32 %r9, %r9, %r6, %r3;
  mad.lo.s32 %r10, %r4, 1000, %r3;
  mad.lo.s32 %r10, %r5, 1000000, %r10;
  add.s32 %r10, %r10, 1;
  ld.param.u64 %d0, [p+24];
  cvta.to.global.u64 %d0, %d0;
  mul.wide.s32 %d1, %r9, 4;
  add.s64 %d0, %d0, %d1;
  st.global.u32 [%d0], %r10;
  ret;
}
)";

// One thread per index of a rank-3 launch, whatever its extents.
TEST_F(Cuda, LaunchCoversTheGrid) {
  for (auto [z, y, x] : {std::array{1, 1, 1}, std::array{3, 5, 7},
                         std::array{2, 300, 3}, std::array{70, 2, 33}}) {
    Kernel::Variant variant;
    variant.key = keyOf(3);
    variant.code.binary.assign(ptx, ptx + std::strlen(ptx) + 1);
    variant.code.entry = "mark";
    variant.place(deviceAt(0).load(variant, variant.code));
    int count = x * y * z;
    Buffer buffer(0, count * 4);
    setMemory(buffer.data(), 0, 0, count * 4);
    struct {
      LaunchHeader header;
      void *data;
    } params{{{z, y, x, 1}, {0}}, buffer.data()};
    launch(variant, &params, sizeof params);
    std::vector<char> back = download(buffer.data(), 0, count * 4);
    if (isFake())
      continue;
    for (int i = 0; i < count; ++i) {
      int found;
      std::memcpy(&found, back.data() + 4 * i, 4);
      ASSERT_EQ(found, 1 + i % x + 1000 * (i / x % y) + 1000000 * (i / x / y));
    }
  }
}

// A kernel is started before the one before it has ended only if it waits.
TEST_F(Cuda, StartsEarlyWhatWaits) {
  auto *launches = fakeSymbol<int()>("fakeCudaProgrammaticLaunches");
  if (!launches)
    GTEST_SKIP() << "needs the fake driver";
  auto startsEarly = [&](const std::string &body, const Stream *stream) {
    Kernel::Variant variant;
    variant.key = keyOf(1);
    std::string ptx = ".visible .entry k() {" + body + "ret; }";
    variant.code.entry = "k";
    variant.code.binary.assign(ptx.begin(), ptx.end());
    variant.place(deviceAt(0).load(variant, variant.code));
    LaunchHeader header;
    header.dim[0] = 1;
    int before = launches();
    launch(variant, &header, sizeof header, stream);
    return launches() - before;
  };
  Stream other(0);
  EXPECT_EQ(startsEarly("griddepcontrol.wait; ", nullptr), 1);
  EXPECT_EQ(startsEarly("griddepcontrol.wait; ", &other), 1);
  EXPECT_EQ(startsEarly("", nullptr), 0);
}

TEST_F(Cuda, BlocksAreShapedToTheLaunch) {
  auto *lastLaunch = fakeSymbol<const char *()>("fakeCudaLastLaunch");
  if (!lastLaunch)
    GTEST_SKIP() << "needs the fake driver";
  auto shape = [&](int rank, std::array<int, 4> dim, bool flat = false) {
    Kernel::Variant variant;
    variant.key = keyOf(rank, flat);
    variant.flat = flat;
    variant.place(std::make_unique<CudaEntry>(cudaDevice(0)));
    LaunchHeader header;
    std::copy(dim.begin(), dim.end(), header.dim);
    launch(variant, &header, sizeof header);
    return std::string(lastLaunch());
  };
  EXPECT_EQ(shape(1, {1000, 1, 1, 1}), "(4, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(shape(2, {64, 1024, 1, 1}), "(32, 8, 1) x (32, 8, 1)");
  EXPECT_EQ(shape(2, {100000, 3, 1, 1}), "(1, 1563, 1) x (3, 64, 1)");
  EXPECT_EQ(shape(2, {2, 100000, 1, 1}), "(782, 1, 1) x (128, 2, 1)");
  EXPECT_EQ(shape(3, {5, 1, 1, 1}), "(1, 1, 1) x (32, 1, 8)");
  EXPECT_EQ(shape(4, {10, 10, 10, 10}, true), "(40, 1, 1) x (256, 1, 1)");
}

TEST_F(Cuda, BlocksAreShapedToTheSchedule) {
  auto *lastLaunch = fakeSymbol<const char *()>("fakeCudaLastLaunch");
  auto *lastParams = fakeSymbol<const void *()>("fakeCudaLastParams");
  if (!lastLaunch)
    GTEST_SKIP() << "needs the fake driver";
  auto shape = [&](const Schedule &schedule, int rank, std::array<int, 4> dim) {
    Kernel::Variant variant;
    variant.key = keyOf(rank);
    variant.code.schedule = schedule;
    variant.place(std::make_unique<CudaEntry>(cudaDevice(0)));
    LaunchHeader header;
    std::copy(dim.begin(), dim.end(), header.dim);
    launch(variant, &header, sizeof header, nullptr, /*openBlock=*/true);
    EXPECT_TRUE(std::equal(dim.begin(), dim.end(), header.dim));
    // The kernel gets other extents.
    if (schedule.blockCoarsening > 1)
      dim[rank - 2] /= schedule.blockCoarsening;
    EXPECT_EQ(std::memcmp(dim.data(), lastParams(), sizeof dim), 0);
    return std::string(lastLaunch());
  };
  Schedule split, tiles, patches, joined;
  split.splitReduction = 8;
  EXPECT_EQ(shape(split, 1, {1000, 1, 1, 1}), "(32, 1, 1) x (32, 8, 1)");
  tiles.transposeTile = 32;
  EXPECT_EQ(shape(tiles, 2, {100, 70, 1, 1}), "(12, 1, 1) x (32, 8, 1)");
  EXPECT_EQ(shape(tiles, 3, {5, 32, 33, 1}), "(10, 1, 1) x (32, 8, 1)");
  patches.coarsening = 8;
  patches.rowCoarsening = 2;
  EXPECT_EQ(shape(patches, 3, {64, 10, 40, 1}), "(1, 2, 16) x (64, 4, 1)");
  joined.blockCoarsening = 4;
  joined.cooperative = joined.fixedBlock = true;
  EXPECT_EQ(shape(joined, 3, {5, 8, 256, 1}), "(10, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(shape(joined, 2, {8, 256, 1, 1}), "(2, 1, 1) x (256, 1, 1)");
}

// A launch begins with the memory that the one before has left in the cache.
TEST_F(Cuda, LaunchesBeginAtEitherEndInTurn) {
  Kernel::Variant variant;
  variant.key = keyOf(1);
  variant.place(std::make_unique<CudaEntry>(cudaDevice(0)));
  int64_t cache = deviceInfo(0).cacheBytes;
  ASSERT_GT(cache, 0);
  auto order = [&](int64_t bytes) {
    LaunchHeader header;
    header.dim[0] = 1000;
    launch(variant, &header, sizeof header, nullptr, /*openBlock=*/true, bytes);
    return header.reversed;
  };
  EXPECT_EQ(order(2 * cache), 0u);
  variant.code.schedule.reverseOrder = true;
  uint64_t first = order(2 * cache);
  EXPECT_EQ(order(cache + 1), 1 - first);
  EXPECT_EQ(order(cache), 0u);
  EXPECT_EQ(order(2 * cache), first);
}

// Half a block's threads where that spreads a launch over more of the card,
// where more of them fit, or where some take longer than others.
TEST_F(Cuda, BlocksAreSmallerWhereTheCardWouldWait) {
  auto choose = [](int blocks, int halves, int64_t threads,
                   bool keepsStack = false) {
    CudaEntry entry(cudaDevice(0));
    entry.keepsStack = keepsStack;
    entry.residentBlocks = blocks;
    entry.residentHalves = halves;
    return chooseBlock(entry, 256, threads, 132);
  };
  EXPECT_EQ(choose(8, 16, 1), 256 / 2);
  EXPECT_EQ(choose(8, 16, 16384), 128);
  // The busiest multiprocessor has 3 blocks of 128, or 2 of 256.
  EXPECT_EQ(choose(8, 16, 49152), 128);
  EXPECT_EQ(choose(8, 16, 131072), 256);
  EXPECT_EQ(choose(8, 16, 1 << 24), 256);
  EXPECT_EQ(choose(1, 3, 1 << 24), 128);
  EXPECT_EQ(choose(4, 8, 1 << 24, true), 128);
  EXPECT_EQ(choose(4, 7, 1 << 24, true), 256);
  // The code is for blocks of one size.
  EXPECT_EQ(choose(0, 0, 16384), 256);
}

// A check that failed on the device is raised by the next synchronisation,
// once.
TEST_F(Cuda, FailedChecksAreRaisedAtSynchronisation) {
  if (!isFake())
    GTEST_SKIP() << "writes the record from the host";
  std::vector<Site> sites = {{"saxpy", "a.py", "x", 7, 9}};
  DeviceErrorRecord record(0, sites);
  auto *written = reinterpret_cast<ErrorRecord *>(record.address());
  written->index[0] = 12;
  written->shape[0] = 10;
  written->rank = 1;
  written->flag = 1;
  try {
    synchronizeDevice(0);
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Launch);
    EXPECT_EQ(error.message,
              "kernel 'saxpy': index (12,) is out of bounds for array 'x' of "
              "shape (10,)");
    EXPECT_EQ(error.file, "a.py");
    EXPECT_EQ(error.line, 7);
  }
  synchronizeDevice(0);
}

namespace {
/// Kernels that search a mesh.
class LinkedCode : public Cuda {
protected:
  void SetUp() override {
    Cuda::SetUp();
    KernelCache::get().setEnabled(false);
    objects = fakeSymbol<int()>("fakeCudaLinkedObjects");
    setLinksObjects = fakeSymbol<void(bool)>("fakeCudaSetLinksObjects");
    if (!objects && !IsSkipped())
      GTEST_SKIP() << "needs the fake driver";
  }

  std::unique_ptr<Kernel> kernelOf(bool searches, bool fastMath = false) {
    std::string text = R"(
func.func @cast(%mesh: ui64, %x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %root = warp.constant -1 : si32
  %far = warp.constant 1.0e+03 : f32
  %zero = warp.constant 0.0 : f32
  %from = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %hit:4 = warp.library_call "warp_mesh_ray"(%mesh, %from, %zero, %zero, %zero, %zero, %far, %far, %root)
      : (ui64, f32, f32, f32, f32, f32, f32, f32, si32) -> (si32, f32, f32, f32)
  warp.store )";
    text += searches ? "%hit#1" : "%far";
    text += R"(, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
})";
    KernelOptions options;
    options.quickFirst = true;
    options.fastMath = fastMath;
    return std::make_unique<Kernel>(Module::fromText(text), "cast", options);
  }

  /// Objects that a launch had linked.
  int launch(Kernel &kernel, int count) {
    std::vector<char> params(kernel.parameterSize());
    ArrayDescriptor x = view(nullptr, {count}, {4});
    std::memcpy(params.data() + kernel.parameters()[1].offset, &x, sizeof(x));
    LaunchDim dim;
    dim.extent[0] = count;
    int before = objects();
    kernel.launch(0, dim, params.data());
    return objects() - before;
  }

  int (*objects)() = nullptr;
  void (*setLinksObjects)(bool) = nullptr;
};
} // namespace

// The tier-0 code of a kernel that searches is linked, tier-1 code comes with
// the second launch, with a first one of many threads, or by a graph.
TEST_F(LinkedCode, IsThereFirst) {
  std::unique_ptr<Kernel> small = kernelOf(true), large = kernelOf(true);
  auto optimised = [](Kernel &kernel) {
    waitForBackground();
    return kernel.compileTimes()["compile"];
  };
  EXPECT_GT(launch(*small, 100), 0);
  double first = optimised(*small);
  EXPECT_EQ(launch(*small, 100), 0);
  EXPECT_GT(optimised(*small), first);
  first = optimised(*small);
  EXPECT_EQ(launch(*small, 100), 0);
  EXPECT_EQ(optimised(*small), first);

  EXPECT_GT(launch(*large, 1 << 21), 0);
  first = optimised(*large);
  EXPECT_EQ(launch(*large, 1 << 21), 0);
  EXPECT_EQ(optimised(*large), first);
}

TEST_F(LinkedCode, IsOnlyForKernelsThatCallTheLibrary) {
  EXPECT_EQ(launch(*kernelOf(false), 100), 0);
  EXPECT_EQ(launch(*kernelOf(true, /*fastMath=*/true), 100), 0);
}

// A graph runs the tier-0 code that it has recorded, and tier-1 code as soon as
// that is there; a graph that it is part of, likewise.
TEST_F(LinkedCode, LeavesGraphs) {
  auto lastFunction = fakeSymbol<void *()>("fakeCudaLastFunction");
  std::unique_ptr<Kernel> kernel = kernelOf(true);
  auto capture = Capture::begin(0);
  EXPECT_GT(launch(*kernel, 100), 0);
  std::shared_ptr<Graph> graph = capture->end();
  EXPECT_EQ(graph->provisionalLaunches(), 1u);
  auto outerCapture = Capture::begin(0);
  graph->launch();
  std::shared_ptr<Graph> outer = outerCapture->end();
  waitForBackground();
  EXPECT_EQ(outer->provisionalLaunches(), 1u);

  auto later = Capture::begin(0);
  launch(*kernel, 100);
  std::shared_ptr<Graph> best = later->end();
  EXPECT_EQ(best->provisionalLaunches(), 0u);
  best->launch();
  void *tier1 = lastFunction();
  graph->launch();
  EXPECT_EQ(lastFunction(), tier1);
  EXPECT_EQ(graph->provisionalLaunches(), 0u);
}

TEST_F(LinkedCode, StaysInGraphsThatTheDriverDoesNotUpdate) {
  auto setUpdates = fakeSymbol<void(bool)>("fakeCudaSetUpdatesGraphs");
  std::unique_ptr<Kernel> kernel = kernelOf(true);
  auto capture = Capture::begin(0);
  launch(*kernel, 100);
  std::shared_ptr<Graph> graph = capture->end();
  waitForBackground();
  setUpdates(false);
  for (int i = 0; i < 2; ++i) {
    graph->launch();
    EXPECT_EQ(graph->provisionalLaunches(), 1u);
  }
  setUpdates(true);
}

// Nobody updates the graph of another library.
TEST_F(LinkedCode, IsNotInGraphsOfOthers) {
  std::unique_ptr<Kernel> kernel = kernelOf(true);
  auto inner = Capture::begin(0);
  auto outer = Capture::begin(0, nullptr, CaptureMode::ThreadLocal,
                              /*external=*/true);
  EXPECT_EQ(launch(*kernel, 100), 0);
  outer->end();
  inner->end();
}

// Last: who was refused once does not ask again.
TEST_F(LinkedCode, IsNotNeeded) {
  setLinksObjects(false);
  EXPECT_EQ(launch(*kernelOf(true), 100), 1);
  setLinksObjects(true);
  EXPECT_EQ(launch(*kernelOf(true), 100), 0);
}
