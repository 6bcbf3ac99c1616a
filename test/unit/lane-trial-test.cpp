//===- lane-trial-test.cpp - Lanes against scalar threads -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Runtime/KernelImpl.h"
#include "Runtime/LaneTrial.h"

#include <gtest/gtest.h>

#include <chrono>
#include <ctime>
#include <thread>

using namespace warp;

TEST(TrialRatios, PiecesAreAPartOfALaunch) {
  TrialRatios ratios;
  EXPECT_EQ(ratios.pieceOf(511), 0);
  for (int64_t items : {512, 2047, 2048, 5000, 100000, 1 << 30}) {
    int64_t piece = ratios.pieceOf(items);
    EXPECT_GT(piece, 0);
    EXPECT_EQ(piece % 64, 0);
    EXPECT_LE(4 * piece, items < 2048 ? items / 2 : items / 8);
    EXPECT_LE(piece, 1 << 14);
  }
}

// A launch of the same indices is not measured at the same ones each time.
TEST(TrialRatios, EachLaunchIsMeasuredElsewhere) {
  for (int64_t items : {512, 1000, 18736, 1 << 24}) {
    TrialRatios ratios(/*cold=*/2);
    int64_t end = 0, piece = ratios.pieceOf(items);
    for (int launch = 0; launch < 9; ++launch) {
      int64_t place = ratios.placeOf(items);
      EXPECT_EQ(place % 64, 0);
      EXPECT_LE(place + 4 * piece, items);
      if (4 * 9 * piece + 9 * 64 <= items) {
        EXPECT_GE(place, end);
      }
      end = place + 4 * piece;
      ratios.record(piece, 1, 1);
    }
  }
}

// Launches that something else came into count no more than others, cold ones
// not at all.
TEST(TrialRatios, TheMedianDecides) {
  TrialRatios ratios(/*cold=*/2);
  double scalarTimes[] = {9e6, 8e6, 900, 800, 1e6, 850, 870, 2000, 860};
  for (double scalar : scalarTimes) {
    EXPECT_FALSE(ratios.result());
    ratios.record(64, 1280, scalar);
  }
  ASSERT_TRUE(ratios.result());
  EXPECT_DOUBLE_EQ(ratios.result()->chosen, 10);
  EXPECT_DOUBLE_EQ(ratios.result()->plain, 870 / 128.0);
  EXPECT_TRUE(ratios.result()->prefersPlain());
}

TEST(TrialTimes, LanesStayWhereNothingIsCertain) {
  EXPECT_FALSE((TrialTimes{10, 9.7}).prefersPlain());
  EXPECT_FALSE((TrialTimes{10, 20}).prefersPlain());
  EXPECT_TRUE((TrialTimes{10, 9}).prefersPlain());
}

TEST(TrialTimes, TextThatIsNotWholeIsNothing) {
  std::string text = TrialTimes{1.25, 0.5}.toText();
  std::optional<TrialTimes> times = TrialTimes::fromText(text);
  ASSERT_TRUE(times);
  EXPECT_EQ(times->chosen, 1.25);
  EXPECT_EQ(times->plain, 0.5);
  for (size_t length = 0; length < text.size(); ++length)
    EXPECT_FALSE(TrialTimes::fromText(text.substr(0, length))) << length;
  for (const char *wrong :
       {"lanes -1 scalar 2\n", "lanes 0 scalar 2\n", "lanes nan scalar 2\n",
        "lanes 1 scalar inf\n", "lanes 1 scalar 2\nmore"})
    EXPECT_FALSE(TrialTimes::fromText(wrong)) << wrong;
}

namespace {
/// Stands for code; nobody runs it.
struct NoCode : DeviceCode {
  void launch(const Kernel::Plan &, void *, size_t,
              const Stream *) const override {}
};
} // namespace

