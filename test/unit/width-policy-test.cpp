//===- width-policy-test.cpp - Adaptive thread count of loops -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Machines are formulas here: the policy is told what they say a launch takes.
//
//===----------------------------------------------------------------------===//

#include "Runtime/WidthPolicy.h"

#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <vector>

using namespace warp;

namespace {

constexpr int threads = 16;
constexpr int64_t manyItems = 1 << 20;

/// Nanoseconds of launch number `launch` at a width.
using Machine = std::function<double(int width, int launch)>;

/// Widths of `launches` launches.
std::vector<int> launch(WidthPolicy &policy, int launches,
                        const Machine &machine, int64_t items = manyItems) {
  std::vector<int> widths;
  for (int i = 0; i < launches; ++i) {
    int width = policy.plan(items, threads).width;
    policy.record(items, width, machine(width, i));
    widths.push_back(width);
  }
  return widths;
}

/// The width of most launches after the first half.
int settled(const std::vector<int> &widths) {
  std::vector<int> rest(widths.begin() + widths.size() / 2, widths.end());
  std::nth_element(rest.begin(), rest.begin() + rest.size() / 2, rest.end());
  return rest[rest.size() / 2];
}

/// Work that divides without loss.
Machine scaling(double nanoseconds) {
  return [=](int width, int) { return nanoseconds / width; };
}

/// Work that no more than `useful` threads make faster.
Machine saturating(double nanoseconds, int useful) {
  return [=](int width, int) { return nanoseconds / std::min(width, useful); };
}

} // namespace

TEST(WidthPolicy, BeginsWithAllThreadsAndTheLoopsOwnChunk) {
  WidthPolicy policy;
  WidthPolicy::Plan plan = policy.plan(1000, threads);
  EXPECT_EQ(plan.width, threads);
  EXPECT_EQ(plan.chunk, 0);
}

TEST(WidthPolicy, LittleWorkIsSerial) {
  WidthPolicy policy;
  EXPECT_EQ(settled(launch(policy, 20, scaling(5e3))), 1);
}

// Between one thread and all, a thread gets at least three microseconds.
TEST(WidthPolicy, SomeWorkGetsSomeThreads) {
  WidthPolicy policy;
  EXPECT_EQ(settled(launch(policy, 20, scaling(13e3))), 4);
  EXPECT_EQ(settled(launch(policy, 20, scaling(60e3))), threads);
}

TEST(WidthPolicy, OneSlowLaunchChangesNothing) {
  WidthPolicy policy;
  std::vector<int> widths = launch(policy, 40, [](int width, int launch) {
    return launch == 20 ? 10e6 : 5e3 / width;
  });
  EXPECT_EQ(*std::max_element(widths.begin() + 2, widths.end()), 1);
}

TEST(WidthPolicy, MoreWorkThanBeforeIsSeenAtOnce) {
  WidthPolicy policy;
  launch(policy, 20, scaling(5e3));
  std::vector<int> widths = launch(policy, 3, scaling(1e6));
  EXPECT_EQ(widths.back(), threads);
}

TEST(WidthPolicy, SmallestChunkTakesThreeMicroseconds) {
  WidthPolicy policy;
  launch(policy, 20, scaling(1e6));
  double perItem = 1e6 / double(manyItems);
  double chunk = double(policy.plan(manyItems, threads).chunk) * perItem;
  EXPECT_NEAR(chunk, 3e3, 2 * perItem);
  // An item that takes longer is a chunk.
  WidthPolicy heavy;
  launch(heavy, 20, scaling(1e6), 100);
  EXPECT_EQ(heavy.plan(100, threads).chunk, 1);
}

TEST(WidthPolicy, ThreadsThatAddNothingSleep) {
  for (int useful : {1, 4, 8}) {
    WidthPolicy policy;
    EXPECT_EQ(settled(launch(policy, 4000, saturating(4e6, useful))), useful);
  }
}

