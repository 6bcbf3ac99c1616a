//===- KernelVariants.cpp - Variant lookup: one key per launch ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `keyFor` checks the extents and reads the facts of a launch off the parameter
// block: rank, which arrays are packed, whether 32-bit indices do. `applyNeeds`
// weakens the key where the arrays do not meet what code of the kernel needs.
// The key names one variant. `find` walks the variants made so far, a list that
// only grows and is read without a lock; a kernel has one or two.
//
//===----------------------------------------------------------------------===//

#include "BackgroundThread.h"
#include "CopyNest.h"
#include "ExactSums.h"
#include "GraphImpl.h"
#include "Grid.h"
#include "KernelImpl.h"
#include "LaunchQueue.h"
#include "Overlap.h"
#include "PrivateCopies.h"
#include "Support.h"
#include "warp/Memory.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <climits>
#include <cstring>

using namespace warp;

/// Items that fill any card many times over.
static constexpr int64_t largeLaunch = int64_t(1) << 21;
/// Launches below so many threads per multiprocessor leave a card waiting.
static constexpr int64_t fewThreads = 768;
/// Launches below so many threads leave a CPU's vector waiting.
static constexpr int64_t fewLanes = 16;
/// Rows of a CPU launch for which code has fewer lanes than vectors have room
/// for: powers of two from the first to the last.
static constexpr int leastRow = 4, mostRow = 32;
/// Operations of a launch for which code for rows of any length does, where
/// there is some.
static constexpr double smallWork = 1e5;
/// Extents from which on squares of 32 indices are mostly full.
static constexpr int64_t wideExtent = 96;
/// Launches with zeros that leave out code until there is a version without it:
/// a kernel that is launched once is compiled once.
static constexpr int launchesUntilVersion = 2;
/// Several threads must share the first dimension for one to take many indices
/// of it.
static constexpr int64_t fewPlanes = 64;

Error warp::launchError(Error::Kind kind, const std::string &kernel,
                        const std::string &message) {
  return Error(kind, "launch('" + kernel + "'): " + message);
}

