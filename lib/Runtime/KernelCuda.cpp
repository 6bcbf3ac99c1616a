//===- KernelCuda.cpp - Kernels on CUDA devices ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Loads the code of a variant and queues its launches, each by the grid that its
// schedule asks for (Grid.cpp).
//
//===----------------------------------------------------------------------===//

#include "GraphImpl.h"
#include "Grid.h"
#include "KernelImpl.h"
#include "cuda/GraphDriver.h"
#include "cuda/LibraryKernels.h"

#include <algorithm>

using namespace warp;

static constexpr int maxBlock = 1024;

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
  // All blocks run at a time. The share of the busiest multiprocessor decides.
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

bool warp::fitsGrid(const LaunchDim &dim, int blockDim) {
  return dim.rank == 1 ||
         (dim.rank <= 3 && gridFor({}, dim, blockDim, /*flat=*/false).fits({}));
}

/// Bytes of stack of a thread that searches a hierarchy; others spill less.
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
  if (variant.code.schedule.dynamicBytes)
    WARP_CUDA(funcSetAttribute, entry->function,
              cuda::functionMostDynamicShared, variant.code.schedule.dynamicBytes);
  int threads = variant.key.blockDim;
  if (variant.code.schedule.fixedBlock || threads % 64 != 0)
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
                          const CudaEntry &entry, const Grid &grid,
                          cuda::StreamHandle stream, void *params) {
  void *arguments[] = {params};
  const Extent &blocks = grid.blocks, &block = grid.block;
  cuda::LaunchConfig config{
      {unsigned(blocks.x), unsigned(blocks.y), unsigned(blocks.z)},
      {unsigned(block.x), unsigned(block.y), unsigned(block.z)},
      unsigned(variant.code.schedule.dynamicBytes),
      stream};
  return queueKernel(entry.function, config, arguments, entry.programmatic);
}

/// True for every other launch whose arrays do not fit into the cache: it finds
/// there what the launch before touched last.
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
  const Schedule &schedule = variant.code.schedule;
  const CudaEntry &entry = *variant.cuda.load(std::memory_order_acquire);
  auto &header = *static_cast<LaunchHeader *>(params);
  if (schedule.cooperative && !schedule.ragged)
    checkRows(header.dim, key, name);
  LaunchDim dim;
  dim.rank = key.rank;
  std::copy(header.dim, header.dim + key.rank, dim.extent);
  int blockDim = key.blockDim;
  if (openBlock)
    blockDim = chooseBlock(entry, blockDim, coarsenedThreads(schedule, dim),
                           deviceInfo(key.device).smCount);
  Grid grid = gridFor(schedule, dim, blockDim, variant.flat);
  if (!grid.fits({}))
    grid = gridFor(schedule, dim, key.blockDim, variant.flat);
  if (!grid.fits({}))
    throw Error(Error::Kind::LaunchValue,
                "launch('" + name + "'): expects at most 2^31 - 1 blocks of " +
                    std::to_string(key.blockDim) + " threads, but got " +
                    std::to_string(grid.blocks.x));
  // Code of merged blocks knows no others.
  if (schedule.blockCoarsening > 1)
    header.dim[key.rank - 2] /= schedule.blockCoarsening;
  QueuedWork work(key.device, stream);
  if (schedule.reverseOrder)
    header.reversed = isReversed(key.device, bytes);
  cuda::Result result = queue(variant, entry, grid, work.stream(), params);
  if (result == cuda::success) {
    if (variant.isQuick.load(std::memory_order_relaxed))
      variant.quick->spendLaunch(grid.threads() * schedule.blockCoarsening);
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
