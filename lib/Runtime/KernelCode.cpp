//===- KernelCode.cpp - Code lookup: caches, files, compiler --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `make` gets the code of a variant, from a file that was saved, from the disk
// cache or from the compiler, and loads it.
//
// On CPUs a first launch of few operations, and any of very long code, gets
// code that is compiled quickly; on GPUs any first launch of a kernel does that
// calls long functions of the device library. When that has run for a while,
// `improve` has it compiled once more, with all effort, on a thread in the
// background, and puts the new entry in the place of the old one: both compute
// the same bits, so launches, recorded ones and those in graphs too, go over to
// it without knowing; graphs of CUDA are updated for this
// (cuda/GraphRefresh.h). A launch of many operations on a CPU waits for the
// tier-1 code, but for that of long code; so does one that a graph of
// another library captures.
//
//===----------------------------------------------------------------------===//

#include "BackgroundThread.h"
#include "Compiler/Abandon.h"
#include "Compiler/Apart.h"
#include "FileChecks.h"
#include "GraphImpl.h"
#include "KernelClaim.h"
#include "KernelImpl.h"
#include "Support.h"
#include "warp/FirstCode.h"
#include "warp/KernelCache.h"
#include "warp/LibraryCode.h"
#include "warp/SavedModule.h"

#include <algorithm>
#include <chrono>

using namespace warp;

/// Largest parameter block of a GPU kernel: PTX 8.1, which kernels for newer
/// architectures are in, has room for more.
static size_t maxCudaParameters(int arch) { return arch < 90 ? 4096 : 32764; }

void Kernel::Variant::place(std::unique_ptr<DeviceCode> code) {
  loaded.push_back(std::move(code));
  current.store(loaded.back().get(), std::memory_order_release);
}

namespace {
/// Adds the time since the last `lap` to a table.
class Stopwatch {
public:
  explicit Stopwatch(std::map<std::string, double> &table) : table(table) {}
  void lap(const char *phase) {
    auto now = std::chrono::steady_clock::now();
    table[phase] +=
        std::chrono::duration<double, std::milli>(now - start).count();
    start = now;
  }

private:
  std::map<std::string, double> &table;
  std::chrono::steady_clock::time_point start =
      std::chrono::steady_clock::now();
};
} // namespace

static void addTimes(std::map<std::string, double> &all,
                     const std::map<std::string, double> &some,
                     const char *prefix = "") {
  for (const auto &[phase, milliseconds] : some)
    all[prefix + phase] += milliseconds;
}

template <typename Compile>
auto Kernel::Impl::compileSource(Compile &&compile) {
  if (!background::isWorker())
    return compile(source());
  std::string copied =
      text.empty() ? source().text(/*locations=*/true) : std::string();
  Apart apart;
  return compile(Module::fromText(text.empty() ? copied : text));
}

std::optional<Code> Kernel::Impl::findCached(const std::string &key) const {
  std::optional<Code> found = KernelCache::get().find(key);
  if (found && !problemOf(*found, params, paramSize).empty())
    return std::nullopt;
  return found;
}

Code Kernel::Impl::obtain(const CompileOptions &compileOptions,
                          std::map<std::string, double> &spent) {
  Stopwatch watch(spent);
  std::string key = fingerprint(hashes(), compileOptions);
  watch.lap("fingerprint");
  std::optional<Code> cached = findCached(key);
  watch.lap("cache");
  if (cached)
    return std::move(*cached);
  KernelClaim claim(key);
  if (claim.hasWaited() && (cached = findCached(key)))
    return std::move(*cached);
  Code code = compileSource(
      [&](const Module &module) { return compile(module, compileOptions); });
  watch.lap("compile");
  addTimes(spent, code.phaseMs, "compile/");
  KernelCache::get().store(key, code);
  watch.lap("cache");
  return code;
}

void Kernel::Impl::checkParameterSize(int arch) const {
  if (arch != 0 && paramSize > maxCudaParameters(arch))
    throw launchError(Error::Kind::LaunchType, name,
                      "expects at most " +
                          std::to_string(maxCudaParameters(arch)) +
                          " bytes of arguments on CUDA devices, but got " +
                          std::to_string(paramSize));
}

Kernel::Variant *Kernel::Impl::make(const VariantKey &key, int64_t items) {
  std::lock_guard lock(mutex);
  if (Variant *made = find(key))
    return made;
  int arch = deviceInfo(key.device).arch;
  checkParameterSize(arch);
  auto variant = std::make_unique<Variant>();
  variant->key = key;
  variant->flat = key.flat;
  CompileOptions wanted = compileOptions(key, arch);
  bool isSaved = !saved.empty() && obtainSaved(key, arch, *variant);
  if (!isSaved) {
    FirstCode first = mayBeQuick(key, wanted, items)
                          ? obtainFirst(wanted, items)
                          : FirstCode{obtain(wanted, times)};
    variant->code = std::move(first.code);
    if (first.isQuick)
      variant->quick = makeQuick(wanted, *variant);
    variant->isQuick = first.isQuick;
  }
  if (arch != 0 && variant->isQuick && !loadLinked(*variant)) {
    variant->code = obtain(wanted, times);
    variant->isQuick = false;
  }
  if (!variant->current)
    load(*variant, isSaved ? nullptr : &wanted);
  if (mayTry(wanted, *variant))
    startTrial(wanted, *variant);
  if (mayTryLaunches(wanted, *variant))
    startLaunchTrial(wanted, *variant);
  // Who finds the variant knows what it needs.
  noteNeeds(variant->code.schedule);
  variant->next = variants.load(std::memory_order_relaxed);
  variants.store(variant.get(), std::memory_order_release);
  keepLater(*variant);
  return variant.release();
}

