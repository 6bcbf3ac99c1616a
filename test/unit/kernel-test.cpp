//===- kernel-test.cpp - Kernels from C++, without Python -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Runtime.h"

#include <atomic>
#include <cstring>
#include <gtest/gtest.h>
#include <numeric>
#include <thread>
#include <vector>

using namespace warp;

/// y[i] = x[i] + s
static const char *const addText = R"(
module @add {
  func.func @add(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %s: f32)
      attributes {warp.arg_names = ["x", "y", "s"], warp.kernel} {
    %i = warp.tid : si32
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.add(%v, %s) : (f32, f32) -> f32
    warp.store %w, %y[%i] : f32, !warp.array<1 x f32>, si32
    return
  }
})";

/// count[0] += 1, for launches of any rank
static const char *const countText = R"(
module @count {
  func.func @count(%x: !warp.array<1 x si32>)
      attributes {warp.arg_names = ["x"], warp.kernel} {
    %zero = warp.constant 0 : si32
    %one = warp.constant 1 : si32
    %old = warp.atomic add %one, %x[%zero]
        : si32, !warp.array<1 x si32>, si32 -> si32
    return
  }
})";

namespace {

struct AddParams {
  LaunchHeader header;
  ArrayDescriptor x, y;
  float s;
};

ArrayDescriptor vectorOf(void *data, int count, int stride = 4) {
  ArrayDescriptor array;
  array.data = data;
  array.ndim = 1;
  array.shape[0] = count;
  array.strides[0] = stride;
  return array;
}

LaunchDim dimOf(std::vector<int64_t> extents) {
  LaunchDim dim;
  dim.rank = static_cast<int>(extents.size());
  std::copy(extents.begin(), extents.end(), dim.extent);
  return dim;
}

class KernelTest : public testing::Test {
protected:
  void SetUp() override { KernelCache::get().setEnabled(false); }
};

} // namespace

TEST_F(KernelTest, DescribesItsParameters) {
  Kernel kernel(Module::fromText(addText), "add");
  const std::vector<Param> &params = kernel.parameters();
  ASSERT_EQ(params.size(), 3u);
  EXPECT_EQ(params[0].name, "x");
  EXPECT_EQ(params[0].kind, Param::Kind::Array);
  EXPECT_EQ(params[0].element, "f32");
  EXPECT_EQ(params[0].offset, int64_t(offsetof(AddParams, x)));
  EXPECT_EQ(params[0].arrays, std::vector<int64_t>{0});
  EXPECT_EQ(params[1].offset, int64_t(offsetof(AddParams, y)));
  EXPECT_EQ(params[2].kind, Param::Kind::Scalar);
  EXPECT_EQ(params[2].offset, int64_t(offsetof(AddParams, s)));
  EXPECT_EQ(kernel.parameterSize(), sizeof(AddParams));
}

// Sizes below and above the threshold of the thread pool, packed and strided.
TEST_F(KernelTest, RunsOnTheCpu) {
  Kernel kernel(Module::fromText(addText), "add");
  for (int count : {1, 7, 1000, 1000003})
    for (int step : {1, 2}) {
      std::vector<float> x(count * step), y(count, -1.0f);
      std::iota(x.begin(), x.end(), 0.0f);
      AddParams params{{},
                       vectorOf(x.data(), count, 4 * step),
                       vectorOf(y.data(), count),
                       0.5f};
      kernel.launch(cpuDevice, dimOf({count}), &params);
      for (int i = 0; i < count; ++i)
        ASSERT_EQ(y[i], x[i * step] + 0.5f) << count << " " << i;
    }
}

TEST_F(KernelTest, RunsEveryThreadOnceForEachRank) {
  Kernel kernel(Module::fromText(countText), "count");
  for (const std::vector<int64_t> &extents :
       {std::vector<int64_t>{100000}, {300, 301}, {40, 50, 60}, {9, 8, 7, 6}}) {
    int count = 0;
    struct {
      LaunchHeader header;
      ArrayDescriptor x;
    } params{{}, vectorOf(&count, 1)};
    kernel.launch(cpuDevice, dimOf(extents), &params);
    int64_t expected = 1;
    for (int64_t extent : extents)
      expected *= extent;
    EXPECT_EQ(count, expected);
  }
}

