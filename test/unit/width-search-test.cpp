//===- width-search-test.cpp - Widths that lane trials compare ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Runtime/WidthSearch.h"

#include <gtest/gtest.h>

#include <map>

using namespace warp;

/// The widths that are compared where each takes so long, and the last best.
static std::pair<std::vector<int>, int>
search(int chosen, std::map<int, double> times, int row = 0) {
  WidthSearch widths(chosen, row);
  std::vector<TrialTimes> rounds;
  std::vector<int> tried;
  while (int other = widths.getNext()) {
    EXPECT_TRUE(times.count(other)) << other;
    rounds.push_back({times[widths.getBest()], times[other]});
    tried.push_back(other);
    widths.add(rounds.back());
    if (tried.size() > 8)
      break;
  }
  // Another process comes to the same by the times.
  WidthSearch again(chosen, row, rounds);
  EXPECT_EQ(again.getBest(), widths.getBest());
  EXPECT_EQ(again.getNext(), 0);
  EXPECT_EQ(again.getPairs().size(), tried.size());
  for (size_t i = 0; i < tried.size(); ++i)
    EXPECT_EQ(again.getPairs()[i].other, tried[i]);
  return {tried, widths.getBest()};
}

using Widths = std::pair<std::vector<int>, int>;

TEST(WidthSearch, LanesAreComparedWithScalarCodeAndWiderOnes) {
  EXPECT_EQ(search(16, {{1, 9}, {16, 2}, {32, 3}}), Widths({1, 32}, 16));
  EXPECT_EQ(search(16, {{1, 9}, {16, 2}, {32, 1}}), Widths({1, 32}, 32));
  EXPECT_EQ(search(32, {{1, 9}, {16, 2}, {32, 3}}), Widths({1, 16}, 16));
}

TEST(WidthSearch, WidthsDoubleAsLongAsTheyGain) {
  EXPECT_EQ(search(8, {{1, 9}, {8, 4}, {16, 3}, {32, 2}}),
            Widths({1, 16, 32}, 32));
  EXPECT_EQ(search(4, {{1, 9}, {4, 5}, {8, 4}, {16, 3}, {32, 2}}),
            Widths({1, 8, 16, 32}, 32));
  EXPECT_EQ(search(8, {{1, 9}, {8, 4}, {16, 5}}), Widths({1, 16}, 8));
}

TEST(WidthSearch, ScalarCodeIsComparedWithTwiceTheLanesThatNearlyWon) {
  EXPECT_EQ(search(1, {{1, 10}, {16, 11}, {32, 6}}), Widths({16, 32}, 32));
  EXPECT_EQ(search(1, {{1, 10}, {16, 20}}), Widths({16}, 1));
  EXPECT_EQ(search(1, {{1, 10}, {16, 6}, {32, 5}}), Widths({16, 32}, 32));
  EXPECT_EQ(search(8, {{1, 10}, {8, 12}, {16, 8}, {32, 9}}),
            Widths({1, 16, 32}, 16));
  EXPECT_EQ(search(16, {{1, 10}, {16, 12}, {32, 13}}), Widths({1, 32}, 1));
}

// Code for rows of eight elements has no other lanes.
TEST(WidthSearch, LanesOfARowAreComparedWithScalarCodeAlone) {
  EXPECT_EQ(search(8, {{1, 9}, {8, 4}}, /*row=*/8), Widths({1}, 8));
  EXPECT_EQ(search(8, {{1, 3}, {8, 4}}, /*row=*/8), Widths({1}, 1));
  EXPECT_EQ(search(1, {{1, 3}, {4, 2}}, /*row=*/4), Widths({4}, 4));
  EXPECT_EQ(search(1, {{1, 3}, {16, 4}}, /*row=*/32), Widths({16}, 1));
  EXPECT_EQ(search(12, {{1, 9}, {12, 4}}), Widths({1}, 12));
}

TEST(WidthSearch, NothingFollowsFromUnknownLanes) {
  EXPECT_EQ(WidthSearch(0, 0).getNext(), 0);
}