/// Nanoseconds that tier-0 code runs for before tier-1 code is made, which is
/// worth it if it will run for longer than that takes: a tenth of the time that
/// code of its size does.
static constexpr int64_t leastPatience = 1'000'000, patiencePerByte = 300;

/// Launches of a GPU's tier-0 code that ask for tier-1 code: what is
/// launched again may well be launched often. One launch will do if it fills a
/// card, or is recorded.
static constexpr int64_t launchesUntilBetter = 2, manyThreads = 1 << 18;

/// Tasks for which launches wait, and bytes of PTX, from which it pays to start
/// a program that assembles.
static constexpr int manyTasks = 4;
static constexpr size_t longText = 30'000;

/// True if code had better be assembled beside the driver. Programs of other
/// options are for debuggers and profilers.
static bool mayAssembleApart(const CompileOptions &wanted, size_t bytes) {
  return !wanted.debug && !wanted.lineinfo &&
         (bytes >= longText || background::urgentTasks() >= manyTasks);
}

void Kernel::Impl::load(Variant &variant, const CompileOptions *wanted) {
  variant.code.schedule.cost =
      std::clamp(variant.code.schedule.cost, 1.0, 1e12);
  Stopwatch watch(times);
  variant.label = permanentName(name);
  Device &device = deviceAt(variant.key.device);
  Code &code = variant.code;
  size_t bytes = code.binary.size();
  std::unique_ptr<DeviceCode> loaded = device.loadKept(variant, code);
  bool isKept = loaded != nullptr;
  bool mayWait = wanted && (options.quickFirst || options.linkedFirst) &&
                 !capturesFixedCode(device.index);
  if (loaded && loaded->isProvisional() && !mayWait)
    loaded = nullptr;
  // The driver makes whole programs one after the other: launches that wait
  // for the code of several kernels have others make it, or long ones linked
  // first.
  bool isBeside = !isKept && wanted && background::isWorker();
  // A thread that needs code at once would come behind all of them.
  bool isBehind = !isKept && wanted && background::urgentTasks() >= manyTasks;
  if ((isBeside || isBehind) && mayAssembleApart(*wanted, bytes))
    loaded = device.loadAssembled(variant, code,
                                  /*mayBeWorse=*/isBeside && mayWait);
  if (!loaded && isBeside && mayWait && KernelCache::get().enabled())
    loaded = device.loadLinked(variant, code);
  if (loaded && loaded->isProvisional() && !variant.quick) {
    variant.quick = makeQuick(*wanted, variant);
    variant.isQuick = true;
  }
  if (!loaded) {
    if (wanted && !isKept)
      setUnkept(variant, code);
    loaded = device.load(variant, code);
  }
  variant.place(std::move(loaded));
  if (variant.quick)
    variant.quick->patience =
        device.isHost()
            ? std::max<int64_t>(leastPatience, patiencePerByte * bytes)
            : launchesUntilBetter;
  watch.lap("load");
  code.binary = {};
}

std::unique_ptr<DeviceCode> Kernel::Impl::loadBest(Variant &variant,
                                                   Code &code) {
  Device &device = deviceAt(variant.key.device);
  std::unique_ptr<DeviceCode> loaded = device.loadKept(variant, code);
  if (loaded && !loaded->isProvisional())
    return loaded;
  if ((loaded = device.loadAssembled(variant, code, /*mayBeWorse=*/false)))
    return loaded;
  // The driver assembles for one thread at a time: those that somebody waits
  // for find one other there at most.
  static auto *assembling = new ForkMutex;
  std::lock_guard assembles(*assembling);
  if (isAbandoned())
    return nullptr;
  setUnkept(variant, code);
  return device.load(variant, code);
}

void Kernel::Impl::setUnkept(Variant &variant, const Code &code) {
  if (!isHost(variant.key.device) && KernelCache::get().enabled() &&
      !isElf(code.binary))
    variant.unkept = std::make_shared<Code>(code);
}

void Kernel::Impl::keepLater(Variant &variant) {
  std::shared_ptr<Code> code = std::move(variant.unkept);
  if (!code)
    return;
  const DeviceCode *loaded = variant.current;
  background::add([self = weak_from_this(), code, &variant, loaded] {
    std::shared_ptr<Impl> impl = self.lock();
    if (!impl || isAbandoned())
      return;
    try {
      deviceAt(variant.key.device).keep(variant, std::move(*code), *loaded);
    } catch (...) {
      // A later process asks the driver again.
    }
  });
}

