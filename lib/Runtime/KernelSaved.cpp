//===- KernelSaved.cpp - Kernels with code from a file --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Saving a kernel compiles the variants that its launches are likely to need,
// and one that fits every launch of its rank. A launch takes the first of them
// whose conditions hold; `VariantKey` has the facts of the launch, so a variant
// may ask for less than the key says. A kernel that has its source as well
// compiles what no saved variant covers.
//
//===----------------------------------------------------------------------===//

#include "BackgroundThread.h"
#include "FileChecks.h"
#include "KernelImpl.h"
#include "MachineCode.h"
#include "Support.h"
#include "warp/SavedModule.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <deque>

using namespace warp;

Kernel::Kernel(const SavedKernel &saved)
    : impl(std::make_shared<Impl>(Module(nullptr))) {
  impl->name = saved.name;
  impl->options = saved.options;
  impl->setParameters(saved.params);
  impl->setAccesses(saved.accesses);
  impl->saved.push_back(std::make_unique<SavedKernel>(saved));
}

void Kernel::attach(const SavedKernel &saved) {
  const KernelOptions &options = impl->options;
  auto reject = [&](const std::string &why) {
    throw Error(Error::Kind::Value, "kernel '" + impl->name +
                                        "' does not fit its saved code: " +
                                        why + ", compile the module again");
  };
  if (impl->hasSource() && impl->hashes().plain != saved.source)
    reject("its source has changed");
  if (options.debug != saved.options.debug)
    reject(std::string("that was compiled in ") +
           (saved.options.debug ? "debug" : "release") + " mode");
  if (options.fastMath != saved.options.fastMath)
    reject(std::string("that was compiled ") +
           (saved.options.fastMath ? "with" : "without") + " 'fast_math'");
  if (options.deterministic)
    reject("it asks for 'deterministic' code");
  for (const SavedVariant &variant : saved.variants)
    if (std::string problem =
            problemOf(variant.code, impl->params, impl->paramSize);
        !problem.empty())
      reject(problem);
  std::lock_guard lock(impl->mutex);
  // The code that came last is tried first.
  impl->saved.insert(impl->saved.begin(), std::make_unique<SavedKernel>(saved));
}

//===----------------------------------------------------------------------===//
// Saving
//===----------------------------------------------------------------------===//

/// The variants to save, from the one that asks for most to the one that fits
/// everything.
static std::vector<VariantKey> keysToSave(const std::vector<Param> &params,
                                          int rank, int blockDim, bool gpu) {
  uint64_t arrays = 0, integers = 0;
  for (size_t i = 0; i < params.size() && i < 64; ++i) {
    uint64_t bit = uint64_t(1) << i;
    if (params[i].kind == Param::Kind::Array)
      arrays |= bit;
    else if (isIntegerScalar(params[i]))
      integers |= bit;
  }
  std::vector<VariantKey> keys;
  VariantKey key;
  key.rank = rank;
  key.blockDim = blockDim;
  key.packed = arrays;
  key.nonNegative = integers;
  if (!gpu || rank <= 3) {
    if (gpu && rank == 1) {
      key.large = key.disjoint = true;
      keys.push_back(key);
      key.large = key.disjoint = false;
    }
    keys.push_back(key);
    key.nonNegative = 0;
    if (integers)
      keys.push_back(key);
  }
  key.packed = key.nonNegative = 0;
  key.index32 = false;
  key.flat = gpu;
  keys.push_back(key);
  return keys;
}

/// All but the variants.
SavedKernel Kernel::Impl::describeSaved(int arch) {
  SavedKernel saved;
  saved.name = name;
  saved.target = arch == 0 ? "cpu" : "sm_" + std::to_string(arch);
  if (arch == 0)
    saved.processor = hostProcessor();
  saved.source = hashes().plain;
  saved.options = options;
  saved.params = params;
  findAccesses();
  saved.accesses = accesses;
  saved.idFlows = warp::idFlows(source());
  return saved;
}

/// Machine code for PTX, from the disk cache if the driver has met it before.
static Code assembled(int device, Code code) {
  std::string key = machineCodeKey(code, deviceInfo(device).arch);
  // Other code may have been made in a hurry.
  std::optional<MachineCode> found = findMachineCode(key);
  if (found && found->isBest) {
    code.binary = std::move(found->binary);
    return code;
  }
  deviceAt(device).assemble(code);
  if (isElf(code.binary))
    storeMachineCode(key, {code.entry, code.binary, /*isBest=*/false});
  return code;
}