TEST(LaneTrial, RunsEachIndexOnce) {
  int compiled = 0, finished = 0;
  LaneTrial trial([&] { ++compiled; },
                  [&](const TrialTimes &times) {
                    EXPECT_GT(times.chosen, 0);
                    EXPECT_GT(times.plain, 0);
                    return ++finished == 1;
                  });
  trial.spend(19'000'000);
  EXPECT_EQ(compiled, 0);
  trial.spend(2'000'000);
  trial.spend(1'000'000);
  EXPECT_EQ(compiled, 1);
  EXPECT_EQ(trial.otherCode(), nullptr);
  NoCode code, half;
  trial.begin(&code);
  EXPECT_EQ(trial.otherCode(), &code);
  for (int launch = 0; launch < 18; ++launch) {
    if (launch == 9) {
      // The second round waits for more launches, and then for its code.
      EXPECT_EQ(finished, 1);
      EXPECT_EQ(trial.otherCode(), nullptr);
      trial.spend(99'000'000);
      EXPECT_EQ(compiled, 1);
      trial.spend(2'000'000);
      EXPECT_EQ(compiled, 2);
      trial.begin(&half);
    }
    EXPECT_TRUE(trial.isOpen());
    EXPECT_EQ(trial.results().size(), size_t(launch / 9));
    int64_t first = -1, next = -1, byLanes = 0;
    LaneTrial::Part done =
        trial.measure(launch < 9 ? &code : &half, 10000,
                      [&](bool lanes, int64_t begin, int64_t end) {
                        if (first < 0)
                          first = next = begin;
                        EXPECT_EQ(begin, next);
                        byLanes += lanes ? end - begin : 0;
                        next = end;
                      });
    EXPECT_EQ(done.begin, first);
    EXPECT_EQ(done.end, next);
    EXPECT_EQ(2 * byLanes, done.end - done.begin);
    EXPECT_LE(done.end, 10000);
  }
  EXPECT_EQ(finished, 2);
  EXPECT_FALSE(trial.isOpen());
  EXPECT_EQ(trial.results().size(), 2u);
}

// A launch that began with code of the first round says nothing of the second.
TEST(LaneTrial, LateLaunchesOfARoundDoNotCount) {
  int finished = 0;
  LaneTrial trial([] {}, [&](const TrialTimes &) { return ++finished == 1; });
  NoCode code, half;
  auto none = [](bool, int64_t, int64_t) {};
  trial.begin(&code);
  for (int launch = 0; launch < 9; ++launch)
    trial.measure(&code, 10000, none);
  EXPECT_EQ(finished, 1);
  trial.begin(&half);
  for (int launch = 0; launch < 20; ++launch)
    EXPECT_GT(trial.measure(&code, 10000, none).end, 0);
  EXPECT_EQ(finished, 1);
  for (int launch = 0; launch < 8; ++launch)
    trial.measure(&half, 10000, none);
  EXPECT_EQ(finished, 1);
  trial.measure(&half, 10000, none);
  EXPECT_EQ(finished, 2);
}

TEST(LaneTrial, EndsWithoutCodeToCompareWith) {
  LaneTrial trial([] {},
                  [](const TrialTimes &) {
                    ADD_FAILURE();
                    return false;
                  });
  trial.begin(nullptr);
  EXPECT_FALSE(trial.isOpen());
}

/// Works for some microseconds, whoever has the processor in between.
static void workFor(int64_t microseconds) {
  auto now = [] {
    timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return int64_t(time.tv_sec) * 1'000'000 + time.tv_nsec / 1000;
  };
  for (int64_t end = now() + microseconds; now() < end;)
    ;
}

// Code that works for half as long is quicker, also if the thread loses its
// processor in every one of its pieces.
TEST(LaneTrial, OtherProcessesDoNotCount) {
  std::optional<TrialTimes> found;
  LaneTrial trial([] {},
                  [&](const TrialTimes &times) {
                    found = times;
                    return false;
                  });
  NoCode code;
  trial.begin(&code);
  while (trial.isOpen())
    trial.measure(&code, 1000, [](bool byLanes, int64_t, int64_t) {
      workFor(byLanes ? 400 : 200);
      if (!byLanes)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    });
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->prefersPlain());
}