static void checkExtents(const std::string &kernel, const LaunchDim &dim) {
  if (dim.rank < 1 || dim.rank > maxRank)
    throw launchError(Error::Kind::LaunchValue, kernel,
                      "expects 1 to 4 dimensions, but got " +
                          std::to_string(dim.rank));
  for (int i = 0; i < dim.rank; ++i) {
    if (dim.extent[i] < 0)
      throw launchError(Error::Kind::LaunchValue, kernel,
                        "expects non-negative extents, but got '" +
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

/// Blocks in a row that may be one: multiprocessors are then at work as long as
/// with each of them alone.
static int countJoinable(const VariantKey &key, const LaunchDim &dim,
                         int64_t items, int smCount) {
  if (dim.rank < 2 || dim.extent[dim.rank - 1] != key.blockDim)
    return 1;
  auto rounds = [&](int joined) {
    int64_t blocks = items / key.blockDim / joined;
    return ceilDivide(blocks, smCount) * joined;
  };
  int most = 4;
  while (most > 1 &&
         (dim.extent[dim.rank - 2] % most != 0 || rounds(most) > rounds(1)))
    most /= 2;
  return most;
}

void Kernel::Impl::setSize(VariantKey &key, const LaunchDim &dim, int64_t items,
                           int smCount) {
  key.large =
      items >= largeLaunch && (dim.rank == 1 || dim.extent[0] >= fewPlanes);
  key.underfilled = items < fewThreads * smCount;
  key.skinny = dim.rank > 1 && (dim.extent[dim.rank - 1] < wideExtent ||
                                dim.extent[dim.rank - 2] < wideExtent);
  key.maxBlockCoarsening = countJoinable(key, dim, items, smCount);
}

void Kernel::Impl::setRows(VariantKey &key, const LaunchDim &dim) const {
  // Saved code is for the dimensions that it was saved with.
  if (!saved.empty() || options.debug)
    return;
  // The kernel need not know of indices that are always zero.
  while (key.rank > 1 && dim.extent[key.rank - 1] == 1)
    --key.rank;
  if (key.rank == 1 || options.lanes != 0)
    return;
  for (int row = leastRow; row <= mostRow && key.innerExtent == 0; row *= 2)
    if (dim.extent[key.rank - 1] <= row)
      key.innerExtent = row;
}

static const ArrayDescriptor &arrayAt(const void *params, int64_t offset) {
  return *reinterpret_cast<const ArrayDescriptor *>(
      static_cast<const char *>(params) + offset);
}

int64_t Kernel::Impl::arrayBytes(const void *params) const {
  int64_t bytes = 0;
  for (const ArrayArgument &argument : arrays) {
    const ArrayDescriptor &array = arrayAt(params, argument.offset);
    bytes += countElements(array) * argument.elementSize * (array.grad ? 2 : 1);
  }
  return bytes;
}

/// Threads of a block, at most.
static constexpr int maxBlock = 1024;

int Kernel::Impl::checkedBlockDim(int asked) const {
  int most = options.maxThreads ? options.maxThreads : maxBlock;
  int own =
      options.maxThreads ? std::min(options.blockDim, most) : options.blockDim;
  int threads = asked > 0 ? asked : own;
  if (threads < 1 || threads > most)
    throw Error(Error::Kind::LaunchValue,
                "launch('" + name + "'): expects 1 to " + std::to_string(most) +
                    " threads per block, but got '" + std::to_string(threads) +
                    "'");
  return threads;
}

VariantKey Kernel::Impl::keyFor(int device, const LaunchDim &dim,
                                const void *params, int blockDim,
                                Plan &plan) const {
  checkExtents(name, dim);
  int64_t &items = plan.items;
  items = 1;
  for (int i = 0; i < dim.rank; ++i)
    if (__builtin_mul_overflow(items, dim.extent[i], &items))
      throw launchError(Error::Kind::LaunchValue, name,
                        "expects less than 2^63 threads in all");
  VariantKey key;
  key.device = device;
  key.rank = dim.rank;
  key.blockDim = options.blockDim;
  // The last GPU block may count beyond the end by its threads and items.
  key.index32 = items <= INT32_MAX - 4096;
  auto *bytes = static_cast<const char *>(params);
  bool isCpu = isHost(device);
  bool choosesLanes =
      isCpu && saved.empty() && !options.debug && options.lanes == 0;
  for (const IntegerArgument &integer : integers)
    if (bytes[integer.highByte] >= 0)
      key.nonNegative |= integer.bit;
  int32_t packed = isCpu ? arrayPacked : arrayPacked | arrayAligned;
  int32_t anyFacts = 0;
  for (const ArrayArgument &argument : arrays) {
    const ArrayDescriptor &array = arrayAt(params, argument.offset);
    int32_t facts = array.flags;
    if (!(facts & arrayKnown))
      facts = arrayFacts(array, argument.elementSize);
    if ((facts & packed) == packed)
      key.packed |= argument.bit;
    anyFacts |= facts;
  }
  key.index32 &= !(anyFacts & arrayLong);
  key.farRows = choosesLanes && anyFacts & arrayFarRows;
  if (isCpu) {
    // Sums keep their order in launches of any size where that is asked for.
    key.underfilled = items < fewLanes && options.lanes == 0 &&
                      !options.debug && !options.deterministic;
    key.threadOrder = isInTurn(items);
    setRows(key, dim);
    return key;
  }
  key.blockDim = checkedBlockDim(blockDim);
  setSize(key, dim, items, deviceInfo(device).smCount);
  key.flat = !fitsGrid(dim, key.blockDim);
  return key;
}

void Kernel::Impl::findAccesses() {
  std::lock_guard lock(mutex);
  if (hasAccesses.load(std::memory_order_relaxed))
    return;
  if (hasSource())
    setAccesses(warp::accesses(source()));
}

/// On the CPU adjoints have another order of accesses without overlaps, loops
/// whose end depends on loads have lanes, sums may be made in copies, and tiles
/// are loaded where they are used.
void Kernel::Impl::setAccesses(std::vector<Access> list) {
  accesses = std::move(list);
  for (const Access &access : accesses)
    overlapMatters |= access.gradientSize != 0 || access.watched ||
                      (access.combined && (!access.fetched || isInTurn(1)));
  hasAccesses.store(true, std::memory_order_release);
}

/// Appends the entries that a list does not have yet.
template <typename Entry>
static bool merge(std::vector<Entry> &list, const std::vector<Entry> &more) {
  size_t before = list.size();
  for (const Entry &entry : more)
    if (std::none_of(list.begin(), list.end(), [&](const Entry &other) {
          return std::memcmp(&entry, &other, sizeof(Entry)) == 0;
        }))
      list.push_back(entry);
  return list.size() != before;
}

bool LaunchNeeds::add(const Schedule &schedule) {
  bool isNew = merge(sums, schedule.sums);
  isNew |= (schedule.switches & ~switches) != 0;
  switches |= schedule.switches;
  isNew |= merge(tensorMaps, schedule.tensorMaps);
  if (!schedule.copied.list.empty() && copied.list.empty()) {
    copied = schedule.copied;
    cost = schedule.cost;
    isNew = true;
  }
  return isNew;
}

void Kernel::Impl::noteNeeds(const Schedule &schedule) {
  const LaunchNeeds *known = needs.load(std::memory_order_relaxed);
  auto more = known ? std::make_unique<LaunchNeeds>(*known)
                    : std::make_unique<LaunchNeeds>();
  if (!more->add(schedule))
    return;
  needs.store(more.get(), std::memory_order_release);
  needsMade.push_back(std::move(more));
}

uint64_t Kernel::Impl::findZeros(uint64_t among, const VariantKey &key,
                                 const void *params, bool &reads) const {
  auto *bytes = static_cast<const char *>(params);
  // A graph runs later, when the memory may hold something else.
  bool mayRead = isHost(key.device) && !hostRecorder();
  uint64_t found = 0, inArrays = 0;
  for (const SwitchArgument &argument : switches) {
    if (!(among & argument.bit))
      continue;
    const char *value = bytes + argument.offset;
    if (argument.isArray) {
      ArrayDescriptor array;
      std::memcpy(&array, value, sizeof(array));
      value = static_cast<const char *>(array.data);
      if (!mayRead || !value || countElements(array) == 0)
        continue;
      reads = true;
    }
    if (std::all_of(value, value + argument.size,
                    [](char byte) { return byte == 0; }))
      (argument.isArray ? inArrays : found) |= argument.bit;
  }
  // The launch itself might write them.
  bool isConstant = inArrays && (key.disjoint || areDisjoint(accesses, params));
  return isConstant ? found | inArrays : found;
}

/// One version at most, for the zeros of the launch that was asked for it: what
/// a scene leaves out, it leaves out for long. A launch that waits for its code
/// counts when it is made, not when its code is, and asks for no version: who
/// waits for it would wait for that, too.
void Kernel::Impl::setZeros(VariantKey &key, uint64_t among, const void *params,
                            bool &reads) const {
  uint64_t zeros = findZeros(among, key, params, reads);
  uint64_t version = versionZeros.load(std::memory_order_relaxed);
  if (zeros && !version && !background::isWorker() &&
      launchesWithZeros.fetch_add(1, std::memory_order_relaxed) + 1 >=
          launchesUntilVersion &&
      behindNothing == 0 &&
      versionZeros.compare_exchange_strong(version, zeros))
    version = zeros;
  if (version && (zeros & version) == version)
    key.zeros = version;
}

/// Launches are planned anew while those with zeros are counted.
bool Kernel::isCurrent(const Plan &plan, const void *params) const {
  if (!plan.variant || !isHost(plan.device) || hostRecorder())
    return false;
  const VariantKey &key = plan.variant->key;
  const LaunchNeeds *needs = impl->needs.load(std::memory_order_acquire);
  uint64_t version = impl->versionZeros.load(std::memory_order_relaxed);
  uint64_t among = version ? version : needs ? needs->switches : 0;
  bool reads = false;
  uint64_t zeros = impl->findZeros(among, key, params, reads);
  if (!version)
    return zeros == 0 && key.zeros == 0;
  return key.zeros == (zeros == version ? version : 0);
}

void Kernel::Impl::applyNeeds(const LaunchNeeds &needs, Plan &plan,
                              const void *params, VariantKey &key) const {
  Device &device = deviceAt(plan.device);
  bool isCpu = device.isHost();
  key.ordered =
      (!isCpu || options.sameOnDevices) && overlap(needs.sums, params);
  key.unmapped =
      !needs.tensorMaps.empty() && !device.canMap(needs.tensorMaps, params);
  if (needs.switches && saved.empty())
    setZeros(key, needs.switches, params, plan.readsMemory);
  // Code that does not know that arrays are disjoint makes no copies.
  if (isCpu && !needs.copied.list.empty() &&
      isWorthThreads(needs.cost * static_cast<double>(plan.items)) &&
      chooseUpdates(needs.copied, params, plan.items) == UpdateMode::Atomic)
    key.disjoint = false;
}

Kernel::Variant *Kernel::Impl::find(const VariantKey &key) const {
  Variant *variant = variants.load(std::memory_order_acquire);
  while (variant && !variant->serves(key))
    variant = variant->next;
  return variant;
}

Kernel::Variant *Kernel::Impl::findForAnyRows(VariantKey key, int rank,
                                              int64_t items) const {
  key.rank = rank;
  key.innerExtent = 0;
  Variant *variant = find(key);
  bool isSmall =
      variant &&
      variant->code.schedule.cost * static_cast<double>(items) <= smallWork;
  return isSmall ? variant : nullptr;
}

CompileOptions Kernel::Impl::compileOptions(const VariantKey &key,
                                            int arch) const {
  CompileOptions result;
  static_cast<LaunchFacts &>(result) = key;
  result.target = arch == 0 ? "cpu" : "sm_" + std::to_string(arch);
  // For such devices alone, so with what later architectures do not have.
  if (arch == 90 && !key.unmapped)
    result.target += "a";
  if (arch != 0 && !isHost(key.device))
    result.driverVersion = cudaDriverVersion();
  result.debug = options.debug;
  result.fastMath = options.fastMath;
  result.deterministic = options.deterministic;
  result.ordered = options.deterministic &&
                   (key.ordered || (arch == 0 && !options.sameOnDevices));
  result.threadOrder = arch == 0 && key.threadOrder;
  result.lineinfo = options.lineinfo;
  result.optLevel = options.optLevel;
  result.threads = arch == 0 ? std::min(ThreadPool::size(), 16) : 1;
  if (options.maxThreads)
    result.blockDim = std::min(result.blockDim, options.maxThreads);
  result.maxRegisters = options.maxRegisters;
  result.minBlocks = options.minBlocks;
  result.lanes = arch == 0 ? options.lanes : 0;
  return result;
}

VariantKey Kernel::Impl::usualKey(int rank) const {
  VariantKey key;
  key.rank = rank;
  key.blockDim = options.blockDim;
  for (const IntegerArgument &integer : integers)
    key.nonNegative |= integer.bit;
  for (const ArrayArgument &array : arrays)
    key.packed |= array.bit;
  key.disjoint = true;
  key.threadOrder = isInTurn(1);
  return key;
}