SavedVariant Kernel::Impl::compileSaved(const VariantKey &key, int arch) {
  // Code that later architectures run, too.
  VariantKey common = key;
  common.unmapped = true;
  CompileOptions compile = compileOptions(common, arch);
  // As many threads as ever matter: the machine to come is not known.
  compile.threads = arch == 0 ? 16 : 1;
  SavedVariant variant;
  static_cast<LaunchFacts &>(variant) = compile;
  variant.code = obtain(compile, times);
  if (!isHost(key.device))
    variant.code = assembled(key.device, std::move(variant.code));
  return variant;
}

SavedKernel Kernel::save(int arch, int device) {
  SavedKernel saved = impl->describeSaved(arch);
  int rank = impl->threadRank();
  std::lock_guard lock(impl->mutex);
  for (VariantKey key :
       keysToSave(impl->params, rank, impl->options.blockDim, arch != 0)) {
    key.device = device;
    // One for arrays wherever they lie.
    key.unmapped = true;
    key.threadOrder = arch == 0 && impl->isInTurn(1);
    SavedVariant variant = impl->compileSaved(key, arch);
    // Launches that do not keep the order have code of their own.
    if ((variant.code.schedule.sizeFacts & threadOrderFact) &&
        key.threadOrder && !impl->isInTurn(INT64_MAX)) {
      key.threadOrder = false;
      saved.variants.push_back(impl->compileSaved(key, arch));
    }
    saved.variants.push_back(std::move(variant));
  }
  return saved;
}

SavedKernel Kernel::save(const Plan &plan) {
  VariantKey key = plan.variant->key;
  int arch = deviceInfo(key.device).arch;
  if (!impl->hasSource()) {
    std::lock_guard lock(impl->mutex);
    auto [kernel, variant] = impl->chooseSaved(key, arch);
    SavedKernel saved = *kernel;
    saved.variants = {*variant};
    return saved;
  }
  SavedKernel saved = impl->describeSaved(arch);
  std::lock_guard lock(impl->mutex);
  // Not that device's machine code, which no other could run.
  key.device = VariantKey().device;
  saved.variants.push_back(impl->compileSaved(key, arch));
  return saved;
}

//===----------------------------------------------------------------------===//
// Loading
//===----------------------------------------------------------------------===//

/// 90 for "sm_90", 0 for "cpu".
static int architectureOf(const SavedKernel &saved) {
  return saved.target == "cpu" ? 0 : std::atoi(saved.target.c_str() + 3);
}

/// True if code for one architecture runs on another: PTX on all later ones, a
/// cubin on those of the same generation.
static bool runsOn(const SavedKernel &saved, const SavedVariant &variant,
                   int arch) {
  int made = architectureOf(saved);
  if (arch == 0 || made == 0)
    return arch == made;
  if (made > arch)
    return false;
  return !isElf(variant.code.binary) || made / 10 == arch / 10;
}

static bool fits(const SavedVariant &variant, const VariantKey &key) {
  return variant.rank == key.rank && (variant.packed & ~key.packed) == 0 &&
         (variant.nonNegative & ~key.nonNegative) == 0 &&
         (!variant.index32 || key.index32) && (!variant.large || key.large) &&
         (!variant.disjoint || key.disjoint) &&
         (variant.threadOrder || !key.threadOrder ||
          !(variant.code.schedule.sizeFacts & threadOrderFact)) &&
         (!key.ordered || variant.code.schedule.sums.empty()) &&
         (isHost(key.device) ||
          ((variant.flat || !key.flat) && variant.blockDim == key.blockDim));
}

std::pair<const SavedKernel *, const SavedVariant *>
Kernel::Impl::chooseSaved(const VariantKey &key, int arch) const {
  const SavedKernel *best = nullptr;
  const SavedVariant *chosen = nullptr;
  for (const auto &kernel : saved)
    for (const SavedVariant &candidate : kernel->variants) {
      if (!runsOn(*kernel, candidate, arch) || !fits(candidate, key))
        continue;
      // The latest architecture, and of that the first variant that fits.
      if (!best || architectureOf(*kernel) > architectureOf(*best)) {
        best = kernel.get();
        chosen = &candidate;
      }
    }
  return {best, chosen};
}

