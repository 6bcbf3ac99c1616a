//===- LaunchTrial.cpp - Run-time check of GPU schedules ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LaunchTrial.h"

using namespace warp;

/// Launches of other extents after which the trial goes on with theirs.
static constexpr int mostMisses = 64;

static std::atomic<bool> enabled{false};
void warp::setScheduleTrials(bool value) { enabled = value; }
bool warp::hasScheduleTrials() { return enabled; }

static int64_t count(const LaunchTrial::Extents &extents) {
  int64_t items = 1;
  for (int64_t extent : extents)
    items *= extent;
  return items;
}

void LaunchTrial::begin(std::unique_ptr<LaunchTimer> made) {
  if (!made) {
    open = false;
    return;
  }
  timer = std::move(made);
  hasBegun.store(true, std::memory_order_release);
}

void LaunchTrial::spend(const Extents &extents) {
  int64_t amount = std::max(count(extents), least);
  int64_t left = patience.fetch_sub(amount, std::memory_order_relaxed);
  if (left > 0 && left <= amount)
    compile();
}

/// Takes the time of the launch before. False if it is not there yet, or the
/// trial is over.
bool LaunchTrial::collect() {
  if (!isTiming)
    return true;
  std::optional<double> found = timer->elapsed();
  if (!found)
    return false;
  isTiming = false;
  spent[turn % 4 == 1 || turn % 4 == 2] += *found;
  if (++turn % 4 != 0)
    return true;
  // A record is of two pieces by each.
  ratios.record(std::max<int64_t>(count(timed), 1), spent[0], spent[1]);
  spent[0] = spent[1] = 0;
  std::optional<TrialTimes> decided = ratios.result();
  if (!decided)
    return true;
  {
    std::lock_guard lock(mutex);
    times = decided;
  }
  open = false;
  finish(*decided);
  return false;
}

bool LaunchTrial::measure(const Extents &extents, const Stream *stream,
                          const std::function<void(bool)> &run) {
  if (!hasBegun.load(std::memory_order_acquire)) {
    spend(extents);
    return false;
  }
  if (busy.test_and_set(std::memory_order_acquire))
    return false;
  struct Release {
    std::atomic_flag &flag;
    ~Release() { flag.clear(std::memory_order_release); }
  } release{busy};
  if (!isOpen() || !collect())
    return false;
  if (turn == 0)
    timed = extents;
  if (timed != extents) {
    if (++misses < mostMisses)
      return false;
    misses = turn = 0;
    ratios = {};
    spent[0] = spent[1] = 0;
    timed = extents;
  }
  bool byPlain = turn % 4 == 1 || turn % 4 == 2;
  timer->start(stream);
  run(byPlain);
  timer->stop(stream);
  isTiming = true;
  return true;
}

std::optional<TrialTimes> LaunchTrial::result() const {
  std::lock_guard lock(mutex);
  return times;
}
