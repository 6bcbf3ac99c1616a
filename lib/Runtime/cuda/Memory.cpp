//===- Memory.cpp - Memory with an owner ----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Host memory is aligned to a cache line; large blocks to huge pages, which
// saves most page faults. CUDA memory comes from the device's stream-ordered
// pool unless that is switched off or missing. When the pool holds back what a
// request needs, it is trimmed and the request repeated. Pinned memory is
// recycled, since the driver takes milliseconds to make it. Reclaim.cpp says
// when freed memory is given back.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "GraphImpl.h"
#include "Support.h"
#include "warp/Memory.h"
#include "warp/MemoryTracker.h"

#include <cstdlib>
#include <sys/mman.h>
#include <sys/sysinfo.h>

using namespace warp;
using cuda::Pointer;

static constexpr size_t cacheLine = 64;
static constexpr size_t hugePage = size_t(2) << 20;
/// Sizes of pinned memory are rounded up so that it fits again.
static constexpr size_t pinnedUnit = size_t(64) << 10;

static size_t roundUp(size_t bytes, size_t unit) {
  return (bytes + unit - 1) / unit * unit;
}

[[noreturn]] static void raiseOutOfMemory(int device, size_t bytes) {
  size_t free = deviceMemory(device).first;
  std::string text = "out of memory on '" + deviceInfo(device).alias +
                     "', requested " + formatBytes(bytes) + ", free " +
                     formatBytes(free);
  std::string users = MemoryTracker::get().largestUsers(device);
  text += users.empty() ? "\nhint: `wp.config.track_memory = True` lets this "
                          "message name the largest users"
                        : "; largest users: " + users;
  throw Error(Error::Kind::Memory, text);
}

static void *allocateHost(size_t bytes) {
  // The kernel would promise more than there is and kill us later.
  struct sysinfo info;
  if (sysinfo(&info) == 0 &&
      bytes / info.mem_unit > info.totalram + info.totalswap)
    raiseOutOfMemory(cpuDevice, bytes);
  bool large = bytes >= 2 * hugePage;
  size_t align = large ? hugePage : cacheLine;
  void *memory = std::aligned_alloc(align, roundUp(bytes, align));
  if (!memory)
    raiseOutOfMemory(cpuDevice, bytes);
  if (large)
    madvise(memory, bytes, MADV_HUGEPAGE);
  return memory;
}

static void *allocatePinned(size_t bytes) {
  cuda::RelaxedCaptures relaxed;
  if (void *memory = recyclePinned(roundUp(bytes, pinnedUnit)))
    return memory;
  cuda::ContextScope scope(0);
  void *memory = nullptr;
  cuda::Result result;
  for (int attempt = 0; attempt < 2; ++attempt) {
    result = cuda::driver()->memHostAlloc(&memory, roundUp(bytes, pinnedUnit),
                                          cuda::hostAllocPortable |
                                              cuda::hostAllocDeviceMap);
    if (result != cuda::errorOutOfMemory)
      break;
    trimPinned();
  }
  if (result == cuda::errorOutOfMemory)
    raiseOutOfMemory(cpuDevice, bytes);
  cuda::check(result, "memHostAlloc");
  return memory;
}

cuda::PoolHandle warp::memoryPool(int device) {
  DeviceState &state = cudaDeviceState(device);
  if (!state.info.hasMemoryPool)
    return nullptr;
  std::call_once(state.poolOnce, [&] {
    cuda::RelaxedCaptures relaxed;
    cuda::DeviceHandle handle;
    WARP_CUDA(deviceGet, &handle, state.ordinal);
    WARP_CUDA(deviceGetDefaultMemPool, &state.pool, handle);
    uint64_t threshold = UINT64_MAX;
    WARP_CUDA(memPoolSetAttribute, state.pool, cuda::poolReleaseThreshold,
              &threshold);
  });
  return state.pool;
}

/// During a capture memory must not become part of the graph: arrays may
/// outlive it. A stream outside allocates, and is waited for.
static cuda::Result allocateOutsideGraph(int device, Pointer *memory,
                                         size_t bytes) {
  cuda::RelaxedCaptures relaxed;
  Stream outside(device);
  auto handle = static_cast<cuda::StreamHandle>(outside.handle());
  cuda::Result result = cuda::driver()->memAllocAsync(memory, bytes, handle);
  if (result == cuda::success)
    result = cuda::driver()->streamSynchronize(handle);
  return result;
}

static Pointer allocateCuda(int device, size_t bytes, bool &fromPool,
                            const Stream *stream) {
  const cuda::Driver *driver = cuda::driver();
  cuda::PoolHandle pool = memoryPool(device);
  fromPool = pool && cudaDeviceState(device).poolEnabled;
  Pointer memory = 0;
  cuda::Result result;
  if (fromPool && isCapturing(device)) {
    cuda::ContextScope scope(device);
    result = allocateOutsideGraph(device, &memory, bytes);
  } else {
    QueuedWork work(device, stream);
    for (int attempt = 0; attempt < 2; ++attempt) {
      result = fromPool ? driver->memAllocAsync(&memory, bytes, work.stream())
                        : driver->memAlloc(&memory, bytes);
      if (result != cuda::errorOutOfMemory || !pool || isCapturing(device))
        break;
      WARP_CUDA(ctxSynchronize);
      WARP_CUDA(memPoolTrimTo, pool, 0);
    }
  }
  if (result == cuda::errorOutOfMemory)
    raiseOutOfMemory(device, bytes);
  cuda::check(result, fromPool ? "memAllocAsync" : "memAlloc");
  return memory;
}

Buffer::Buffer(int device, size_t size, bool pinned, const Stream *stream)
    : bytes(size), deviceIndex(device) {
  if (device != cpuDevice)
    cudaDeviceState(device);
  if (pinned && device == cpuDevice && cudaDeviceCount() > 0)
    how = How::Pinned;
  if (size == 0)
    return;
  if (device != cpuDevice) {
    bool fromPool;
    memory =
        reinterpret_cast<void *>(allocateCuda(device, size, fromPool, stream));
    how = fromPool ? How::CudaPool : How::Cuda;
  } else {
    memory = pinned && how == How::Pinned ? allocatePinned(size)
                                          : allocateHost(size);
  }
}

void Buffer::track(const std::string &site) {
  if (!memory)
    return;
  tracked = true;
  MemoryTracker::get().add(memory, bytes, deviceIndex, pinned(), site);
}

Buffer::~Buffer() {
  if (!memory)
    return;
  if (tracked)
    MemoryTracker::get().remove(memory);
  auto release = [memory = memory, bytes = bytes, device = deviceIndex,
                  how = how] {
    if (how == How::Host) {
      std::free(memory);
      return;
    }
    if (cuda::isForked())
      return;
    // A destructor has nobody to tell: after a fault or at exit the driver
    // refuses everything, and the next call of the user reports it.
    try {
      if (how == How::Pinned)
        reclaimPinned(memory, roundUp(bytes, pinnedUnit));
      else
        reclaimDevice(device, reinterpret_cast<Pointer>(memory),
                      how == How::CudaPool);
    } catch (const Error &) {
    }
  };
  if (!keepForCapture(deviceIndex, release))
    release();
}