bool Kernel::Impl::obtainSaved(const VariantKey &key, int arch,
                               Variant &variant) const {
  auto [best, chosen] = chooseSaved(key, arch);
  if (!best) {
    if (!hasSource())
      raiseNotSaved(key, arch);
    return false;
  }
  if (arch == 0)
    checkProcessor(*best);
  variant.code = chosen->code;
  variant.flat = chosen->flat;
  return true;
}

void Kernel::Impl::raiseNotSaved(const VariantKey &key, int arch) const {
  std::string have;
  for (const auto &kernel : saved) {
    std::vector<std::string> seen;
    for (const SavedVariant &variant : kernel->variants) {
      std::string text = kernel->target + ", " + std::to_string(variant.rank) +
                         (variant.rank == 1 ? " dimension" : " dimensions");
      if (architectureOf(*kernel) != 0)
        text += ", blocks of " + std::to_string(variant.blockDim);
      if (std::find(seen.begin(), seen.end(), text) != seen.end())
        continue;
      seen.push_back(text);
      have += (have.empty() ? "(" : "; (") + text + ")";
    }
  }
  std::string wanted = arch == 0 ? "cpu" : "sm_" + std::to_string(arch);
  wanted += ", " + std::to_string(key.rank) +
            (key.rank == 1 ? " dimension" : " dimensions");
  if (arch != 0)
    wanted += ", blocks of " + std::to_string(key.blockDim);
  throw Error(Error::Kind::Launch, "launch('" + name +
                                       "'): no code was saved for (" + wanted +
                                       "), there is: " + have);
}

void Kernel::load(int device, int blockDim) { impl->loaded(device, blockDim); }

void Kernel::load(const std::vector<LoadRequest> &requests, int threads) {
  struct Job {
    std::shared_ptr<Impl> kernel;
    int device, blockDim;
    CodeTicket ticket;
  };
  struct Jobs {
    std::deque<Job> list;
    std::atomic<size_t> next{0};
  };
  auto jobs = std::make_shared<Jobs>();
  std::vector<std::shared_ptr<CodeTicket::State>> states;
  for (const LoadRequest &request : requests) {
    jobs->list.push_back(
        {request.kernel->impl, request.device, request.blockDim, CodeTicket()});
    states.push_back(jobs->list.back().ticket.state());
  }
  auto run = [jobs] {
    for (size_t i; (i = jobs->next++) < jobs->list.size();) {
      Job &job = jobs->list[i];
      try {
        job.kernel->loaded(job.device, job.blockDim);
        job.ticket.finish(nullptr);
      } catch (...) {
        job.ticket.finish(std::current_exception());
      }
      job.kernel = nullptr;
    }
  };
  size_t tasks = threads > 0 ? std::min<size_t>(threads, requests.size())
                             : requests.size();
  for (size_t i = 0; i < tasks; ++i)
    background::addUrgent(run);
  jobs = nullptr;
  waitForCode(states);
}

VariantKey Kernel::Impl::ordinaryKey(int device, int blockDim) {
  VariantKey key =
      usualKey(hasSource() ? threadRank() : saved[0]->variants[0].rank);
  key.device = device;
  key.disjoint = !isHost(device);
  if (!isHost(device)) {
    key.blockDim = checkedBlockDim(blockDim);
    key.flat = key.rank > 3;
  }
  return key;
}

Kernel::Variant &Kernel::Impl::loaded(int device, int blockDim) {
  VariantKey key = ordinaryKey(device, blockDim);
  // The first launch then finds the variant.
  if (!hasAccesses)
    findAccesses();
  Variant *variant = find(key);
  if (!variant)
    variant = make(key, anyItems);
  improve(*variant);
  return *variant;
}

Kernel::Variant *Kernel::Impl::findOn(int device) const {
  Variant *variant = variants.load(std::memory_order_acquire);
  while (variant && variant->key.device != device)
    variant = variant->next;
  return variant;
}

Kernel::Variant &Kernel::Impl::launched(int device) {
  if (Variant *variant = findOn(device))
    return *variant;
  if (!hasAccesses)
    findAccesses();
  return *make(ordinaryKey(device, 0), 1);
}
