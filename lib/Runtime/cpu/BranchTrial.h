//===- BranchTrial.h - Choice of branches by time ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The first replays of a graph run with branches and without, in turn, and so
// do a few of every two thousand later ones: other programs may have come or
// gone. Branches are chosen if their least time is clearly less, and if they
// have won most pairs of successive replays: on a loaded machine a single time
// says little.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CPU_BRANCHTRIAL_H
#define WARP_LIB_RUNTIME_CPU_BRANCHTRIAL_H

#include <algorithm>
#include <atomic>
#include <cstdint>

namespace warp {

class BranchTrial {
public:
  static constexpr int64_t trials = 16, period = 2048;

  /// The number of a replay that begins.
  int64_t begin() { return replays.fetch_add(1, std::memory_order_relaxed); }
  /// True if the time of a replay is wanted.
  static bool isTrial(int64_t number) { return number % period < trials; }
  /// True if a replay uses branches.
  bool uses(int64_t number) const {
    if (!isTrial(number))
      return chosen.load(std::memory_order_relaxed);
    return takesBranches(number % period);
  }
  void record(int64_t number, int64_t nanoseconds) {
    times[number % period].store(nanoseconds, std::memory_order_relaxed);
    if (done.fetch_add(1, std::memory_order_acq_rel) + 1 == trials) {
      done.store(0, std::memory_order_relaxed);
      choose();
    }
  }

private:
  /// Two successive pairs begin with different ways.
  static bool takesBranches(int64_t place) {
    return (place % 2 == 1) != (place / 2 % 2 == 1);
  }
  void choose() {
    int64_t least[2] = {INT64_MAX, INT64_MAX};
    int64_t won = 0;
    for (int64_t pair = 0; pair < trials; pair += 2) {
      int64_t one[2];
      for (int64_t place : {pair, pair + 1})
        one[takesBranches(place)] =
            times[place].load(std::memory_order_relaxed);
      won += one[1] < one[0];
      for (int way : {0, 1})
        least[way] = std::min(least[way], one[way]);
    }
    chosen.store(least[1] < least[0] / 20 * 19 && 8 * won >= 3 * trials,
                 std::memory_order_relaxed);
  }

  std::atomic<int64_t> replays{0}, done{0};
  std::atomic<int64_t> times[trials] = {};
  std::atomic<bool> chosen{false};
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_CPU_BRANCHTRIAL_H
