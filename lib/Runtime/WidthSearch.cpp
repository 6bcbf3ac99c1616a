//===- WidthSearch.cpp - Widths that lane trials compare ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WidthSearch.h"

#include <algorithm>

using namespace warp;

/// Lanes that scalar code of the model is compared with: it says that they
/// lose, and counts of operations do not know which branches a processor
/// predicts and which loads it has in flight.
static constexpr int lanesForScalar = 16;
/// The most lanes that are compared, and those from which half as many are.
static constexpr int mostLanes = 32;
/// Lanes that take longer, by scalar code's time, are far behind: twice as many
/// would not gain that.
static constexpr double farBehind = 1.4;

WidthSearch::WidthSearch(int chosen, int row,
                         const std::vector<TrialTimes> &rounds)
    : chosen(chosen), best(chosen), row(row) {
  for (const TrialTimes &times : rounds)
    if (getNext() != 0)
      add(times);
}

void WidthSearch::add(const TrialTimes &times) {
  int other = getNext();
  pairs.push_back({best, other});
  ratios.push_back(times.plain / times.chosen);
  if (times.prefersPlain())
    best = other;
}

bool WidthSearch::isTried(int lanes) const {
  return lanes == chosen ||
         std::any_of(pairs.begin(), pairs.end(),
                     [=](Pair pair) { return pair.other == lanes; });
}

double WidthSearch::overScalar(int lanes) const {
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (pairs[i].best == 1 && pairs[i].other == lanes)
      return ratios[i];
    if (pairs[i].best == lanes && pairs[i].other == 1)
      return 1 / ratios[i];
  }
  return 0;
}

int WidthSearch::getNext() const {
  if (best < 1 || pairs.size() == most)
    return 0;
  if (pairs.empty())
    return best > 1  ? 1
           : row > 0 ? std::min(row, lanesForScalar)
                     : lanesForScalar;
  if (row > 0 || (chosen & (chosen - 1)) != 0)
    return 0;
  if (best > 1) {
    int other = 2 * best <= mostLanes ? 2 * best : best / 2;
    return isTried(other) ? 0 : other;
  }
  for (int lanes = mostLanes / 2; lanes > 1; lanes /= 2)
    if (double ratio = overScalar(lanes))
      return ratio < farBehind && !isTried(2 * lanes) ? 2 * lanes : 0;
  return 0;
}
