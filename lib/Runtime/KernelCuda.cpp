//===- KernelCuda.cpp - Kernels on CUDA devices ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The last dimension of a launch lies on the grid's x axis, the one before on
// y, the product of the rest on z. Blocks are shaped to the launch: wide in x,
// where memory is contiguous, and no wider than the launch is. Launches that
// an axis cannot hold, and those of rank 4, use a variant with one linear
// index.
//
//===----------------------------------------------------------------------===//

#include "GraphImpl.h"
#include "KernelImpl.h"
#include "cuda/GraphDriver.h"
#include "cuda/LibraryKernels.h"

#include <algorithm>

using namespace warp;

namespace {
struct Extent {
  int64_t x = 1, y = 1, z = 1;
};

struct Shape {
  Extent grid, block;
};
} // namespace

static constexpr int64_t maxGridX = INT32_MAX;
static constexpr int64_t maxGridYZ = 65535;
static constexpr int64_t maxBlockZ = 64;
static constexpr int maxBlock = 1024;

static int64_t powerAtLeast(int64_t value) {
  int64_t power = 1;
  while (power < value)
    power *= 2;
  return power;
}

static int64_t countThreads(const int32_t *dim, int rank) {
  int64_t count = 1;
  for (int i = 0; i < rank; ++i)
    count *= dim[i];
  return count;
}

static Shape shapeOf(const int32_t *dim, int rank, bool flat, int blockDim,
                     int items = 1) {
  Extent all;
  if (flat || rank == 1) {
    for (int i = 0; i < rank; ++i)
      all.x *= dim[i];
    return {{ceilDivide(all.x, blockDim)}, {blockDim}};
  }
  all.x = dim[rank - 1];
  all.y = dim[rank - 2];
  for (int i = 0; i < rank - 2; ++i)
    all.z *= dim[i];
  Extent block;
  // A few rows per block where there are rows, for the sake of neighbours;
  // fewer where a thread has neighbours of its own.
  int64_t rows =
      std::min<int64_t>({items > 1 ? 4 : 8, powerAtLeast(all.y), blockDim});
  block.x = std::min<int64_t>(std::max<int64_t>(1, blockDim / rows),
                              powerAtLeast(all.x));
  block.y = std::min<int64_t>(blockDim / block.x, powerAtLeast(all.y));
  block.z = std::min<int64_t>(
      {blockDim / (block.x * block.y), powerAtLeast(all.z), maxBlockZ});
  // Blocks are full even where the launch is small: kernels that combine
  // values over a block count on its warps.
  block.x = std::max<int64_t>(block.x, blockDim / (block.y * block.z));
  return {{ceilDivide(all.x, block.x), ceilDivide(all.y, block.y),
           ceilDivide(all.z, block.z)},
          block};
}

/// A square of indices of the last two dimensions for each block, all along one
/// axis.
static Shape tiledShape(const int32_t *dim, int rank, int64_t side,
                        int64_t blockDim) {
  int64_t count =
      ceilDivide(dim[rank - 1], side) * ceilDivide(dim[rank - 2], side);
  for (int i = 0; i < rank - 2; ++i)
    count *= dim[i];
  return {{count}, {side, blockDim / side}};
}

static int64_t countThreads(const Shape &shape) {
  const Extent &grid = shape.grid, &block = shape.block;
  return grid.x * grid.y * grid.z * block.x * block.y * block.z;
}

int warp::chooseBlock(const CudaEntry &entry, int blockDim, int64_t threads,
                      int smCount) {
  int whole = blockDim, half = whole / 2;
  if (entry.residentHalves == 0)
    return whole;
  int64_t blocks = ceilDivide(threads, whole);
  if (blocks > int64_t(entry.residentBlocks) * smCount) {
    int spared = entry.residentHalves - 2 * entry.residentBlocks;
    return spared > 0 || (spared == 0 && entry.keepsStack) ? half : whole;
  }
  // All blocks run at a time. What the busiest multiprocessor gets decides.
  int64_t busiest = ceilDivide(blocks, smCount) * whole;
  int64_t halves = ceilDivide(ceilDivide(threads, half), smCount) * half;
  return halves < busiest ? half : whole;
}

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

bool warp::fitsGrid(const int32_t *dim, int rank, int blockDim) {
  if (rank == 1)
    return true;
  if (rank > 3)
    return false;
  Shape shape = shapeOf(dim, rank, false, blockDim);
  return shape.grid.y <= maxGridYZ && shape.grid.z <= maxGridYZ;
}

/// What a thread has in memory if it searches a hierarchy; others spill less.
static constexpr int stackBytes = 512;

std::unique_ptr<CudaEntry> warp::loadOnCuda(const Kernel::Variant &variant,
                                            Code &code) {
  cuda::ContextScope scope(variant.key.device);
  cuda::RelaxedCaptures relaxed;
  auto entry = std::make_unique<CudaEntry>();
  entry->device = variant.key.device;
  entry->programmatic =
      cuda::driver()->hasProgrammaticLaunches && waitsForPredecessor(code);
  if (callsLibrary(code))
    assembleOnCuda(variant.key.device, code);
  entry->loaded.load(code);
  entry->function = entry->loaded.function(code.entry);
  if (variant.code.dynamicBytes)
    WARP_CUDA(funcSetAttribute, entry->function,
              cuda::functionMostDynamicShared, variant.code.dynamicBytes);
  int threads = variant.key.blockDim;
  if (variant.code.fixedBlock || threads % 64 != 0)
    return entry;
  WARP_CUDA(occupancyMaxActiveBlocks, &entry->residentBlocks, entry->function,
            threads, 0);
  WARP_CUDA(occupancyMaxActiveBlocks, &entry->residentHalves, entry->function,
            threads / 2, 0);
  entry->keepsStack =
      attributeOf(entry->function, cuda::functionLocalSize) >= stackBytes;
  return entry;
}

