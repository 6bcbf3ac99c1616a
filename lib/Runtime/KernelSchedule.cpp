//===- KernelSchedule.cpp - Schedules of a kernel's variants --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Launches keep nothing for this: the compiler is asked again about the kinds
// of launches that were made, and the rest is what the runtime knows of them.
//
//===----------------------------------------------------------------------===//

#include "KernelImpl.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <cstdio>

using namespace warp;

/// Multiprocessors of a GPU that is not there.
static constexpr int usualMultiprocessors = 128;

#define GET_LAUNCH_PHRASES
#include "warp/LaunchContract.h.inc"

static std::string describeKind(const VariantKey &key, int arch) {
  std::string text = !isHost(key.device) ? deviceInfo(key.device).alias
                     : arch == 0         ? "cpu"
                                         : "sm_" + std::to_string(arch);
  text += ", " + std::to_string(key.rank) +
          (key.rank == 1 ? " dimension" : " dimensions");
  return text + phrasesOf(key);
}

/// The times of one round, and what came of it.
static Choice describeRound(const TrialTimes &times, WidthSearch::Pair pair) {
  auto subject = [](int lanes) {
    return lanes == 1 ? "scalar code" : std::to_string(lanes) + " lanes";
  };
  char text[120];
  std::snprintf(text, sizeof(text),
                "%s took %.3g ns an index in a launch, %s %.3g",
                subject(pair.best).c_str(), times.chosen,
                subject(pair.other).c_str(), times.plain);
  int lanes = times.prefersPlain() ? pair.other : pair.best;
  return {"measured", lanes == 1 ? "scalar" : subject(lanes), text};
}

/// The times that lanes, or scalar code, were checked by.
static void describeTrial(const Kernel::Variant &variant,
                          std::vector<Choice> &choices) {
  std::vector<TrialTimes> rounds = variant.trial->results();
  WidthSearch search(variant.chosenLanes, variant.key.innerExtent, rounds);
  for (size_t i = 0; i < search.getPairs().size(); ++i)
    choices.push_back(describeRound(rounds[i], search.getPairs()[i]));
}

/// The same for a GPU's schedule.
static Choice describeLaunches(const TrialTimes &times) {
  char text[120];
  std::snprintf(text, sizeof(text),
                "the schedule took %.3g ns an index, the plain mapping %.3g",
                times.chosen, times.plain);
  return {"measured", times.prefersPlain() ? "plain" : "schedule", text};
}

LaunchSchedule Kernel::Impl::describe(const VariantKey &key, int arch,
                                      const Variant *variant) {
  VariantKey served = key;
  if (variant && arch == 0) {
    served.underfilled &=
        (variant->code.schedule.sizeFacts & underfilledFact) != 0;
    if (!(variant->code.schedule.sizeFacts & innerExtentFact))
      served.innerExtent = 0;
    served.farRows &= (variant->code.schedule.sizeFacts & farRowsFact) != 0;
    served.large |= (variant->code.schedule.sizeFacts & threadOrderFact) != 0 &&
                    isInTurn(1) && !key.threadOrder;
  }
  LaunchSchedule result{describeKind(served, arch), {}, {}};
  if (!hasSource()) {
    result.choices.push_back({"source", "none", "the code is from a file"});
    return result;
  }
  CompileOptions compiled = compileOptions(key, arch);
  Decisions decisions = schedule(source(), compiled);
  result.choices = std::move(decisions.choices);
  result.schedule = std::move(decisions.schedule);
  if (arch == 0) {
    std::string threads = std::to_string(ThreadPool::size());
    result.choices.push_back(
        {"threads", "at most " + threads, "as many as a launch has work for"});
    if (variant && variant->trial)
      describeTrial(*variant, result.choices);
    return result;
  }
  std::string ptx = emitText(source(), compiled, "ptx");
  result.choices.push_back(
      {"ptx", std::to_string(std::count(ptx.begin(), ptx.end(), '\n')),
       "lines"});
  if (variant) {
    variant->current.load()->describe(key, result.choices);
    if (variant->launchTrial)
      if (std::optional<TrialTimes> times = variant->launchTrial->result())
        result.choices.push_back(describeLaunches(*times));
  }
  return result;
}

std::vector<LaunchSchedule> Kernel::schedules(int device, int arch,
                                              const LaunchDim *dim) const {
  std::vector<LaunchSchedule> result;
  if (!isHost(device))
    drainLaunches();
  if (!dim)
    for (Variant *variant = impl->variants.load(std::memory_order_acquire);
         variant; variant = variant->next)
      if (variant->key.device == device && (!isHost(device) || arch == 0))
        result.insert(result.begin(),
                      impl->describe(variant->key, arch, variant));
  if (!result.empty())
    return result;
  int rank = dim ? dim->rank : impl->hasSource() ? impl->threadRank() : 1;
  VariantKey key = impl->usualKey(rank);
  key.device = device;
  if (arch != 0) {
    key.blockDim = impl->checkedBlockDim(0);
    key.flat = rank > 3;
  }
  int64_t items = 1;
  for (int i = 0; dim && i < rank; ++i)
    items *= dim->extent[i];
  if (dim && arch == 0) {
    impl->setRows(key, *dim);
    key.threadOrder = impl->isInTurn(items);
  }
  if (dim && arch != 0)
    Impl::setSize(key, *dim, items,
                  isHost(device) ? usualMultiprocessors
                                 : deviceInfo(device).smCount);
  return {impl->describe(key, arch, nullptr)};
}
