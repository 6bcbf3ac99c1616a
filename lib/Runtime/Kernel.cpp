//===- Kernel.cpp - A kernel and its compiled variants --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch goes through three steps. `keyFor` checks the extents and reads the
// array descriptors in the parameter block; the result, rank, which arrays are
// packed, whether 32-bit indices do, names the variant. `find` walks the
// variants made so far, a list that only grows and is read without a lock; a
// kernel has one or two. `make` gets the code, from the disk cache or the
// compiler, and loads it.
//
// CPU launches below a few ten thousand operations run on the calling thread:
// waking others would cost more than it saves.
//
//===----------------------------------------------------------------------===//

#include "warp/Kernel.h"

#include "ExactSums.h"
#include "GraphImpl.h"
#include "KernelImpl.h"
#include "Overlap.h"
#include "PrivateCopies.h"
#include "Support.h"
#include "TensorMaps.h"
#include "warp/KernelCache.h"
#include "warp/SavedModule.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <chrono>
#include <climits>
#include <cstdio>
#include <cstring>

using namespace warp;

/// Operations worth a second thread.
static constexpr double parallelThreshold = 32768;

/// Items that fill any card many times over.
static constexpr int64_t largeLaunch = int64_t(1) << 21;
/// Launches below so many threads per multiprocessor leave a card waiting.
static constexpr int64_t fewThreads = 768;
/// Launches below so many threads leave a CPU's vector waiting.
static constexpr int64_t fewLanes = 16;
/// Extents from which on squares of 32 indices are mostly full.
static constexpr int64_t wideExtent = 96;
/// Several threads must share the first dimension for one to take many indices
/// of it.
static constexpr int64_t fewPlanes = 64;

/// Largest parameter block of a GPU kernel: PTX 8.1, which kernels for newer
/// architectures are in, has room for more.
static size_t maxCudaParameters(int arch) { return arch < 90 ? 4096 : 32764; }

static Error launchError(Error::Kind kind, const std::string &kernel,
                         const std::string &message) {
  return Error(kind, "launch('" + kernel + "'): " + message);
}

Kernel::Variant::~Variant() {
  if (cpu)
    Jit::get().unload(reinterpret_cast<void *>(cpu));
  if (loaded)
    unloadFromCuda(key.device, loaded);
}

//===----------------------------------------------------------------------===//
// Variants
//===----------------------------------------------------------------------===//

static void checkExtents(const std::string &kernel, const LaunchDim &dim) {
  if (dim.rank < 1 || dim.rank > maxRank)
    throw launchError(Error::Kind::LaunchValue, kernel,
                      "expects 1 to 4 dimensions, but got " +
                          std::to_string(dim.rank));
  for (int i = 0; i < dim.rank; ++i) {
    if (dim.extent[i] < 0)
      throw launchError(Error::Kind::LaunchValue, kernel,
                        "expects extents of 0 or more, but got '" +
                            std::to_string(dim.extent[i]) + "' for dimension " +
                            std::to_string(i));
    if (dim.extent[i] > INT32_MAX)
      throw launchError(Error::Kind::LaunchValue, kernel,
                        "expects extents below 2^31, but got '" +
                            std::to_string(dim.extent[i]) + "' for dimension " +
                            std::to_string(i));
  }
}

/// "si32", "ui8": a scalar whose last byte has the highest bit.
bool warp::isIntegerScalar(const Param &param) {
  return param.kind == Param::Kind::Scalar && param.type.size() > 2 &&
         (param.type[0] == 's' || param.type[0] == 'u') && param.type[1] == 'i';
}

void Kernel::Impl::setSize(VariantKey &key, const LaunchDim &dim, int64_t items,
                           int smCount) {
  key.large =
      items >= largeLaunch && (dim.rank == 1 || dim.extent[0] >= fewPlanes);
  key.under = items < fewThreads * smCount;
  key.narrow = dim.rank > 1 && (dim.extent[dim.rank - 1] < wideExtent ||
                                dim.extent[dim.rank - 2] < wideExtent);
}