// Finding out costs little where all threads help.
TEST(WidthPolicy, WorkThatScalesKeepsAllThreads) {
  WidthPolicy policy;
  std::vector<int> widths = launch(policy, 10000, scaling(4e6));
  EXPECT_EQ(settled(widths), threads);
  EXPECT_LT(std::count_if(widths.begin(), widths.end(),
                          [](int width) { return width != threads; }),
            30);
}

// Others take all cores but one, for long; then they are gone.
TEST(WidthPolicy, ComesBackWhenTheMachineIsQuiet) {
  WidthPolicy policy;
  EXPECT_EQ(settled(launch(policy, 4000, saturating(4e6, 1))), 1);
  EXPECT_EQ(settled(launch(policy, 1000, scaling(4e6))), threads);
}

// Forty launches of each hundred find all cores but one taken: the width stays.
TEST(WidthPolicy, BurstsAreNotMistakenForASlowMachine) {
  WidthPolicy policy;
  std::vector<int> widths = launch(policy, 10000, [](int width, int launch) {
    return launch % 100 < 40 ? 4e6 : 4e6 / width;
  });
  EXPECT_EQ(settled(widths), threads);
}

// A trial that is not carried out as planned proves nothing.
TEST(WidthPolicy, FewerThreadsThanPlannedEndATrial) {
  WidthPolicy policy;
  for (int i = 0; i < 2000; ++i) {
    policy.plan(manyItems, threads);
    policy.record(manyItems, 1, 4e6);
  }
  EXPECT_EQ(policy.plan(manyItems, threads).width, threads);
}

// Waking a thread takes longer than such a launch, and so does asking.
TEST(WidthPolicy, LaunchesThatAreOverBeforeAThreadWakesAreBrief) {
  WidthPolicy policy;
  EXPECT_FALSE(policy.isBrief(256));
  policy.record(256, 1, 1000);
  EXPECT_TRUE(policy.isBrief(256));
  EXPECT_FALSE(policy.isBrief(4096));
  policy.record(256, 1, 1e5);
  EXPECT_FALSE(policy.isBrief(256));
}

TEST(LoopHistory, IsBriefForSizesOfOnePowerOfTwo) {
  LoopHistory history;
  EXPECT_FALSE(history.isBrief(256));
  history.setBrief(300, true);
  for (int64_t items : {256, 300, 511})
    EXPECT_TRUE(history.isBrief(items)) << items;
  for (int64_t items : {1, 255, 512, 1 << 20})
    EXPECT_FALSE(history.isBrief(items)) << items;
  history.setBrief(1, true);
  history.setBrief(256, false);
  EXPECT_TRUE(history.isBrief(1));
  EXPECT_FALSE(history.isBrief(300));
}

TEST(Chunks, ShrinkTowardsTheEndAndCoverAll) {
  for (int64_t items : {1, 63, 64, 1000, 123456}) {
    int64_t left = items, last = items, count = 0;
    while (left > 0) {
      int64_t size = nextChunk(left, 100, 64);
      ASSERT_GE(size, 1);
      ASSERT_LE(size, std::min(left, last));
      ASSERT_TRUE(size % 64 == 0 || size == left);
      last = size;
      left -= size;
      ++count;
    }
    EXPECT_LE(count, 40) << items;
  }
  EXPECT_EQ(nextChunk(1 << 20, 64, 64), 1 << 18);
}

TEST(Chunks, KeepVectorsWholeWhereThreadsHaveEnough) {
  EXPECT_EQ(chunkAlignment(1 << 20, 1, 16), 64);
  EXPECT_EQ(chunkAlignment(1000, 100, 16), 64);
  EXPECT_EQ(chunkAlignment(2048, 1, 16), 16);
  EXPECT_EQ(chunkAlignment(1000, 20, 16), 16);
  EXPECT_EQ(chunkAlignment(200, 1, 16), 1);
}
