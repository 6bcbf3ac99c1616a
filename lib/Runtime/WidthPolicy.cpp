//===- WidthPolicy.cpp - Adaptive thread count of parallel loops ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WidthPolicy.h"

#include <algorithm>
#include <cmath>

using namespace warp;

/// Core time that is worth waking a thread, and time of the smallest chunk.
static constexpr double share = 3e3;
/// Shorter launches say too little to put threads to sleep.
static constexpr double worthTrying = 100e3;
/// Pairs of launches in a trial, and the launches between two of them.
static constexpr int pairsOfTrial = 4;
static constexpr int betweenPairs = 61;
/// More threads must be faster by this to be worth their cores.
static constexpr double gain = 1.03;
/// A difference that one pair is enough to show.
static constexpr double plain = 1.25;
/// Launches until more threads are tried, which costs next to nothing.
static constexpr int untilWider = 64;
static constexpr int longestInterval = 1024;

//===----------------------------------------------------------------------===//
// Widths
//===----------------------------------------------------------------------===//

WidthPolicy::Plan WidthPolicy::plan(int64_t items, int most) {
  role = Role::None;
  if (work == 0)
    return {most, 0};
  double total = work * static_cast<double>(items);
  int widest = std::min(most, limit);
  int usual = static_cast<int>(std::clamp(total / share, 1.0, double(widest)));
  int64_t chunk = static_cast<int64_t>(
      std::clamp(std::ceil(share / work), 1.0, double(items)));
  Plan plan{usual, chunk};
  // Narrow for lack of work, or nothing to compare with.
  if (usual < widest || most == 1)
    return plan;
  // The way back to more threads stays open.
  if (limit >= most && total / usual < worthTrying)
    return plan;
  if (trial.usualWidth != usual)
    trial = {};
  if (--wait > 0)
    return plan;
  if (!trial.usualWidth)
    beginTrial(most);
  // The launch after the usual one of a pair is the other.
  role = wait == 0 ? Role::Usual : Role::Other;
  if (role == Role::Other)
    plan.width = trial.otherWidth;
  return plan;
}

void WidthPolicy::beginTrial(int most) {
  int usual = std::min(limit, most);
  bool widen = usual < most && (widenNext || usual == 1);
  widenNext = !widen && usual < most;
  trial = {};
  trial.usualWidth = usual;
  trial.otherWidth = widen ? std::min(most, 2 * usual) : usual / 2;
  wait = 0;
}

void WidthPolicy::record(int64_t items, int width, double nanoseconds) {
  double perItem = nanoseconds / static_cast<double>(items);
  double sample = std::max(perItem * width, 1e-6);
  work = lastWork == 0 ? sample : std::min(sample, lastWork);
  lastWork = sample;
  if (role != Role::None)
    recordTrial(width, perItem);
}

bool WidthPolicy::isBrief(int64_t items) const {
  return lastWork > 0 && lastWork * static_cast<double>(items) < share / 2;
}

void WidthPolicy::recordTrial(int width, double perItem) {
  bool other = role == Role::Other;
  role = Role::None;
  if (width != (other ? trial.otherWidth : trial.usualWidth)) {
    trial = {};
    return;
  }
  double &best = other ? trial.other : trial.usual;
  best = best == 0 ? perItem : std::min(best, perItem);
  if (!other)
    return;
  wait = betweenPairs;
  bool worse = trial.other > plain * trial.usual;
  bool better = trial.other * plain < trial.usual;
  if (++trial.pairs == pairsOfTrial || worse ||
      (better && trial.otherWidth > trial.usualWidth))
    endTrial();
}

void WidthPolicy::endTrial() {
  bool widen = trial.otherWidth > trial.usualWidth;
  bool adopt = widen ? trial.other * gain < trial.usual
                     : trial.other < trial.usual * gain;
  if (adopt) {
    limit = trial.otherWidth;
    interval = 256;
    widenNext = widen;
  } else if (!widen) {
    interval = std::min(2 * interval, longestInterval);
  }
  bool narrowNext = limit > 1 && !widenNext;
  wait = narrowNext && !adopt ? interval : untilWider;
  trial = {};
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