CudaEntry::~CudaEntry() {
  if (loaded)
    unloadFromCuda(device, loaded);
}

void warp::unloadFromCuda(int device, CudaCode loaded) {
  if (keepForCapture(device, [=] { unloadFromCuda(device, loaded); }))
    return;
  try {
    cuda::ContextScope scope(device);
    // The code must not go while it runs.
    cuda::driver()->ctxSynchronize();
    loaded.unload();
  } catch (const Error &) {
  }
}

/// Threads that work together on tiles are whole rows of the launch.
static void checkRows(const int32_t *dim, const VariantKey &key,
                      const std::string &name) {
  int last = dim[key.rank - 1];
  if (key.rank == 1 ? last % key.blockDim == 0 : last == key.blockDim)
    return;
  throw Error(Error::Kind::LaunchValue,
              "launch('" + name + "'): tiles belong to blocks of " +
                  std::to_string(key.blockDim) +
                  " threads, but the last extent of the launch is " +
                  std::to_string(last));
}

static cuda::Result queue(const Kernel::Variant &variant,
                          const CudaEntry &entry, const Shape &shape,
                          cuda::StreamHandle stream, void *params) {
  void *arguments[] = {params};
  const Extent &grid = shape.grid, &block = shape.block;
  cuda::LaunchConfig config{
      {unsigned(grid.x), unsigned(grid.y), unsigned(grid.z)},
      {unsigned(block.x), unsigned(block.y), unsigned(block.z)},
      unsigned(variant.code.dynamicBytes),
      stream};
  return queueKernel(entry.function, config, arguments, entry.programmatic);
}

/// Whether a launch in reverse order may run its blocks last to first: every
/// other one of those whose arrays do not fit into the cache.
static bool isReversed(int device, int64_t bytes) {
  if (bytes <= deviceInfo(device).cacheBytes)
    return false;
  std::atomic<bool> &last = cudaDeviceState(device).isReversed;
  bool now = !last.load(std::memory_order_relaxed);
  last.store(now, std::memory_order_relaxed);
  return now;
}

void warp::launchOnCuda(const Kernel::Variant &variant, const std::string &name,
                        void *params, const Stream *stream, bool openBlock,
                        int64_t bytes) {
  const VariantKey &key = variant.key;
  const CudaEntry &entry = *variant.cuda.load(std::memory_order_acquire);
  auto &given = *static_cast<LaunchHeader *>(params);
  int joined = variant.code.blockCoarsening;
  if (joined > 1)
    given.dim[key.rank - 2] /= joined;
  LaunchHeader header = given;
  Shape shape;
  if (variant.code.singleBlock) {
    shape.block.x = variant.code.singleBlock;
  } else if (variant.code.transposeTile != 0) {
    shape = tiledShape(header.dim, key.rank, variant.code.transposeTile,
                       key.blockDim);
  } else {
    // A thread takes several indices of the first dimension, or several threads
    // share one.
    const Code &code = variant.code;
    header.dim[0] = int32_t(
        ceilDivide(header.dim[0], code.coarsening / code.rowCoarsening));
    if (code.rowCoarsening > 1)
      header.dim[key.rank - 2] =
          int32_t(ceilDivide(header.dim[key.rank - 2], code.rowCoarsening));
    int blockDim = key.blockDim;
    if (openBlock)
      blockDim =
          chooseBlock(entry, blockDim, countThreads(header.dim, key.rank),
                      deviceInfo(key.device).smCount);
    if (code.cooperative && !code.ragged)
      checkRows(header.dim, key, name);
    shape = shapeOf(header.dim, key.rank, variant.flat || code.cooperative,
                    blockDim / code.splitReduction, code.coarsening);
    shape.block.y *= code.splitReduction;
  }
  if (shape.grid.x > maxGridX)
    throw Error(Error::Kind::LaunchValue,
                "launch('" + name + "'): expects at most 2^31 - 1 blocks of " +
                    std::to_string(key.blockDim) + " threads, but got " +
                    std::to_string(shape.grid.x));
  QueuedWork work(key.device, stream);
  if (variant.code.reverseOrder)
    given.reversed = isReversed(key.device, bytes);
  cuda::Result result = queue(variant, entry, shape, work.stream(), params);
  if (result == cuda::success) {
    if (variant.isQuick.load(std::memory_order_relaxed))
      variant.quick->spendLaunch(countThreads(shape) * joined);
    cudaDeviceState(key.device)
        .lastKernel.store(variant.label, std::memory_order_relaxed);
    return;
  }
  try {
    cuda::raise(result, "launchKernel");
  } catch (const Error &error) {
    throw Error(error.kind, "launch('" + name + "', device='" +
                                deviceInfo(key.device).alias +
                                "'): " + error.message);
  }
}