VariantKey Kernel::Impl::keyFor(int device, const LaunchDim &dim,
                                const void *params, int blockDim,
                                int64_t &items) const {
  checkExtents(name, dim);
  items = 1;
  for (int i = 0; i < dim.rank; ++i)
    if (__builtin_mul_overflow(items, dim.extent[i], &items))
      throw launchError(Error::Kind::LaunchValue, name,
                        "expects less than 2^63 threads in all");
  VariantKey key;
  key.device = device;
  key.rank = dim.rank;
  // The last GPU block may count beyond the end by its threads and items.
  key.index32 = items <= INT32_MAX - 4096;
  auto *bytes = static_cast<const char *>(params);
  for (size_t i = 0; i < this->params.size(); ++i) {
    const Param &param = this->params[i];
    if (i < 64 && isIntegerScalar(param) &&
        bytes[param.offset + param.size - 1] >= 0)
      key.contiguous |= uint64_t(1) << i;
    for (int64_t offset : param.arrays) {
      ArrayDescriptor array;
      std::memcpy(&array, bytes + param.offset + offset, sizeof(array));
      int64_t count;
      bool packed = isPacked(array, param.elementSize, count);
      key.index32 &= count <= INT32_MAX;
      if (param.kind == Param::Kind::Array && packed && i < 64)
        key.contiguous |= uint64_t(1) << i;
    }
  }
  if (device == cpuDevice) {
    // Sums keep their order in launches of any size where that is asked for.
    key.under = items < fewLanes && options.lanes == 0 && !options.debug &&
                !options.deterministic;
    return key;
  }
  key.blockDim = checkedBlockDim(blockDim);
  int32_t extents[maxRank];
  std::copy(dim.extent, dim.extent + dim.rank, extents);
  setSize(key, dim, items, deviceInfo(device).smCount);
  key.flat = !fitsGrid(extents, dim.rank, key.blockDim);
  return key;
}

void Kernel::Impl::findAccesses() {
  std::lock_guard<std::mutex> lock(mutex);
  if (hasAccesses.load(std::memory_order_relaxed))
    return;
  if (hasSource())
    accesses = warp::accesses(source());
  hasAccesses.store(true, std::memory_order_release);
}

/// On the CPU adjoints have another order of accesses without overlaps, loops
/// that end by what they load have lanes, sums may be made in copies, and tiles
/// are loaded where they are used.
bool Kernel::Impl::isDisjoint(const VariantKey &key, const void *params) const {
  bool matters = key.device != cpuDevice;
  for (const Access &access : accesses)
    matters |= access.gradientSize != 0 || access.watched ||
               (access.combined && !access.fetched);
  if (!matters)
    return false;
  return areDisjoint(accesses, params);
}

Kernel::Variant *Kernel::Impl::find(const VariantKey &key) const {
  Variant *variant = variants.load(std::memory_order_acquire);
  while (variant && !variant->serves(key))
    variant = variant->next;
  return variant;
}

