//===- KernelTrial.cpp - Code that schedules are checked against ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A variant whose lanes, or scalar code, the cost model chose has a trial
// (LaneTrial.h, WidthSearch.h). The times of the first round are kept in the
// cache under the name of that code, those of another under the name of the
// width that was compared, so another process begins with the quickest code. A
// variant for a GPU has one of its schedule (LaunchTrial.h), whose times are of
// the card, too.
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

/// True if scalar code of a variant is compared with lanes: launches over rows
/// have code for the lengths of these.
static bool isForLanes(const Kernel::Variant &variant) {
  return variant.key.rank == 1 ||
         (variant.code.schedule.sizeFacts & innerExtentFact);
}

/// Deterministic code would add floats in another order from the launch on that
/// it is exchanged at; all else has the same bits.
bool Kernel::Impl::mayTry(const CompileOptions &wanted,
                          const Variant &variant) const {
  return hasLaneTrials() && isHost(variant.key.device) && saved.empty() &&
         wanted.lanes == 0 && !wanted.debug && !wanted.deterministic &&
         (variant.code.schedule.lanes > 1 || isForLanes(variant)) &&
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

std::string Kernel::Impl::trialFile(const CompileOptions &wanted, int round,
                                    int lanes) {
  // The first is named by the code of the variant.
  return fileOf(
      fingerprint(hashes(), withLanes(wanted, round == 0 ? 0 : lanes)));
}

/// The times of rounds that the cache has, for lanes that the model chose.
std::vector<TrialTimes> Kernel::Impl::readRounds(const CompileOptions &wanted,
                                                 int chosen) {
  std::vector<TrialTimes> rounds;
  for (WidthSearch search(chosen, wanted.innerExtent); search.getNext() != 0;) {
    std::optional<std::string> text = KernelCache::get().read(
        trialFile(wanted, rounds.size(), search.getNext()));
    std::optional<TrialTimes> times =
        text ? TrialTimes::fromText(*text) : std::nullopt;
    if (!times)
      break;
    search.add(*times);
    rounds.push_back(*times);
  }
  return rounds;
}

static WidthSearch searchOf(const CompileOptions &wanted,
                            const Kernel::Variant &variant,
                            const std::vector<TrialTimes> &rounds) {
  return WidthSearch(variant.chosenLanes, wanted.innerExtent, rounds);
}

void Kernel::Impl::startTrial(const CompileOptions &wanted, Variant &variant) {
  auto compile = inBackground(weak_from_this(), variant,
                              [wanted](Impl &impl, Variant &variant) {
                                impl.prepareRound(wanted, variant);
                              });
  auto finish = [this, wanted, &variant](const TrialTimes &times) {
    return finishRound(wanted, variant, times);
  };
  bool isKnown = KernelCache::get().read(trialFile(wanted, 0, 0)).has_value();
  // The lanes of tier-0 code are not those of the best.
  if (!variant.isQuick)
    variant.chosenLanes = variant.code.schedule.lanes;
  if (!isKnown) {
    variant.trial = std::make_unique<LaneTrial>(compile, finish);
    return;
  }
  variant.trial =
      std::make_unique<LaneTrial>(compile, finish, /*isOpen=*/false);
  if (!variant.isQuick) {
    std::vector<TrialTimes> rounds = readRounds(wanted, variant.chosenLanes);
    WidthSearch search = searchOf(wanted, variant, rounds);
    if (search.getBest() == variant.chosenLanes) {
      variant.trial->resume(rounds, search.getNext() != 0);
      return;
    }
  }
  // The quicker code takes over as soon as it is loaded.
  inBackground(weak_from_this(), variant,
               [wanted](Impl &impl, Variant &variant) {
                 impl.resumeTrial(wanted, variant);
               })();
}

/// Goes on from what the cache has.
void Kernel::Impl::resumeTrial(const CompileOptions &wanted, Variant &variant) {
  if (!findLanes(wanted, variant))
    return;
  std::vector<TrialTimes> rounds = readRounds(wanted, variant.chosenLanes);
  WidthSearch search = searchOf(wanted, variant, rounds);
  bool isLoaded = true;
  if (search.getBest() != variant.chosenLanes) {
    std::unique_ptr<DeviceCode> code =
        loadLanes(wanted, variant, search.getBest());
    isLoaded = code != nullptr;
    finishTrial(variant, code);
  }
  variant.trial->resume(rounds, isLoaded && search.getNext() != 0);
}

/// Makes the code of the next round.
void Kernel::Impl::prepareRound(const CompileOptions &wanted,
                                Variant &variant) {
  std::vector<TrialTimes> rounds = variant.trial->results();
  std::unique_ptr<DeviceCode> &code = variant.others[rounds.size()];
  if (findLanes(wanted, variant))
    if (int lanes = searchOf(wanted, variant, rounds).getNext())
      code = loadLanes(wanted, variant, lanes);
  variant.trial->begin(code.get());
}

/// Keeps the times of a round, and the quicker code; true if there is another.
bool Kernel::Impl::finishRound(const CompileOptions &wanted, Variant &variant,
                               const TrialTimes &times) {
  std::vector<TrialTimes> rounds = variant.trial->results();
  WidthSearch search = searchOf(wanted, variant, rounds);
  size_t round = rounds.size() - 1;
  KernelCache::get().write(
      trialFile(wanted, round, search.getPairs()[round].other), times.toText());
  if (times.prefersPlain())
    finishTrial(variant, variant.others[round]);
  return search.getNext() != 0;
}

bool Kernel::Impl::findLanes(const CompileOptions &wanted, Variant &variant) {
  std::map<std::string, double> spent;
  try {
    variant.chosenLanes = obtain(wanted, spent).schedule.lanes;
  } catch (...) {
    return false;
  }
  return variant.chosenLanes > 1 || isForLanes(variant);
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
