//===- LaneTrial.cpp - Run-time check of vectorised code ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LaneTrial.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>

using namespace warp;

/// Launches of a trial that count.
static constexpr size_t launchesOfTrial = 7;
/// Four pieces are an eighth of a launch, half of a small one, and have at most
/// so many indices each; fewer than the least are not worth a look at the
/// clock.
static constexpr int64_t partOfLaunch = 8, partOfSmall = 2, leastPiece = 64,
                         mostPiece = 1 << 14;

static std::atomic<bool> enabled{true};
void warp::setLaneTrials(bool value) { enabled = value; }
bool warp::hasLaneTrials() { return enabled; }

//===----------------------------------------------------------------------===//
// Times
//===----------------------------------------------------------------------===//

std::string TrialTimes::toText() const {
  char text[80];
  std::snprintf(text, sizeof(text), "lanes %.6g scalar %.6g\n", chosen, plain);
  return text;
}

std::optional<TrialTimes> TrialTimes::fromText(const std::string &text) {
  TrialTimes times;
  int end = 0;
  bool isRead = std::sscanf(text.c_str(), "lanes %lf scalar %lf%n",
                            &times.chosen, &times.plain, &end) == 2;
  bool isWhole = isRead && text.compare(end, std::string::npos, "\n") == 0;
  if (!isWhole || !std::isfinite(times.chosen) || !(times.chosen > 0) ||
      !std::isfinite(times.plain) || !(times.plain > 0))
    return std::nullopt;
  return times;
}

int64_t TrialRatios::pieceOf(int64_t items) const {
  if (items < 4 * partOfSmall * leastPiece)
    return 0;
  int64_t piece = std::min(items / (4 * partOfLaunch), mostPiece);
  return std::max(piece / leastPiece, int64_t(1)) * leastPiece;
}

int64_t TrialRatios::placeOf(int64_t items) const {
  int64_t last = items - 4 * pieceOf(items), number = launches.size();
  int64_t part = last / (int64_t(launchesOfTrial + cold) * leastPiece);
  return std::min(number * part * leastPiece, last);
}

void TrialRatios::record(int64_t piece, double chosenTime, double plainTime) {
  double count = 2 * static_cast<double>(piece);
  launches.push_back(
      {std::max(chosenTime, 1e-3) / count, std::max(plainTime, 1e-3) / count});
}

std::optional<TrialTimes> TrialRatios::result() const {
  if (launches.size() < launchesOfTrial + cold)
    return std::nullopt;
  std::vector<TrialTimes> sorted(launches.begin() + cold, launches.end());
  auto middle = sorted.begin() + sorted.size() / 2;
  std::nth_element(sorted.begin(), middle, sorted.end(),
                   [](const TrialTimes &x, const TrialTimes &y) {
                     return x.plain * y.chosen < y.plain * x.chosen;
                   });
  return *middle;
}

//===----------------------------------------------------------------------===//
// Trials
//===----------------------------------------------------------------------===//

void LaneTrial::begin(const DeviceCode *code) {
  if (!code) {
    open = false;
    return;
  }
  std::lock_guard lock(mutex);
  ratios = TrialRatios(/*cold=*/2);
  other.store(code, std::memory_order_release);
}

void LaneTrial::resume(std::vector<TrialTimes> known, bool isOpen) {
  std::lock_guard lock(mutex);
  rounds = std::move(known);
  patience = patienceOf(rounds.size());
  open = isOpen;
}

void LaneTrial::spend(int64_t nanoseconds) {
  int64_t left = patience.fetch_sub(nanoseconds, std::memory_order_relaxed);
  if (left > 0 && left <= nanoseconds)
    compile();
}

/// Nanoseconds that a processor has worked for this thread; 0 if that is not
/// known.
static int64_t threadTime() {
  timespec time;
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time) != 0)
    return 0;
  return int64_t(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

/// Nanoseconds of `run` on this thread. Another process may have the processor
/// for a while, of which the thread's own time has nothing; that time takes
/// longer to read, though, and on some systems it moves by milliseconds.
template <typename Fn> static double timeOf(Fn &&run) {
  using namespace std::chrono;
  int64_t before = threadTime();
  steady_clock::time_point start = steady_clock::now();
  run();
  int64_t passed = nanoseconds(steady_clock::now() - start).count();
  int64_t worked = threadTime() - before;
  return double(worked > 0 ? std::min(passed, worked) : passed);
}

LaneTrial::Part
LaneTrial::measure(const DeviceCode *code, int64_t items,
                   const std::function<void(bool, int64_t, int64_t)> &run) {
  int64_t piece = ratios.pieceOf(items);
  if (piece == 0)
    return {};
  Part part;
  {
    std::lock_guard lock(mutex);
    part.begin = part.end = ratios.placeOf(items);
  }
  double spent[2] = {0, 0};
  for (bool byLanes : {true, false, false, true}) {
    spent[byLanes] += timeOf([&] { run(byLanes, part.end, part.end + piece); });
    part.end += piece;
  }
  std::optional<TrialTimes> found;
  size_t round = 0;
  {
    std::lock_guard lock(mutex);
    // The round may be over.
    if (otherCode() != code)
      return part;
    ratios.record(piece, spent[true], spent[false]);
    found = ratios.result();
    if (found) {
      rounds.push_back(*found);
      round = rounds.size();
      other.store(nullptr, std::memory_order_release);
    }
  }
  if (found) {
    if (finish(*found))
      patience = patienceOf(round);
    else
      open = false;
  }
  return part;
}

std::vector<TrialTimes> LaneTrial::results() const {
  std::lock_guard lock(mutex);
  return rounds;
}
