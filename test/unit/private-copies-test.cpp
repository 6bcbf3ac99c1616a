//===- private-copies-test.cpp - Launches on copies of arrays -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Runtime/KernelImpl.h"
#include "Runtime/PrivateCopies.h"
#include "warp/KernelCache.h"
#include "warp/ThreadPool.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

using namespace warp;

/// count[at[i]] += 1 and sum[at[i]] -= (1, 2)
static const char *const scatterText = R"(
!V = !warp.vec<2 x f64>
module @scatter {
  func.func @scatter(%at: !warp.array<1 x si32>, %count: !warp.array<1 x si32>,
                     %sum: !warp.array<1 x !V>)
      attributes {warp.arg_names = ["at", "count", "sum"], warp.kernel} {
    %i = warp.tid : si32
    %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
    %one = warp.constant 1 : si32
    %old = warp.atomic add %one, %count[%j]
        : si32, !warp.array<1 x si32>, si32 -> si32
    %a = warp.constant 1.0 : f64
    %b = warp.constant 2.0 : f64
    %v = warp.construct(%a, %b) : (f64, f64) -> !V
    %was = warp.atomic sub %v, %sum[%j] : !V, !warp.array<1 x !V>, si32 -> !V
    return
  }
})";

namespace {

struct ScatterParams {
  LaunchHeader header;
  ArrayDescriptor at, count, sum;
};

ArrayDescriptor arrayOf(void *data, int64_t count, int stride) {
  ArrayDescriptor array;
  array.data = data;
  array.ndim = 1;
  array.shape[0] = static_cast<int32_t>(count);
  array.strides[0] = stride;
  return array;
}

/// Arrays of one launch, and what it should leave in them.
struct Scatter {
  Scatter(int items, int bins)
      : at(items), count(bins), expected(bins), sum(2 * bins) {
    for (int i = 0; i < items; ++i) {
      at[i] = static_cast<int>((int64_t(i) * 7919 + i / 3) % bins);
      ++expected[at[i]];
    }
    params.at = arrayOf(at.data(), items, 4);
    params.count = arrayOf(count.data(), bins, 4);
    params.sum = arrayOf(sum.data(), bins, 16);
    dim.extent[0] = items;
  }

  void expectAfter(int launches) const {
    for (size_t i = 0; i < count.size(); ++i) {
      ASSERT_EQ(count[i], launches * expected[i]) << i;
      ASSERT_EQ(sum[2 * i], -launches * expected[i]) << i;
      ASSERT_EQ(sum[2 * i + 1], -2 * launches * expected[i]) << i;
    }
  }

  std::vector<int> at, count, expected;
  std::vector<double> sum;
  ScatterParams params;
  LaunchDim dim;
};

UpdateMode modeOf(const Kernel::Plan &plan, const void *params) {
  return chooseUpdates(plan.variant->code.schedule.copied, params, plan.items);
}

class PrivateCopiesTest : public testing::Test {
protected:
  void SetUp() override { KernelCache::get().setEnabled(false); }

  Kernel kernel{Module::fromText(scatterText), "scatter"};
};

} // namespace

TEST_F(PrivateCopiesTest, SumsAreExactLaunchAfterLaunch) {
  for (int bins : {1, 15, 16, 1000, 40001}) {
    Scatter scatter(400000, bins);
    for (int launches = 1; launches <= 3; ++launches) {
      Kernel::Plan plan =
          kernel.prepare(cpuDevice, scatter.dim, &scatter.params);
      ASSERT_EQ(plan.variant->code.schedule.copied.list.size(),
                ThreadPool::size() > 1 ? 2u : 0u);
      if (ThreadPool::size() > 1)
        EXPECT_EQ(modeOf(plan, &scatter.params), UpdateMode::Copies) << bins;
      kernel.run(plan, &scatter.params);
      scatter.expectAfter(launches);
    }
  }
}

TEST_F(PrivateCopiesTest, LargeArraysHaveNone) {
  Scatter scatter(100000, 4000000);
  Kernel::Plan plan = kernel.prepare(cpuDevice, scatter.dim, &scatter.params);
  EXPECT_NE(modeOf(plan, &scatter.params), UpdateMode::Copies);
  kernel.run(plan, &scatter.params);
  scatter.expectAfter(1);
}

// Every second element of a longer array: its extent is not known.
TEST_F(PrivateCopiesTest, StridedArraysHaveNone) {
  Scatter scatter(400000, 100);
  std::vector<int> wide(200, 5);
  scatter.params.count = arrayOf(wide.data(), 100, 8);
  Kernel::Plan plan = kernel.prepare(cpuDevice, scatter.dim, &scatter.params);
  EXPECT_NE(modeOf(plan, &scatter.params), UpdateMode::Copies);
  kernel.run(plan, &scatter.params);
  for (int i = 0; i < 200; ++i)
    ASSERT_EQ(wide[i], i % 2 ? 5 : 5 + scatter.expected[i / 2]);
}

// The counts lie in the halves of the sums: nothing may be copied.
TEST_F(PrivateCopiesTest, OverlappingArraysHaveNone) {
  Scatter scatter(400000, 100);
  std::vector<int64_t> memory(200);
  scatter.params.count = arrayOf(memory.data() + 100, 100, 8);
  scatter.params.sum = arrayOf(memory.data(), 100, 16);
  Kernel::Plan plan = kernel.prepare(cpuDevice, scatter.dim, &scatter.params);
  EXPECT_TRUE(plan.variant->code.schedule.copied.list.empty());
}

