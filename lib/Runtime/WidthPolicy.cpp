//===- WidthPolicy.cpp - How many threads a loop gets ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WidthPolicy.h"

#include <algorithm>
#include <cmath>

using namespace warp;

/// Core time that is worth a thread, and time of the smallest chunk.
static constexpr double share = 20e3;
/// Launches shorter than this say too little about their width.
static constexpr double worthTrying = 100e3;
/// Pairs of launches that a trial compares.
static constexpr int trialPairs = 3;
/// More threads must be faster by this to be worth their cores.
static constexpr double gain = 1.03;
static constexpr int longestInterval = 4096;

//===----------------------------------------------------------------------===//
// WidthPolicy
//===----------------------------------------------------------------------===//

WidthPolicy::Plan WidthPolicy::plan(int64_t items, int most) {
  if (work == 0)
    return {most, 0};
  double total = work * static_cast<double>(items);
  int usual = static_cast<int>(std::clamp(total / share, 1.0, double(most)));
  usual = std::min(usual, limit);
  int64_t chunk = static_cast<int64_t>(
      std::clamp(std::ceil(share / work), 1.0, double(items)));
  // Narrow for lack of work, or too short to compare.
  if (usual < std::min(most, limit) || total / usual < worthTrying)
    return {usual, chunk};
  if (trial.otherWidth && trial.usualWidth != usual)
    trial = {};
  if (!trial.otherWidth && --untilTrial <= 0)
    beginTrial(most);
  if (trial.otherWidth && trial.launches % 2)
    return {trial.otherWidth, chunk};
  return {usual, chunk};
}

void WidthPolicy::beginTrial(int most) {
  trial = {};
  untilTrial = interval;
  int usual = std::min(limit, most);
  bool widen = usual < most && (widenNext || usual == 1);
  widenNext = !widen;
  trial.usualWidth = usual;
  trial.otherWidth = widen ? std::min(most, 2 * usual) : usual / 2;
}

void WidthPolicy::record(int64_t items, int width, double nanoseconds) {
  double perItem = nanoseconds / static_cast<double>(items);
  double sample = std::max(perItem * width, 1e-6);
  work = lastWork == 0 ? sample : std::min(sample, lastWork);
  lastWork = sample;
  if (trial.otherWidth)
    recordTrial(width, perItem);
}

void WidthPolicy::recordTrial(int width, double perItem) {
  bool other = trial.launches % 2;
  // Fewer threads than planned were free: this says nothing.
  if (width != (other ? trial.otherWidth : trial.usualWidth)) {
    trial = {};
    return;
  }
  double &best = other ? trial.other : trial.usual;
  best = best == 0 ? perItem : std::min(best, perItem);
  ++trial.launches;
  bool hopeless = other && trial.other > 1.25 * trial.usual;
  if (hopeless || trial.launches == 2 * trialPairs)
    endTrial();
}

void WidthPolicy::endTrial() {
  bool widen = trial.otherWidth > trial.usualWidth;
  bool adopt = widen ? trial.other * gain < trial.usual
                     : trial.other < trial.usual * gain;
  if (adopt) {
    limit = trial.otherWidth;
    interval = 256;
    untilTrial = 16;
    widenNext = widen;
  } else {
    interval = std::min(2 * interval, longestInterval);
  }
  trial = {};
}

//===----------------------------------------------------------------------===//
// CoreWatch
//===----------------------------------------------------------------------===//

/// Losses within so many launches or nanoseconds belong together, and a worker
/// without any for that long is trusted.
static constexpr int64_t windowLaunches = 32;
static constexpr int64_t windowTime = 20'000'000;
static constexpr int64_t shortestPause = 50'000'000;
static constexpr int64_t longestPause = 1'000'000'000;

void CoreWatch::enter(State next, int64_t atLaunch, int64_t nanoseconds) {
  state = next;
  launch = atLaunch;
  time = nanoseconds;
}

void CoreWatch::join(int64_t atLaunch, int64_t nanoseconds) {
  if (state == State::Trusted)
    return;
  if (state == State::Out)
    enter(State::Probed, atLaunch, nanoseconds);
  else if (atLaunch - launch >= windowLaunches &&
           nanoseconds - time >= windowTime)
    state = State::Trusted;
}

void CoreWatch::lost(int64_t atLaunch, int64_t nanoseconds) {
  if (state == State::Out)
    return;
  if (state == State::Trusted)
    return enter(State::Suspected, atLaunch, nanoseconds);
  pause = state == State::Probed ? std::min(2 * pause, longestPause)
                                 : shortestPause;
  enter(State::Out, atLaunch, nanoseconds);
}

//===----------------------------------------------------------------------===//
// Chunks
//===----------------------------------------------------------------------===//

int64_t warp::nextChunk(int64_t left, int64_t least, int64_t align) {
  int64_t size = std::max(left / 4, least);
  size = (size + align - 1) / align * align;
  return std::min(size, left);
}

int64_t warp::chunkAlignment(int64_t items, int64_t least, int width) {
  if (least >= 64 || items >= int64_t(64) * 4 * width)
    return 64;
  return least >= 16 || items >= int64_t(16) * 4 * width ? 16 : 1;
}
