//===- KernelVariants.cpp - Which variant a launch needs ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `keyFor` checks the extents and reads the array descriptors in the parameter
// block; the result, rank, which arrays are packed, whether 32-bit indices do,
// names the variant. `find` walks the variants made so far, a list that only
// grows and is read without a lock; a kernel has one or two.
//
//===----------------------------------------------------------------------===//

#include "KernelImpl.h"
#include "Overlap.h"
#include "cuda/Driver.h"
#include "cuda/LibraryKernels.h"
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
  // Of indices that are zero the kernel need not know.
  while (key.rank > 1 && dim.extent[key.rank - 1] == 1)
    --key.rank;
  if (key.rank == 1 || options.lanes != 0)
    return;
  for (int row = leastRow; row <= mostRow && key.innerExtent == 0; row *= 2)
    if (dim.extent[key.rank - 1] <= row)
      key.innerExtent = row;
}

/// Elements of a packed array are then aligned, too.
static bool isAligned(const ArrayDescriptor &array, int64_t elementSize) {
  auto places = reinterpret_cast<uintptr_t>(array.data) |
                reinterpret_cast<uintptr_t>(array.grad);
  return places % packedAlignment(elementSize) == 0;
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
      bool packed =
          isPacked(array, param.elementSize, count) &&
          (device == cpuDevice || isAligned(array, param.elementSize));
      key.index32 &= count <= INT32_MAX;
      plan.bytes += count * param.elementSize * (array.grad ? 2 : 1);
      if (param.kind == Param::Kind::Array && packed && i < 64)
        key.contiguous |= uint64_t(1) << i;
    }
  }
  if (device == cpuDevice) {
    // Sums keep their order in launches of any size where that is asked for.
    key.underfilled = items < fewLanes && options.lanes == 0 &&
                      !options.debug && !options.deterministic;
    key.threadOrder = isInTurn(items);
    setRows(key, dim);
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
  std::lock_guard lock(mutex);
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
               (access.combined && (!access.fetched || isInTurn(1)));
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

Kernel::Variant *Kernel::Impl::findForAnyRows(VariantKey key, int rank,
                                              int64_t items) const {
  key.rank = rank;
  key.innerExtent = 0;
  Variant *variant = find(key);
  bool isSmall =
      variant && variant->code.cost * static_cast<double>(items) <= smallWork;
  return isSmall ? variant : nullptr;
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
  result.underfilled = key.underfilled;
  result.skinny = key.skinny;
  result.maxBlockCoarsening = key.maxBlockCoarsening;
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
  result.threadOrder = arch == 0 && key.threadOrder;
  result.lineinfo = options.lineinfo;
  result.optLevel = options.optLevel;
  result.threads = arch == 0 ? std::min(ThreadPool::size(), 16) : 1;
  result.blockDim = key.blockDim ? key.blockDim : options.blockDim;
  if (options.maxThreads)
    result.blockDim = std::min(result.blockDim, options.maxThreads);
  result.maxRegisters = options.maxRegisters;
  result.minBlocks = options.minBlocks;
  result.lanes = arch == 0 ? options.lanes : 0;
  result.innerExtent = key.innerExtent;
  return result;
}

VariantKey Kernel::Impl::usualKey(int rank) const {
  VariantKey key;
  key.rank = rank;
  for (size_t i = 0; i < params.size() && i < 64; ++i)
    if (params[i].kind == Param::Kind::Array || isIntegerScalar(params[i]))
      key.contiguous |= uint64_t(1) << i;
  key.disjoint = true;
  key.threadOrder = isInTurn(1);
  return key;
}
