//===- KernelTrial.cpp - Code that schedules are checked against ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A variant whose lanes, or scalar code, the cost model chose has a trial
// (LaneTrial.h). Its times are kept in the cache under the name of that code,
// those of a round against another width under the name of the other, so
// another process begins with the quicker code. A variant for a GPU has one of
// its schedule (LaunchTrial.h), whose times are of the card, too.
//
//===----------------------------------------------------------------------===//

#include "BackgroundThread.h"
#include "Compiler/Abandon.h"
#include "KernelImpl.h"
#include "warp/KernelCache.h"

#include <cstdio>

using namespace warp;

/// The file of a trial.
static std::string fileOf(const std::string &key) { return key + ".lanes"; }

/// True if launches of `one` may be made as those of `other`: what keeps code
/// without atomic instructions right does so with them, too.
static bool updatesAlike(const Schedule &one, const Schedule &other) {
  if (!other.exclusive)
    return !one.exclusive && one.atomics == other.atomics;
  return !one.exclusive || one.copied.list == other.copied.list;
}

/// The same for all of a launch; facts about its size that are enough for
/// `other` are enough for it.
static bool areAlike(const Code &one, const Code &other) {
  const Schedule &a = one.schedule, &b = other.schedule;
  return updatesAlike(a, b) && a.usesPrintf == b.usesPrintf &&
         a.sums.size() == b.sums.size() && (a.sizeFacts & ~b.sizeFacts) == 0 &&
         one.sites.empty() && other.sites.empty();
}

static CompileOptions withLanes(CompileOptions options, int lanes) {
  options.lanes = lanes;
  return options;
}

/// Lanes that scalar code is compared with: the model says that they lose, and
/// counts of operations do not know which branches a processor predicts and
/// which loads it has in flight. Along the last of several dimensions they would
/// gain or lose by its extent, which scalar code is not compiled for.
static constexpr int lanesForScalar = 16;

/// Deterministic code would add floats in another order from the launch on that
/// it is exchanged at; all else has the same bits.
bool Kernel::Impl::mayTry(const CompileOptions &wanted,
                          const Variant &variant) const {
  return hasLaneTrials() && isHost(variant.key.device) && saved.empty() &&
         wanted.lanes == 0 && !wanted.debug && !wanted.deterministic &&
         (variant.code.schedule.lanes > 1 || variant.key.rank == 1) &&
         variant.code.sites.empty();
}

/// A task of a variant that another thread does, as long as the kernel lives.
template <typename Impl, typename Task>
static std::function<void()> inBackground(std::weak_ptr<Impl> self,
                                          Kernel::Variant &variant, Task task) {
  return [self = std::move(self), &variant, task = std::move(task)] {
    background::add([self, &variant, task] {
      if (std::shared_ptr<Impl> impl = self.lock())
        task(*impl, variant);
    });
  };
}

/// The width that so many lanes are compared with: what two vectors in turn
/// gain by latency, and lose by registers, is guessed by the model. 0 for lanes
/// that are as many as a row has elements, or a run.
static int otherWidth(const CompileOptions &wanted, int64_t lanes) {
  constexpr int64_t mostInVector = 16;
  if (wanted.innerExtent != 0 || lanes < 2 || (lanes & (lanes - 1)) != 0)
    return 0;
  return int(lanes > mostInVector ? lanes / 2 : 2 * lanes);
}

static std::optional<TrialTimes> readTimes(const std::string &key) {
  std::optional<std::string> text = KernelCache::get().read(fileOf(key));
  return text ? TrialTimes::fromText(*text) : std::nullopt;
}

/// The lanes that the first round compares with.
static int oppositeOf(int lanes) { return lanes == 1 ? lanesForScalar : 1; }

/// True if lanes stay, or come, after a first round.
static bool hasLanesAfter(int lanes, const TrialTimes &times) {
  return (lanes == 1) == times.prefersPlain();
}