TEST_F(PrivateCopiesTest, CallersTakeTurns) {
  Scatter scatter(200000, 3000);
  std::vector<std::thread> callers;
  for (int i = 0; i < 4; ++i)
    callers.emplace_back([&] {
      ScatterParams own = scatter.params;
      for (int launch = 0; launch < 10; ++launch)
        kernel.launch(cpuDevice, scatter.dim, &own);
    });
  for (std::thread &caller : callers)
    caller.join();
  scatter.expectAfter(40);
}

// A process that was forked has workers and copies of its own.
TEST_F(PrivateCopiesTest, ForkedProcessesSumToo) {
  Scatter scatter(400000, 1000);
  kernel.launch(cpuDevice, scatter.dim, &scatter.params);
  pid_t child = fork();
  ASSERT_GE(child, 0);
  kernel.launch(cpuDevice, scatter.dim, &scatter.params);
  if (child == 0) {
    scatter.expectAfter(2);
    _exit(testing::Test::HasFailure());
  }
  scatter.expectAfter(2);
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

// A worker without gradients must not get any.
TEST(PrivateCopies, LeavesNullPointersAlone) {
  int numbers[4] = {1, 2, 3, 4};
  ScatterParams params;
  params.count = arrayOf(numbers, 4, 4);
  CopiedArrays copied;
  int64_t offset = offsetof(ScatterParams, count);
  copied.list = {{offset, 0, 4, 1, 32, 0}, {offset, 1, 4, 1, 32, 1}};
  PrivateCopies copies(copied, &params, sizeof(params));
  EXPECT_EQ(copies.paramsOf(0), &params);
  for (int worker = 1; worker < ThreadPool::size(); ++worker) {
    ScatterParams own;
    std::memcpy(&own, copies.paramsOf(worker), sizeof(own));
    EXPECT_EQ(own.count.grad, nullptr);
    EXPECT_NE(own.count.data, params.count.data);
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(static_cast<int *>(own.count.data)[i], 0);
      static_cast<int *>(own.count.data)[i] = 10 * i;
    }
  }
  copies.merge();
  for (int i = 0; i < 4; ++i)
    EXPECT_EQ(numbers[i], i + 1 + (ThreadPool::size() - 1) * 10 * i);
}

// least[at[i]] = min(.., value), most of unsigned numbers and of floats alike.
static const char *const extremesText = R"(
module @extremes {
  func.func @extremes(%at: !warp.array<1 x si32>, %value: !warp.array<1 x f32>,
                      %number: !warp.array<1 x ui64>,
                      %least: !warp.array<1 x f32>,
                      %most: !warp.array<1 x ui64>)
      attributes {warp.kernel} {
    %i = warp.tid : si32
    %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %value[%i] : !warp.array<1 x f32>, si32 -> f32
    %n = warp.load %number[%i] : !warp.array<1 x ui64>, si32 -> ui64
    %a = warp.atomic min %v, %least[%j]
        : f32, !warp.array<1 x f32>, si32 -> f32
    %b = warp.atomic max %n, %most[%j]
        : ui64, !warp.array<1 x ui64>, si32 -> ui64
    return
  }
})";

// Copies keep minima and maxima apart from each other and from no number at
// all.
TEST(PrivateCopies, KeepExtremes) {
  KernelCache::get().setEnabled(false);
  struct {
    LaunchHeader header;
    ArrayDescriptor at, value, number, least, most;
  } params;
  constexpr int items = 400000, bins = 1000;
  std::vector<int> at(items);
  std::vector<float> value(items), least(bins, NAN), expectedLeast(bins, NAN);
  std::vector<uint64_t> number(items), most(bins), expectedMost(bins);
  for (int i = 0; i < items; ++i) {
    // No thread comes to the last element; one in seven has no number.
    at[i] = static_cast<int>(int64_t(i) * 7919 % (bins - 1));
    value[i] = i % 7 ? float(i * 31 % 10007 - 5000) : NAN;
    number[i] = (uint64_t(1) << 63) + uint64_t(i) * 2654435761u % 100003;
    expectedLeast[at[i]] = std::fmin(expectedLeast[at[i]], value[i]);
    expectedMost[at[i]] = std::max(expectedMost[at[i]], number[i]);
  }
  params.at = arrayOf(at.data(), items, 4);
  params.value = arrayOf(value.data(), items, 4);
  params.number = arrayOf(number.data(), items, 8);
  params.least = arrayOf(least.data(), bins, 4);
  params.most = arrayOf(most.data(), bins, 8);
  LaunchDim dim;
  dim.extent[0] = items;
  Kernel kernel(Module::fromText(extremesText), "extremes");
  for (int launch = 0; launch < 3; ++launch) {
    Kernel::Plan plan = kernel.prepare(cpuDevice, dim, &params);
    if (ThreadPool::size() > 1)
      EXPECT_EQ(modeOf(plan, &params), UpdateMode::Copies);
    kernel.run(plan, &params);
    for (int i = 0; i < bins - 1; ++i) {
      ASSERT_EQ(least[i], expectedLeast[i]) << i;
      ASSERT_EQ(most[i], expectedMost[i]) << i;
    }
    EXPECT_TRUE(std::isnan(least[bins - 1]));
    EXPECT_EQ(most[bins - 1], 0u);
  }
}
