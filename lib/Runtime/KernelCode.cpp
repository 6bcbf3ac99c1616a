//===- KernelCode.cpp - Where the code of variants comes from -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `make` gets the code of a variant, from a file that was saved, from the disk
// cache or from the compiler, and loads it.
//
// On CPUs a first launch of few operations, and any of very long code, gets
// code that is compiled quickly. When that has run for a while, `improve` has
// it compiled once more, with all effort, on a thread in the background, and
// puts the new entry in the place of the old one: both compute the same bits,
// so launches, recorded ones and those in graphs too, go over to it without
// knowing. A launch of many operations waits for the better code, but for that
// of long code.
//
//===----------------------------------------------------------------------===//

#include "BackgroundThread.h"
#include "GraphImpl.h"
#include "KernelImpl.h"
#include "Support.h"
#include "warp/FirstCode.h"
#include "warp/KernelCache.h"
#include "warp/SavedModule.h"

#include <algorithm>
#include <chrono>

using namespace warp;

/// Largest parameter block of a GPU kernel: PTX 8.1, which kernels for newer
/// architectures are in, has room for more.
static size_t maxCudaParameters(int arch) { return arch < 90 ? 4096 : 32764; }

Kernel::Variant::~Variant() {
  CpuEntry entry = cpu;
  if (entry)
    Jit::get().unload(reinterpret_cast<void *>(entry));
  if (quick && quick->entry != entry)
    Jit::get().unload(reinterpret_cast<void *>(quick->entry));
  if (loaded)
    unloadFromCuda(key.device, loaded);
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

Code Kernel::Impl::obtain(const CompileOptions &compileOptions,
                          std::map<std::string, double> &spent) {
  Stopwatch watch(spent);
  std::string key = fingerprint(hashes(), compileOptions);
  watch.lap("fingerprint");
  KernelCache &cache = KernelCache::get();
  std::optional<Code> cached = cache.find(key);
  watch.lap("cache");
  if (cached)
    return std::move(*cached);
  Code code = compile(source(), compileOptions);
  watch.lap("compile");
  addTimes(spent, code.phaseMs, "compile/");
  cache.store(key, code);
  watch.lap("cache");
  return code;
}

Kernel::Variant *Kernel::Impl::make(const VariantKey &key, int64_t items) {
  cuda::RelaxedCaptures relaxed;
  std::lock_guard<std::mutex> lock(mutex);
  if (Variant *made = find(key))
    return made;
  int arch = key.device == cpuDevice ? 0 : deviceInfo(key.device).arch;
  if (arch != 0 && paramSize > maxCudaParameters(arch))
    throw launchError(Error::Kind::LaunchType, name,
                      "expects at most " +
                          std::to_string(maxCudaParameters(arch)) +
                          " bytes of arguments on CUDA devices, but got " +
                          std::to_string(paramSize));
  auto variant = std::make_unique<Variant>();
  variant->key = key;
  variant->flat = key.flat;
  if (saved.empty() || !obtainSaved(key, arch, *variant)) {
    CompileOptions wanted = compileOptions(key, arch);
    FirstCode first = arch == 0 && options.quickFirst
                          ? obtainFirst(wanted, items)
                          : FirstCode{obtain(wanted, times)};
    variant->code = std::move(first.code);
    if (first.isQuick)
      variant->quick = makeQuick(wanted, *variant);
    variant->isQuick = first.isQuick;
  }
  load(*variant);
  variant->next = variants.load(std::memory_order_relaxed);
  variants.store(variant.get(), std::memory_order_release);
  return variant.release();
}

/// Nanoseconds that quick code runs for before better code is made, which is
/// worth it if it will run for longer than that takes: a tenth of the time that
/// code of its size does.
static constexpr int64_t leastPatience = 1'000'000, patiencePerByte = 300;

void Kernel::Impl::load(Variant &variant) {
  variant.code.cost = std::clamp(variant.code.cost, 1.0, 1e12);
  Stopwatch watch(times);
  if (variant.key.device == cpuDevice) {
    variant.cpu = reinterpret_cast<CpuEntry>(Jit::get().load(variant.code));
    if (variant.quick) {
      variant.quick->entry = variant.cpu;
      variant.quick->patience = std::max<int64_t>(
          leastPatience, patiencePerByte * variant.code.binary.size());
    }
  } else {
    loadOnCuda(variant);
    variant.label = permanentName(name);
    if (options.debug)
      variant.record = std::make_unique<DeviceErrorRecord>(variant.key.device,
                                                           variant.code.sites);
  }
  watch.lap("load");
  variant.code.binary = {};
}

//===----------------------------------------------------------------------===//
// Quickly compiled code
//===----------------------------------------------------------------------===//

FirstCode Kernel::Impl::obtainFirst(const CompileOptions &wanted,
                                    int64_t items) {
  if (wanted.debug || wanted.fastMath || wanted.lineinfo)
    return {obtain(wanted, times)};
  KernelCache &cache = KernelCache::get();
  Stopwatch watch(times);
  CompileOptions quick = wanted;
  quick.optLevel = quickLevel;
  std::string best = fingerprint(hashes(), wanted);
  std::string key = fingerprint(hashes(), quick);
  watch.lap("fingerprint");
  std::optional<Code> cached = cache.find(best);
  bool isQuick = !cached;
  if (isQuick)
    cached = cache.find(key);
  watch.lap("cache");
  if (cached && (!isQuick || isQuickEnough(*cached, items)))
    return {std::move(*cached), isQuick};
  FirstCode made = compileFirst(source(), wanted, items);
  watch.lap("compile");
  addTimes(times, made.code.phaseMs, "compile/");
  cache.store(made.isQuick ? key : best, made.code);
  watch.lap("cache");
  return made;
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
  std::lock_guard<std::mutex> alone(variant.quick->mutex);
  if (!variant.isQuick)
    return;
  std::map<std::string, double> spent;
  CpuEntry better = nullptr;
  try {
    Code code = obtain(variant.quick->wanted, spent);
    better = reinterpret_cast<CpuEntry>(Jit::get().load(code));
  } catch (...) {
    // What there is does the same.
  }
  std::lock_guard<std::mutex> lock(mutex);
  addTimes(times, spent);
  if (better)
    variant.cpu = better;
  variant.isQuick = false;
}

bool warp::isTooSlow(const Kernel::Variant &variant, int64_t items) {
  return variant.isQuick.load(std::memory_order_relaxed) &&
         !isQuickEnough(variant.code, items);
}

void QuickCode::spend(int64_t nanoseconds) {
  int64_t left = patience.fetch_sub(nanoseconds, std::memory_order_relaxed);
  if (left > 0 && left <= nanoseconds)
    ask();
}

//===----------------------------------------------------------------------===//
// Source
//===----------------------------------------------------------------------===//

const Module &Kernel::Impl::source() {
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
  std::call_once(hashed, [&] { knownHashes = sourceHashes(source(), text); });
  return knownHashes;
}

int Kernel::Impl::threadRank() {
  int rank = knownRank;
  if (rank == 0)
    knownRank = rank = warp::threadRank(source());
  return rank;
}