CompileOptions Kernel::Impl::compileOptions(const VariantKey &key,
                                            int arch) const {
  CompileOptions result;
  result.target = arch == 0 ? "cpu" : "sm_" + std::to_string(arch);
  result.rank = key.rank;
  result.contiguous = key.contiguous;
  result.index32 = key.index32;
  result.flat = key.flat;
  result.large = key.large;
  result.under = key.under;
  result.narrow = key.narrow;
  result.disjoint = key.disjoint;
  // For such devices alone, so with what later architectures do not have.
  if (arch == 90 && !key.unmapped)
    result.target += "a";
  if (arch != 0 && key.device != cpuDevice)
    result.driverVersion = cuda::driver()->version;
  result.debug = options.debug;
  result.fastMath = options.fastMath;
  result.deterministic = options.deterministic;
  result.ordered = options.deterministic &&
                   (key.ordered || (arch == 0 && !options.sameOnDevices));
  result.lineinfo = options.lineinfo;
  result.optLevel = options.optLevel;
  result.threads = arch == 0 ? std::min(ThreadPool::size(), 16) : 1;
  result.blockDim = key.blockDim ? key.blockDim : options.blockDim;
  if (options.maxThreads)
    result.blockDim = std::min(result.blockDim, options.maxThreads);
  result.maxRegisters = options.maxRegisters;
  result.minBlocks = options.minBlocks;
  result.lanes = arch == 0 ? options.lanes : 0;
  return result;
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

Code Kernel::Impl::obtain(const CompileOptions &compileOptions) {
  Stopwatch watch(times);
  std::string key = fingerprint(hashes(), compileOptions);
  watch.lap("fingerprint");
  KernelCache &cache = KernelCache::get();
  std::optional<Code> cached = cache.find(key);
  watch.lap("cache");
  if (cached)
    return std::move(*cached);
  Code code = compile(source(), compileOptions);
  watch.lap("compile");
  for (const auto &[phase, milliseconds] : code.phaseMs)
    times["compile/" + phase] += milliseconds;
  cache.store(key, code);
  watch.lap("cache");
  return code;
}

Kernel::Variant *Kernel::Impl::make(const VariantKey &key) {
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
  if (saved.empty() || !obtainSaved(key, arch, *variant))
    variant->code = obtain(compileOptions(key, arch));
  variant->code.cost = std::clamp(variant->code.cost, 1.0, 1e12);
  Stopwatch watch(times);
  if (key.device == cpuDevice) {
    variant->cpu = reinterpret_cast<CpuEntry>(Jit::get().load(variant->code));
  } else {
    loadOnCuda(*variant);
    variant->label = permanentName(name);
    if (options.debug)
      variant->record =
          std::make_unique<DeviceErrorRecord>(key.device, variant->code.sites);
  }
  watch.lap("load");
  variant->code.binary = {};
  variant->next = variants.load(std::memory_order_relaxed);
  variants.store(variant.get(), std::memory_order_release);
  return variant.release();
}

//===----------------------------------------------------------------------===//
// Kernel
//===----------------------------------------------------------------------===//

Kernel::Kernel(Module module, std::string name, KernelOptions options)
    : impl(std::make_unique<Impl>(std::move(module))) {
  impl->name = std::move(name);
  impl->options = options;
  impl->setParameters(warp::parameters(impl->module));
}

Kernel::Kernel(Translation translation, std::string name, KernelOptions options)
    : impl(std::make_unique<Impl>(std::move(translation))) {
  impl->name = std::move(name);
  impl->options = options;
}

Kernel::Impl::Impl(Module module) : module(std::move(module)) {}

Kernel::Impl::Impl(Translation &&translation)
    : module(nullptr), text(std::move(translation.text)),
      knownHashes(std::move(translation.hashes)), knownRank(translation.rank),
      accesses(std::move(translation.accesses)), hasAccesses(true) {
  std::call_once(hashed, [] {});
  setParameters(std::move(translation.params));
}

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

Kernel::Impl::~Impl() = default;

void Kernel::Impl::setParameters(std::vector<Param> list) {
  params = std::move(list);
  int64_t end = sizeof(LaunchHeader);
  for (const Param &param : params)
    end = std::max(end, param.offset + param.size);
  paramSize = (end + 7) / 8 * 8;
}

Kernel::~Kernel() {
  Variant *variant = impl->variants.load();
  while (variant)
    delete std::exchange(variant, variant->next);
}

const std::string &Kernel::name() const { return impl->name; }
const Module &Kernel::module() const { return impl->source(); }

const std::vector<Access> &Kernel::arrayAccesses() const {
  impl->findAccesses();
  return impl->accesses;
}

Translation Kernel::translation() const {
  Translation result;
  result.hashes = impl->hashes(&result.text);
  result.params = impl->params;
  result.accesses = arrayAccesses();
  result.rank = impl->threadRank();
  if (result.text.empty())
    result.text = impl->source().text(/*locations=*/true);
  return result;
}

size_t Kernel::parameterSize() const { return impl->paramSize; }
KernelOptions Kernel::options() const { return impl->options; }

const std::vector<Param> &Kernel::parameters() const { return impl->params; }

std::map<std::string, double> Kernel::compileTimes() const {
  std::lock_guard<std::mutex> lock(impl->mutex);
  return impl->times;
}

VariantKey Kernel::Impl::usualKey(int rank) const {
  VariantKey key;
  key.rank = rank;
  for (size_t i = 0; i < params.size() && i < 64; ++i)
    if (params[i].kind == Param::Kind::Array || isIntegerScalar(params[i]))
      key.contiguous |= uint64_t(1) << i;
  key.disjoint = true;
  return key;
}

CompileOptions Kernel::optionsFor(int arch, int rank) const {
  return impl->compileOptions(impl->usualKey(rank), arch);
}

Kernel::Plan Kernel::Impl::plan(int device, const LaunchDim &dim, void *params,
                                int blockDim, bool mayMake) {
  Plan plan;
  plan.device = device;
  VariantKey key = keyFor(device, dim, params, blockDim, plan.items);
  if (plan.items == 0)
    return plan;
  plan.openBlock = blockDim <= 0 && options.maxThreads == 0 &&
                   options.blockDim == KernelOptions().blockDim;
  if (!hasAccesses.load(std::memory_order_acquire)) {
    if (!mayMake)
      return plan;
    findAccesses();
  }
  key.disjoint = isDisjoint(key, params);
  LaunchHeader header;
  for (int i = 0; i < dim.rank; ++i)
    header.dim[i] = static_cast<int32_t>(dim.extent[i]);
  std::memcpy(params, &header, sizeof(header));
  auto choose = [&] {
    plan.variant = find(key);
    if (!plan.variant && mayMake)
      plan.variant = make(key);
  };
  choose();
  if (plan.variant && !plan.variant->code.sums.empty() &&
      overlap(plan.variant->code.sums, params)) {
    key.ordered = true;
    choose();
  }
  if (plan.variant && !plan.variant->code.maps.empty() &&
      !canMap(plan.variant->code.maps, params)) {
    key.unmapped = true;
    choose();
  }
  auto estimate = [&] {
    if (plan.variant)
      plan.work = plan.variant->code.cost * static_cast<double>(plan.items);
  };
  estimate();
  if (!isShort(plan) && !plan.variant->code.copied.list.empty() &&
      chooseUpdates(plan.variant->code.copied, params, plan.items) ==
          UpdateMode::Atomic) {
    // Code that does not know that arrays are disjoint makes no copies.
    key.disjoint = false;
    choose();
    estimate();
  }
  return plan;
}

Kernel::Plan Kernel::tryPrepare(int device, const LaunchDim &dim, void *params,
                                int blockDim) {
  return impl->plan(device, dim, params, blockDim, false);
}

Kernel::Plan Kernel::prepare(int device, const LaunchDim &dim, void *params,
                             int blockDim) {
  return impl->plan(device, dim, params, blockDim, true);
}

bool Kernel::isShort(const Plan &plan) {
  return !plan.variant || plan.device != cpuDevice ||
         plan.work < parallelThreshold;
}

bool Kernel::prints(const Plan &plan) {
  return plan.variant && plan.variant->code.usesPrintf;
}

static void setErrorRecord(void *params, uint64_t address) {
  std::memcpy(static_cast<char *>(params) + offsetof(LaunchHeader, errorRecord),
              &address, sizeof(address));
}

void Kernel::run(const Plan &plan, void *params, const Stream *stream) {
  if (!plan.variant)
    return;
  TraceScope tracing(plan.device, stream);
  if (tracing)
    tracing->addLaunch(*this, plan, params);
  if (plan.device == cpuDevice)
    if (HostRecorder *recorder = hostRecorder())
      return recorder->launch(*this, plan, params);
  const std::vector<SummedArray> &arrays = plan.variant->code.sums;
  if (arrays.empty())
    return impl->run(plan, params, stream);
  ExactSums sums(impl->name, plan.device, arrays, params, impl->paramSize,
                 stream);
  impl->run(plan, sums.params(), stream);
  sums.finish();
}

void Kernel::Impl::run(const Plan &plan, void *params, const Stream *stream) {
  const Variant &variant = *plan.variant;
  if (plan.device != cpuDevice) {
    if (variant.record)
      setErrorRecord(params, variant.record->address());
    if (variant.code.maps.empty())
      return launchOnCuda(variant, name, params, stream, plan.openBlock);
    MappedParameters mapped(variant.code.maps, params, paramSize);
    return launchOnCuda(variant, name, mapped.get(), stream, plan.openBlock);
  }
  if (!options.debug) {
    launchOnCpu(variant, params, paramSize, plan.items, isShort(plan));
  } else {
    ErrorRecord record;
    setErrorRecord(params, reinterpret_cast<uint64_t>(&record));
    launchOnCpu(variant, params, paramSize, plan.items, isShort(plan));
    if (record.flag)
      raiseFailedCheck(record, variant.code.sites);
  }
  if (variant.code.usesPrintf)
    std::fflush(stdout);
}

void Kernel::launch(int device, const LaunchDim &dim, void *params,
                    const Stream *stream, int blockDim) {
  run(prepare(device, dim, params, blockDim), params, stream);
}
