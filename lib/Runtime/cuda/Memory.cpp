//===- Memory.cpp - CUDA memory: pools and pinned memory ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Memory comes from the device's stream-ordered pool unless that is switched
// off or missing. When the pool holds back what a request needs, it is trimmed
// and the request repeated. Pinned memory is recycled, since the driver takes
// milliseconds to make it. Reclaim.cpp says when freed memory is given back.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "GraphDriver.h"
#include "Runtime/Allocation.h"
#include "Runtime/LaunchQueue.h"

using namespace warp;
using cuda::Pointer;

/// Sizes of pinned memory are rounded up so that it fits again.
static constexpr size_t pinnedUnit = size_t(64) << 10;

static void *allocatePinned(int device, size_t bytes) {
  cuda::RelaxedCaptures relaxed;
  if (void *memory = recyclePinned(roundUp(bytes, pinnedUnit)))
    return memory;
  cuda::ContextScope scope(device);
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
    raiseOutOfMemory(hostDevice(), bytes);
  cuda::check(result, "memHostAlloc");
  return memory;
}

cuda::PoolHandle warp::memoryPool(int device) {
  CudaDevice &state = cudaDevice(device);
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

Pointer CudaDevice::allocateOwn(size_t bytes, bool &fromPool,
                                const Stream *stream) {
  const cuda::Driver *driver = cuda::driver();
  memoryPool(index);
  fromPool = pool && poolEnabled;
  Pointer memory = 0;
  cuda::Result result;
  if (fromPool && warp::isCapturing(index)) {
    cuda::ContextScope scope(index);
    result = allocateOutsideGraph(index, &memory, bytes);
  } else {
    QueuedWork work(index, stream);
    for (int attempt = 0; attempt < 2; ++attempt) {
      result = fromPool ? driver->memAllocAsync(&memory, bytes, work.stream())
                        : driver->memAlloc(&memory, bytes);
      if (result != cuda::errorOutOfMemory || !pool || warp::isCapturing(index))
        break;
      WARP_CUDA(ctxSynchronize);
      WARP_CUDA(memPoolTrimTo, pool, 0);
    }
  }
  if (result == cuda::errorOutOfMemory)
    raiseOutOfMemory(*this, bytes);
  cuda::check(result, fromPool ? "memAllocAsync" : "memAlloc");
  return memory;
}

std::pair<void *, MemoryKind> CudaDevice::allocate(size_t bytes, bool pinned,
                                                   const Stream *stream) {
  if (pinned)
    return {allocatePinned(index, bytes), MemoryKind::Pinned};
  bool fromPool = false;
  Pointer address = 0;
  try {
    // Frees that wait give nothing back yet, so new memory is used by nothing
    // that waits.
    BehindNothing exempt;
    address = allocateOwn(bytes, fromPool, stream);
  } catch (const Error &error) {
    if (error.kind != Error::Kind::Memory || !mustQueue())
      throw;
  }
  if (!address) {
    drainLaunches();
    address = allocateOwn(bytes, fromPool, stream);
  }
  auto *memory = reinterpret_cast<void *>(address);
  return {memory, fromPool ? MemoryKind::Pool : MemoryKind::Device};
}

void CudaDevice::free(void *memory, size_t bytes, MemoryKind kind) {
  if (cuda::isForked())
    return;
  // After a fault or at exit the driver refuses everything, and the next call
  // of the user reports it.
  try {
    if (kind == MemoryKind::Pinned)
      reclaimPinned(memory, roundUp(bytes, pinnedUnit));
    else
      reclaimDevice(index, reinterpret_cast<Pointer>(memory),
                    kind == MemoryKind::Pool);
  } catch (const Error &) {
  }
}
