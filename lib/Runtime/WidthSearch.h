//===- WidthSearch.h - Widths that lane trials compare ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The cost model chose lanes, or none, and each round of a trial compares the
// quickest so far with another width. Scalar code is first, or 16 lanes where
// the model chose that. Lanes that stay, or come, are compared with twice as
// many, 32 with 16. Scalar code that beat lanes by little is compared with
// twice as many of these. Widths follow from the times of the rounds, so that
// another process finds them again by what the cache has kept.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_WIDTHSEARCH_H
#define WARP_LIB_RUNTIME_WIDTHSEARCH_H

#include "LaneTrial.h"

#include <vector>

namespace warp {

class WidthSearch {
public:
  /// `row`: code is for rows of so many elements, whose lanes are compared with
  /// scalar code alone; 0 for others.
  WidthSearch(int chosen, int row, const std::vector<TrialTimes> &rounds = {});

  /// Notes the times of a round with the next width.
  void add(const TrialTimes &times);
  /// The quickest width so far.
  int getBest() const { return best; }
  /// The width of the next round; 0 if there is none.
  int getNext() const;
  /// The width that was quickest before each round, and the one beside it.
  struct Pair {
    int best, other;
  };
  const std::vector<Pair> &getPairs() const { return pairs; }

  /// Rounds at most.
  static constexpr int most = 4;

private:
  /// The time of a width over that of scalar code; 0 if it was not measured.
  double overScalar(int lanes) const;
  bool isTried(int lanes) const;

  int chosen, best, row;
  std::vector<Pair> pairs;
  /// Time of the other width over that of the quickest, by round.
  std::vector<double> ratios;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_WIDTHSEARCH_H
