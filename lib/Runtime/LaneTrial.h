//===- LaneTrial.h - Run-time check of vectorised code ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The compiler gives a kernel lanes where its cost model says that they gain.
// Once launches of a variant have run for a while, the choice is checked: the
// code without lanes is compiled in the background, or code with lanes where
// the model chose none, and a few launches begin with short pieces in turn,
// lanes, scalar, scalar, lanes. Each launch takes them from another part of it:
// a processor that sees the same indices again predicts their branches, which
// scalar code has more of. Work differs from index to index and other processes
// come in between, so the ratio of a launch counts once, and their median
// decides; the first two launches, whose code is cold, do not count. The time
// of a piece is the thread's own where another process had the processor. The
// quicker code stays, and the cache remembers the times beside the code. More
// rounds compare it with other widths in the same way, if launches go on.
//
// `TrialRatios` are the rules, without a clock and without threads.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_LANETRIAL_H
#define WARP_LIB_RUNTIME_LANETRIAL_H

#include "warp/Forks.h"
#include "warp/LaneTrials.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace warp {

class DeviceCode;

/// Nanoseconds of an index, by the code that the cost model chose and by plain
/// code: lanes and scalar code, or a GPU's schedule and the plain mapping.
struct TrialTimes {
  double chosen = 0, plain = 0;

  /// True if plain code is quicker by more than what is never certain.
  bool prefersPlain() const { return plain * 1.05 < chosen; }
  std::string toText() const;
  /// Reads what `toText` gave; nothing of other texts.
  static std::optional<TrialTimes> fromText(const std::string &text);
};

/// The rules of a trial.
class TrialRatios {
public:
  TrialRatios() = default;
  /// The first launches, as many as `cold`, do not count.
  explicit TrialRatios(size_t cold) : cold(cold) {}
  /// Indices of a piece of a launch with that many; 0 if it is too small.
  int64_t pieceOf(int64_t items) const;
  /// The first index of the pieces of the next launch, which has so many.
  int64_t placeOf(int64_t items) const;
  /// Notes a launch whose pieces had so many indices.
  void record(int64_t piece, double chosenTime, double plainTime);
  /// The times of the launch with the median ratio, after enough launches.
  std::optional<TrialTimes> result() const;

private:
  size_t cold = 0;
  std::vector<TrialTimes> launches;
};

/// A variant's trial.
class LaneTrial {
public:
  /// `compile` is called once a round, when launches have run for a while; it
  /// has `begin` called on another thread. `finish` is called with the times of
  /// each round, and returns true if there is another. Without `isOpen` nothing
  /// is timed before `resume`.
  LaneTrial(std::function<void()> compile,
            std::function<bool(const TrialTimes &)> finish, bool isOpen = true)
      : compile(std::move(compile)), finish(std::move(finish)), open(isOpen) {}

  /// False once it is over: launches need not ask again.
  bool isOpen() const { return open.load(std::memory_order_relaxed); }
  /// True if launches with so many indices are still of use to it.
  bool takes(int64_t items) const {
    return isOpen() && ratios.pieceOf(items) != 0;
  }
  /// The code that lanes are compared with in a round, which belongs to
  /// somebody else; null if there is none to compare.
  void begin(const DeviceCode *code);
  const DeviceCode *otherCode() const {
    return other.load(std::memory_order_acquire);
  }
  /// Goes on after rounds of which the cache has the times; `isOpen`: there is
  /// another one.
  void resume(std::vector<TrialTimes> known, bool isOpen);
  /// Adds the time of a launch before `begin`.
  void spend(int64_t nanoseconds);

  /// Indices of a launch.
  struct Part {
    int64_t begin = 0, end = 0;
  };
  /// Has some indices run by both codes in turn; `run` gets true for the lanes
  /// of the variant, else `code` is to run, which `otherCode` gave. Returns
  /// which were run.
  Part measure(const DeviceCode *code, int64_t items,
               const std::function<void(bool, int64_t, int64_t)> &run);
  /// The times of the rounds that are over.
  std::vector<TrialTimes> results() const;

private:
  std::function<void()> compile;
  std::function<bool(const TrialTimes &)> finish;
  /// Nanoseconds that launches run for before anything is compiled, by round.
  static constexpr int64_t until[] = {20'000'000, 100'000'000, 300'000'000,
                                      1'000'000'000};
  int64_t patienceOf(size_t round) const {
    return until[std::min(round, std::size(until) - 1)];
  }
  std::atomic<int64_t> patience{until[0]};
  std::atomic<const DeviceCode *> other{nullptr};
  mutable ForkMutex mutex;
  /// Caches and branch predictors do not know the code in the first launches.
  TrialRatios ratios{/*cold=*/2};
  std::vector<TrialTimes> rounds;
  std::atomic<bool> open{true};
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_LANETRIAL_H
