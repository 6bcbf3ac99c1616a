//===- LaunchTrial.h - Run-time check of GPU schedules ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A schedule maps the launches of a GPU kernel where a cost model, or a
// measurement of another kernel, says that it gains. Once launches of a variant
// have done enough, the choice is checked: code with the plain mapping is
// compiled in the background, and whole launches are made by schedule, plain,
// plain, schedule in turn, between two events on their stream. A later launch
// asks whether the events have come; no launch waits, and none is timed while a
// graph records. The rules are those of lanes on CPUs (`TrialRatios`): the
// quartet with the median ratio decides.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_LAUNCHTRIAL_H
#define WARP_LIB_RUNTIME_LAUNCHTRIAL_H

#include "LaneTrial.h"

#include <algorithm>
#include <array>

namespace warp {

class Stream;

/// Two events around work on a stream.
class LaunchTimer {
public:
  virtual ~LaunchTimer() = default;
  virtual void start(const Stream *stream) = 0;
  virtual void stop(const Stream *stream) = 0;
  /// Nanoseconds between them; nothing if the work is not over.
  virtual std::optional<double> elapsed() = 0;
};

/// A variant's trial.
class LaunchTrial {
public:
  using Extents = std::array<int64_t, 4>;

  /// `compile` is called once, when launches have done enough; it has `begin`
  /// called on another thread. `finish` is called with the times.
  LaunchTrial(std::function<void()> compile,
              std::function<void(const TrialTimes &)> finish)
      : compile(std::move(compile)), finish(std::move(finish)) {}
  /// A trial that has been made, with times of the cache.
  explicit LaunchTrial(const TrialTimes &times) : times(times), open(false) {}

  /// False once it is over: launches need not ask again.
  bool isOpen() const { return open.load(std::memory_order_relaxed); }
  /// Launches are timed from now on; without a timer the trial is over.
  void begin(std::unique_ptr<LaunchTimer> made);
  /// Makes a launch by `run`, which gets true for plain code, and times it.
  /// False if the launch is not one of the trial: nothing has been done then.
  bool measure(const Extents &extents, const Stream *stream,
               const std::function<void(bool)> &run);
  /// The times of a launch index, once it is over.
  std::optional<TrialTimes> result() const;

private:
  bool collect();
  void spend(const Extents &extents);

  std::function<void()> compile;
  std::function<void(const TrialTimes &)> finish;
  /// Threads that launches have before anything is compiled, and those of the
  /// smallest launch that counts.
  static constexpr int64_t enough = int64_t(1) << 25, least = 1 << 17;
  std::atomic<int64_t> patience{enough};
  std::atomic<bool> hasBegun{false};
  std::unique_ptr<LaunchTimer> timer;
  /// Held by the launch that asks or is timed.
  std::atomic_flag busy = ATOMIC_FLAG_INIT;
  bool isTiming = false;
  int turn = 0, misses = 0;
  Extents timed{};
  double spent[2] = {0, 0};
  TrialRatios ratios;
  mutable ForkMutex mutex;
  std::optional<TrialTimes> times;
  std::atomic<bool> open{true};
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_LAUNCHTRIAL_H