/// The lanes that a second round compares with.
static int secondWidth(const CompileOptions &wanted, int lanes) {
  return otherWidth(wanted, lanes == 1 ? lanesForScalar : lanes);
}

/// The quickest lanes by the times of rounds.
static int settledLanes(const CompileOptions &wanted, int lanes,
                        const std::vector<TrialTimes> &rounds) {
  if (rounds.size() > 1 && rounds[1].prefersPlain())
    return secondWidth(wanted, lanes);
  return rounds[0].prefersPlain() ? oppositeOf(lanes) : lanes;
}

void Kernel::Impl::startTrial(const CompileOptions &wanted, Variant &variant) {
  auto keyOf = [this, wanted](int lanes) {
    return fingerprint(hashes(), withLanes(wanted, lanes));
  };
  // The lanes of tier-0 code are not those of the best.
  if (!variant.isQuick) {
    variant.bestLanes = variant.code.schedule.lanes;
    variant.otherLanes = secondWidth(wanted, variant.bestLanes);
  }
  std::vector<TrialTimes> known;
  if (std::optional<TrialTimes> times = readTimes(keyOf(0)))
    known.push_back(*times);
  if (!known.empty() && variant.otherLanes != 0 &&
      hasLanesAfter(variant.bestLanes, known[0]))
    if (std::optional<TrialTimes> times = readTimes(keyOf(variant.otherLanes)))
      known.push_back(*times);
  if (!known.empty() &&
      (known[0].prefersPlain() || known.back().prefersPlain())) {
    // The quicker code takes over as soon as it is loaded.
    variant.trial = std::make_unique<LaneTrial>(known);
    inBackground(weak_from_this(), variant,
                 [wanted, known](Impl &impl, Variant &variant) {
                   if (!impl.findLanes(wanted, variant))
                     return;
                   auto code = impl.loadLanes(
                       wanted, variant,
                       settledLanes(wanted, variant.bestLanes, known));
                   impl.finishTrial(variant, code);
                 })();
    return;
  }
  bool isOver =
      !variant.isQuick &&
      (variant.otherLanes == 0 ||
       (!known.empty() && !hasLanesAfter(variant.bestLanes, known[0])));
  if (known.size() == (isOver ? 1 : 2)) {
    variant.trial = std::make_unique<LaneTrial>(std::move(known));
    return;
  }
  auto compile = inBackground(
      weak_from_this(), variant, [wanted](Impl &impl, Variant &variant) {
        std::vector<TrialTimes> rounds = variant.trial->results();
        bool isFirst = rounds.empty();
        std::unique_ptr<DeviceCode> &code =
            isFirst ? variant.opposite : variant.resized;
        if (impl.findLanes(wanted, variant) &&
            (isFirst || hasLanesAfter(variant.bestLanes, rounds[0])))
          code = impl.loadLanes(wanted, variant,
                                isFirst ? oppositeOf(variant.bestLanes)
                                        : variant.otherLanes);
        variant.trial->begin(code.get());
      });
  auto finish = [this, keyOf, &variant](const TrialTimes &times) {
    bool isFirst = variant.trial->results().size() == 1;
    KernelCache::get().write(fileOf(keyOf(isFirst ? 0 : variant.otherLanes)),
                             times.toText());
    if (times.prefersPlain())
      finishTrial(variant, isFirst ? variant.opposite : variant.resized);
    return isFirst && hasLanesAfter(variant.bestLanes, times);
  };
  variant.trial =
      std::make_unique<LaneTrial>(compile, finish, std::move(known));
}

bool Kernel::Impl::findLanes(const CompileOptions &wanted, Variant &variant) {
  std::map<std::string, double> spent;
  try {
    variant.bestLanes = obtain(wanted, spent).schedule.lanes;
  } catch (...) {
    return false;
  }
  variant.otherLanes = secondWidth(wanted, variant.bestLanes);
  return variant.bestLanes > 1 || variant.key.rank == 1;
}

