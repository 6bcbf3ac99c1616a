//===- WidthPolicy.h - Adaptive thread count of parallel loops --*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Rules that the thread pool follows, without a clock and without threads of
// their own: they are told the times.
//
// `WidthPolicy` learns from the launches of one kernel, of about one size, how
// many threads are worth waking and how many items make a chunk. Work below 6
// microseconds stays on the caller. Long launches now and then try half as many
// threads, or twice as many once they have fewer: threads that add nothing
// (memory is the limit) stay asleep. A trial is a few pairs of launches, far
// from each other: what else runs on the machine comes in bursts of several
// launches, which one pair would take for an effect of the width.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_WIDTHPOLICY_H
#define WARP_LIB_RUNTIME_WIDTHPOLICY_H

#include <array>
#include <atomic>
#include <climits>
#include <cstdint>

namespace warp {

class WidthPolicy {
public:
  struct Plan {
    int width;
    /// Items of the smallest chunk; 0 while nothing is known.
    int64_t chunk;
  };

  /// For a launch of `items` in which `most` threads could take part.
  Plan plan(int64_t items, int most);

  /// The time of a launch of `width` threads.
  void record(int64_t items, int width, double nanoseconds);
  /// True if the launch before was over before a thread would have woken.
  bool isBrief(int64_t items) const;

private:
  /// The time of the pairs seen so far, by the item.
  struct Trial {
    int usualWidth = 0;
    int otherWidth = 0;
    int pairs = 0;
    double usual = 0;
    double other = 0;
  };
  /// The role of the running launch in a trial.
  enum class Role { None, Usual, Other };

  void beginTrial(int most);
  void recordTrial(int width, double perItem);
  void endTrial();

  /// Core time of an item: the lower of the last two launches, since others on
  /// the machine can only make it longer.
  double work = 0;
  double lastWork = 0;
  /// Threads beyond which more were found to add nothing.
  int limit = INT_MAX;
  Trial trial;
  Role role = Role::None;
  bool widenNext = false;
  /// Launches until the next pair, or the next trial.
  int wait = 16;
  /// Launches between two attempts with fewer threads.
  int interval = 256;
};

/// The policies of one loop by the power of two of its items. The pool guards
/// them by its lock.
class LoopHistory {
public:
  WidthPolicy &of(int64_t items) { return policies[bucketOf(items)]; }

  /// True while loops of so many items are brief: they run without the pool,
  /// and nobody takes their time. Needs no lock.
  bool isBrief(int64_t items) const {
    return brief.load(std::memory_order_relaxed) >> bucketOf(items) & 1;
  }
  void setBrief(int64_t items, bool isBrief) {
    uint64_t bit = uint64_t(1) << bucketOf(items);
    if (isBrief)
      brief.fetch_or(bit, std::memory_order_relaxed);
    else
      brief.fetch_and(~bit, std::memory_order_relaxed);
  }

private:
  static int bucketOf(int64_t items) {
    return 63 - __builtin_clzll(static_cast<uint64_t>(items));
  }

  std::array<WidthPolicy, 63> policies;
  std::atomic<uint64_t> brief{0};
};

/// Chunks shrink: a quarter of what is left of a stretch, never below `least`.
/// All are multiples of `align`, the last one of the stretch excepted.
int64_t nextChunk(int64_t left, int64_t least, int64_t align);

/// The multiple that chunks of at least `least` items keep: vector code runs
/// 64 items at a time, so that is wanted wherever it leaves every thread work.
int64_t chunkAlignment(int64_t items, int64_t least, int width);

} // namespace warp

#endif // WARP_LIB_RUNTIME_WIDTHPOLICY_H