//===----------------------------------------------------------------------===//
// Quickly compiled code
//===----------------------------------------------------------------------===//

/// True until a driver rejects the assembled library.
static std::atomic<bool> linksLibrary{true};

bool Kernel::Impl::mayBeQuick(const VariantKey &key,
                              const CompileOptions &wanted,
                              int64_t items) const {
  if (!options.quickFirst || wanted.debug || wanted.fastMath || wanted.lineinfo)
    return false;
  if (isHost(key.device))
    return true;
  bool isOpen = wanted.maxRegisters == 0 && wanted.minBlocks == 0;
  return linksLibrary && isOpen && items != anyItems &&
         !capturesFixedCode(key.device) && wanted.optLevel >= 2 &&
         hasAssembledLibrary(wanted.target);
}

FirstCode Kernel::Impl::obtainFirst(const CompileOptions &wanted,
                                    int64_t items) {
  Stopwatch watch(times);
  CompileOptions quick = quickOptions(wanted);
  std::string best = fingerprint(hashes(), wanted);
  std::string key = fingerprint(hashes(), quick);
  watch.lap("fingerprint");
  auto find = [&]() -> std::optional<FirstCode> {
    if (std::optional<Code> code = findCached(best))
      return FirstCode{std::move(*code), false};
    std::optional<Code> code = findCached(key);
    if (code && (quick.linked || isQuickEnough(*code, items)))
      return FirstCode{std::move(*code), true};
    return std::nullopt;
  };
  std::optional<FirstCode> cached = find();
  watch.lap("cache");
  if (cached)
    return std::move(*cached);
  KernelClaim claim(best);
  if (claim.hasWaited() && (cached = find()))
    return std::move(*cached);
  FirstCode made = compileSource([&](const Module &module) {
    return compileFirst(module, wanted, items);
  });
  watch.lap("compile");
  addTimes(times, made.code.phaseMs, "compile/");
  KernelCache::get().store(made.isQuick ? key : best, made.code);
  watch.lap("cache");
  return made;
}

bool Kernel::Impl::loadLinked(Variant &variant) {
  try {
    load(variant, &variant.quick->wanted);
  } catch (const Error &error) {
    // The driver does not take machine code of this age.
    if (error.kind == Error::Kind::Compile)
      linksLibrary = false;
    return false;
  }
  if (variant.current.load()->maxThreads() >= variant.key.blockDim)
    return true;
  // The library's functions take more registers than such blocks have.
  variant.current = nullptr;
  variant.loaded.clear();
  variant.unkept = nullptr;
  return false;
}

std::unique_ptr<QuickCode> Kernel::Impl::makeQuick(const CompileOptions &wanted,
                                                   Variant &variant) {
  auto quick = std::make_unique<QuickCode>();
  quick->wanted = wanted;
  quick->ask = [self = weak_from_this(), &variant] {
    background::add([self, &variant] {
      if (std::shared_ptr<Impl> impl = self.lock())
        impl->improve(variant);
    });
  };
  return quick;
}

void Kernel::Impl::improve(Variant &variant) {
  if (!variant.isQuick)
    return;
  std::lock_guard alone(variant.quick->mutex);
  if (!variant.isQuick)
    return;
  std::map<std::string, double> spent;
  std::unique_ptr<DeviceCode> better;
  try {
    Code code = obtain(variant.quick->wanted, spent);
    if (!isAbandoned())
      better = loadBest(variant, code);
  } catch (...) {
    // The tier-0 code does the same.
  }
  std::lock_guard lock(mutex);
  addTimes(times, spent);
  if (better) {
    variant.place(std::move(better));
    keepLater(variant);
  }
  variant.isQuick = false;
}

bool warp::isTooSlow(const Kernel::Variant &variant, int64_t items) {
  if (!variant.isQuick.load(std::memory_order_relaxed))
    return false;
  return isHost(variant.key.device) ? !isQuickEnough(variant.code, items)
                                    : capturesFixedCode(variant.key.device);
}

void QuickCode::spend(int64_t amount) {
  int64_t left = patience.fetch_sub(amount, std::memory_order_relaxed);
  if (left > 0 && left <= amount)
    ask();
}

void QuickCode::spendLaunch(int64_t threads, bool isRecorded) {
  spend(isRecorded || threads >= manyThreads ? launchesUntilBetter : 1);
}

//===----------------------------------------------------------------------===//
// Source
//===----------------------------------------------------------------------===//

const Module &Kernel::Impl::source() {
  ForkSection section;
  std::call_once(parsed, [this] {
    if (!text.empty())
      module = Module::fromText(text);
  });
  if (!module.getImpl())
    throw Error(Error::Kind::Value,
                "kernel '" + name + "' was saved without its source");
  return module;
}

const SourceHashes &Kernel::Impl::hashes(std::string *text) {
  ForkSection section;
  std::call_once(hashed,
                 [&] { knownHashes = warp::sourceHashes(source(), text); });
  return knownHashes;
}

int Kernel::Impl::threadRank() {
  int rank = knownRank;
  if (rank == 0)
    knownRank = rank = warp::threadRank(source());
  return rank;
}