TEST_F(KernelTest, ChecksExtents) {
  Kernel kernel(Module::fromText(addText), "add");
  AddParams params{};
  kernel.launch(cpuDevice, dimOf({0}), &params);
  kernel.launch(cpuDevice, dimOf({5, 0, 3}), &params);
  auto message = [&](const LaunchDim &dim) {
    try {
      kernel.launch(cpuDevice, dim, &params);
    } catch (const Error &error) {
      EXPECT_EQ(error.kind, Error::Kind::LaunchValue);
      return error.message;
    }
    return std::string();
  };
  EXPECT_EQ(message(dimOf({3, -1})),
            "launch('add'): expects non-negative extents, but got '-1' for "
            "dimension 1");
  EXPECT_EQ(message(dimOf({int64_t(1) << 31})),
            "launch('add'): expects extents below 2^31, but got '2147483648' "
            "for dimension 0");
  EXPECT_EQ(message(dimOf({INT32_MAX, INT32_MAX, INT32_MAX, 2})),
            "launch('add'): expects less than 2^63 threads in all");
  LaunchDim none;
  none.rank = 0;
  EXPECT_EQ(message(none),
            "launch('add'): expects 1 to 4 dimensions, but got 0");
}

TEST_F(KernelTest, DebugModeNamesTheAccess) {
  KernelOptions options;
  options.debug = true;
  Kernel kernel(Module::fromText(addText), "add", options);
  std::vector<float> x(10), y(8);
  AddParams params{{}, vectorOf(x.data(), 10), vectorOf(y.data(), 8), 1.0f};
  kernel.launch(cpuDevice, dimOf({8}), &params);
  try {
    kernel.launch(cpuDevice, dimOf({9}), &params);
    FAIL();
  } catch (const Error &error) {
    EXPECT_EQ(error.kind, Error::Kind::Launch);
    EXPECT_EQ(error.message, "kernel 'add': index (8,) is out of bounds for "
                             "array 'y' of shape (8,)");
  }
}

// Threads that need the same variant at once get one, compiled once.
TEST_F(KernelTest, FirstLaunchFromManyThreads) {
  Kernel kernel(Module::fromText(addText), "add");
  std::atomic<int> wrong{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t)
    threads.emplace_back([&, t] {
      std::vector<float> x(5000, float(t)), y(5000);
      AddParams params{
          {}, vectorOf(x.data(), 5000), vectorOf(y.data(), 5000), 1.0f};
      for (int round = 0; round < 20; ++round)
        kernel.launch(cpuDevice, dimOf({5000}), &params);
      for (float value : y)
        wrong += value != float(t) + 1.0f;
    });
  for (std::thread &thread : threads)
    thread.join();
  EXPECT_EQ(wrong.load(), 0);
}

TEST_F(KernelTest, CachedCodeRuns) {
  char folder[] = "/tmp/warp-kernel-test-XXXXXX";
  KernelCache &cache = KernelCache::get();
  cache.setDirectory(mkdtemp(folder));
  cache.setEnabled(true);
  for (int round = 0; round < 2; ++round) {
    Kernel kernel(Module::fromText(addText), "add");
    std::vector<float> x(100, 2.0f), y(100);
    AddParams params{
        {}, vectorOf(x.data(), 100), vectorOf(y.data(), 100), 1.0f};
    kernel.launch(cpuDevice, dimOf({100}), &params);
    EXPECT_EQ(y[99], 3.0f);
    EXPECT_EQ(kernel.compileTimes().count("compile"), round == 0 ? 1u : 0u);
  }
  EXPECT_EQ(cache.clear(), 1);
  rmdir(folder);
}
