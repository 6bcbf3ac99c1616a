//===- launch-trial-test.cpp - Schedules of GPUs on live launches ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Runtime/LaunchTrial.h"

#include <gtest/gtest.h>

using namespace warp;

namespace {

/// A timer whose launches take what the test says.
struct FakeTimer : LaunchTimer {
  double next = 0;
  bool isOver = true;

  void start(const Stream *) override {}
  void stop(const Stream *) override {}
  std::optional<double> elapsed() override {
    return isOver ? std::optional(next) : std::nullopt;
  }
};

struct Trial {
  int compiled = 0, launched[2] = {0, 0};
  std::optional<TrialTimes> found;
  FakeTimer *timer = nullptr;
  LaunchTrial trial{[this] { ++compiled; },
                    [this](const TrialTimes &times) { found = times; }};

  void begin() {
    auto made = std::make_unique<FakeTimer>();
    timer = made.get();
    trial.begin(std::move(made));
  }
  bool launch(int64_t items, double schedule, double plain) {
    return trial.measure({items, 1, 1, 1}, nullptr, [&](bool byPlain) {
      ++launched[byPlain];
      timer->next = byPlain ? plain : schedule;
    });
  }
};

} // namespace

TEST(LaunchTrial, CodeIsCompiledOnceLaunchesHaveDoneEnough) {
  Trial one;
  for (int i = 0; i < 1000; ++i)
    EXPECT_FALSE(one.launch(256, 1, 1));
  EXPECT_EQ(one.compiled, 1);
  Trial large;
  EXPECT_FALSE(large.launch(int64_t(1) << 31, 1, 1));
  EXPECT_EQ(large.compiled, 1);
}

TEST(LaunchTrial, BothAreLaunchedEquallyOften) {
  Trial one;
  one.begin();
  int count = 0;
  while (one.trial.isOpen()) {
    one.launch(1000, 4000, 2000);
    ASSERT_LT(++count, 100);
  }
  EXPECT_EQ(one.launched[0], 14);
  EXPECT_EQ(one.launched[1], 14);
  ASSERT_TRUE(one.found);
  EXPECT_DOUBLE_EQ(one.found->chosen, 4);
  EXPECT_DOUBLE_EQ(one.found->plain, 2);
  EXPECT_TRUE(one.found->prefersPlain());
  EXPECT_FALSE(one.launch(1000, 1, 1));
}

TEST(LaunchTrial, NoLaunchWaitsForAnEvent) {
  Trial one;
  one.begin();
  EXPECT_TRUE(one.launch(1000, 4, 2));
  one.timer->isOver = false;
  for (int i = 0; i < 10; ++i)
    EXPECT_FALSE(one.launch(1000, 4, 2));
  one.timer->isOver = true;
  EXPECT_TRUE(one.launch(1000, 4, 2));
  EXPECT_EQ(one.launched[0], 1);
  EXPECT_EQ(one.launched[1], 1);
}

// Launches of one size are compared; if no more of them come, those of another.
TEST(LaunchTrial, OtherExtentsDoNotCount) {
  Trial one;
  one.begin();
  EXPECT_TRUE(one.launch(1000, 4, 2));
  int misses = 0;
  while (!one.launch(2000, 4, 2))
    ASSERT_LT(++misses, 100);
  EXPECT_GT(misses, 10);
  EXPECT_FALSE(one.launch(1000, 4, 2));
}

TEST(LaunchTrial, WithoutPlainCodeItIsOver) {
  Trial one;
  one.trial.begin(nullptr);
  EXPECT_FALSE(one.trial.isOpen());
  EXPECT_FALSE(one.trial.result());
}