std::unique_ptr<DeviceCode>
Kernel::Impl::loadLanes(const CompileOptions &wanted, Variant &variant,
                        int lanes) {
  if (lanes == 0)
    return nullptr;
  if (variant.quick)
    improve(variant);
  std::map<std::string, double> spent;
  try {
    Code code = obtain(withLanes(wanted, lanes), spent);
    // Some kernels have no form for lanes.
    if (isAbandoned() || code.schedule.lanes != lanes ||
        !areAlike(code, variant.code))
      return nullptr;
    code.schedule.cost = variant.code.schedule.cost;
    return deviceAt(variant.key.device).load(variant, code);
  } catch (...) {
    // The code of the variant does the same.
    return nullptr;
  }
}

void Kernel::Impl::finishTrial(Variant &variant,
                               std::unique_ptr<DeviceCode> &code) {
  std::lock_guard lock(mutex);
  if (code)
    variant.place(std::move(code));
}

//===----------------------------------------------------------------------===//
// Schedules of GPUs
//===----------------------------------------------------------------------===//

/// The file of a trial on a card of that name.
static std::string fileOf(const std::string &key, const std::string &card) {
  char digits[24];
  std::snprintf(digits, sizeof(digits), "%016zx",
                std::hash<std::string>()(card));
  return key.substr(0, key.size() - 16) + digits + ".launches";
}

bool Kernel::Impl::mayTryLaunches(const CompileOptions &wanted,
                                  const Variant &variant) const {
  return hasScheduleTrials() && !isHost(variant.key.device) && saved.empty() &&
         hasSource() && wanted.lanes == 0 && !wanted.debug &&
         !wanted.deterministic && variant.code.sites.empty();
}

void Kernel::Impl::startLaunchTrial(const CompileOptions &wanted,
                                    Variant &variant) {
  std::string file = fileOf(fingerprint(hashes(), wanted),
                            deviceInfo(variant.key.device).name);
  std::optional<std::string> text = KernelCache::get().read(file);
  std::optional<TrialTimes> known =
      text ? TrialTimes::fromText(*text) : std::nullopt;
  if (known) {
    variant.launchTrial = std::make_unique<LaunchTrial>(*known);
    if (known->prefersPlain())
      inBackground(weak_from_this(), variant,
                   [wanted](Impl &impl, Variant &variant) {
                     if (impl.loadPlain(wanted, variant))
                       variant.replacement.store(variant.plain.get(),
                                                 std::memory_order_release);
                   })();
    return;
  }
  auto compile = inBackground(
      weak_from_this(), variant, [wanted](Impl &impl, Variant &variant) {
        bool isOther = impl.loadPlain(wanted, variant);
        variant.launchTrial->begin(
            isOther ? variant.plain->current.load()->makeTimer() : nullptr);
      });
  auto finish = [file, &variant](const TrialTimes &times) {
    if (times.prefersPlain())
      variant.replacement.store(variant.plain.get(), std::memory_order_release);
    background::add(
        [file, times] { KernelCache::get().write(file, times.toText()); });
  };
  variant.launchTrial = std::make_unique<LaunchTrial>(compile, finish);
}

bool Kernel::Impl::loadPlain(const CompileOptions &wanted, Variant &variant) {
  if (variant.quick)
    improve(variant);
  std::map<std::string, double> spent;
  try {
    Code code = obtain(withLanes(wanted, 1), spent);
    Code chosen = obtain(wanted, spent);
    if (isAbandoned() || code.binary == chosen.binary ||
        !areAlike(code, variant.code) ||
        code.schedule.tensorMaps.size() !=
            variant.code.schedule.tensorMaps.size())
      return false;
    auto plain = std::make_unique<Variant>();
    plain->key = variant.key;
    plain->flat = variant.flat;
    plain->label = variant.label;
    plain->code = std::move(code);
    plain->place(deviceAt(variant.key.device).load(*plain, plain->code));
    plain->code.binary = {};
    variant.plain = std::move(plain);
  } catch (...) {
    // The schedule does the same.
    return false;
  }
  return true;
}
