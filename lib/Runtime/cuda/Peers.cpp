//===- Peers.cpp - Peer access, pools, managed and shared memory ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Two kinds of access exist side by side: that of a context to the plain
// allocations of another context, and that of a device to the memory pool of
// another one. Enabling either makes frees wait for the work of all devices,
// see Reclaim.cpp; it is not undone, since work may be in flight long after
// access was disabled.
//
//===----------------------------------------------------------------------===//

#include "warp/Peers.h"

#include "Device.h"
#include "Runtime/LaunchQueue.h"

#include <algorithm>

using namespace warp;
using cuda::Pointer;

static std::atomic<bool> peersLinked{false};

bool warp::arePeersLinked() {
  return peersLinked.load(std::memory_order_relaxed);
}

static Pointer addressOf(const void *memory) {
  return reinterpret_cast<Pointer>(memory);
}

//===----------------------------------------------------------------------===//
// Access between devices
//===----------------------------------------------------------------------===//

bool warp::canPeersLink(int device, int peer) {
  int from = cudaDevice(peer).ordinal;
  int to = cudaDevice(device).ordinal;
  if (from == to)
    return true;
  cuda::DeviceHandle fromHandle, toHandle;
  WARP_CUDA(deviceGet, &fromHandle, from);
  WARP_CUDA(deviceGet, &toHandle, to);
  int possible = 0;
  WARP_CUDA(deviceCanAccessPeer, &possible, fromHandle, toHandle);
  return possible != 0;
}

static void expectLink(int device, int peer) {
  if (!canPeersLink(device, peer))
    throw Error(Error::Kind::Runtime, "'" + deviceInfo(peer).alias +
                                          "' cannot reach the memory of '" +
                                          deviceInfo(device).alias +
                                          "', they are not connected");
}

/// The set of `peer`s that were given access, one bit each.
static std::atomic<uint64_t> &accessSet(int device) {
  static auto *sets = new std::atomic<uint64_t>[64]();
  return sets[device];
}

bool warp::isPeerAccessEnabled(int device, int peer) {
  cudaDevice(peer);
  cudaDevice(device);
  return device == peer || (accessSet(device) >> peer & 1);
}

void warp::setPeerAccessEnabled(int device, int peer, bool enable) {
  if (isPeerAccessEnabled(device, peer) == enable || device == peer)
    return;
  if (enable)
    expectLink(device, peer);
  cuda::Context context = cuda::contextOf(device);
  cuda::ContextScope scope(peer);
  if (enable) {
    peersLinked = true;
    cuda::Result result = cuda::driver()->ctxEnablePeerAccess(context, 0);
    // Another library may have been first.
    if (result != cuda::errorPeerAccessAlreadyEnabled)
      cuda::check(result, "ctxEnablePeerAccess");
    accessSet(device) |= uint64_t(1) << peer;
    return;
  }
  cuda::Result result = cuda::driver()->ctxDisablePeerAccess(context);
  if (result != cuda::errorPeerAccessNotEnabled)
    cuda::check(result, "ctxDisablePeerAccess");
  accessSet(device) &= ~(uint64_t(1) << peer);
}

static cuda::PoolHandle expectPool(int device) {
  cuda::PoolHandle pool = memoryPool(device);
  if (!pool)
    throw Error(Error::Kind::Runtime, "'" + deviceInfo(device).alias +
                                          "' does not support memory pools");
  return pool;
}

bool warp::isPoolAccessEnabled(int device, int peer) {
  CudaDevice &other = cudaDevice(peer);
  cuda::PoolHandle pool = memoryPool(device);
  if (!pool)
    return false;
  if (cudaDevice(device).ordinal == other.ordinal)
    return true;
  int flags = cuda::accessNone;
  cuda::Location location;
  location.device = other.ordinal;
  WARP_CUDA(memPoolGetAccess, &flags, pool, &location);
  return flags == cuda::accessReadWrite;
}

void warp::setPoolAccessEnabled(int device, int peer, bool enable) {
  CudaDevice &other = cudaDevice(peer);
  if (!enable && !memoryPool(device))
    return;
  cuda::PoolHandle pool = expectPool(device);
  if (cudaDevice(device).ordinal == other.ordinal)
    return;
  if (enable) {
    expectLink(device, peer);
    peersLinked = true;
  }
  cuda::AccessDescription access;
  access.location.device = other.ordinal;
  access.flags = enable ? cuda::accessReadWrite : cuda::accessNone;
  WARP_CUDA(memPoolSetAccess, pool, &access, 1);
}

MemoryKind CudaDevice::kindOf(const void *memory) {
  if (!memory)
    return MemoryKind::Unknown;
  const cuda::Driver *driver = cuda::driver();
  BehindNothing exempt;
  cuda::ContextScope scope(index);
  unsigned type = 0;
  cuda::Result result = driver->pointerGetAttribute(
      &type, cuda::pointerMemoryType, addressOf(memory));
  if (result != cuda::success)
    return MemoryKind::Unknown;
  unsigned managed = 0;
  driver->pointerGetAttribute(&managed, cuda::pointerIsManaged,
                              addressOf(memory));
  if (managed)
    return MemoryKind::Managed;
  if (type == cuda::memoryHost)
    return MemoryKind::Pinned;
  cuda::PoolHandle pool = nullptr;
  driver->pointerGetAttribute(&pool, cuda::pointerPool, addressOf(memory));
  return pool ? MemoryKind::Pool : MemoryKind::Device;
}

bool CudaDevice::canReach(Device &owner, const void *memory) {
  switch (owner.kindOf(memory)) {
  case MemoryKind::Unknown:
  case MemoryKind::Host:
    return false;
  case MemoryKind::Pinned:
    return info.isUva;
  case MemoryKind::Managed:
    return info.hasManagedMemory;
  case MemoryKind::Pool:
    return isPoolAccessEnabled(owner.index, index);
  case MemoryKind::Device:
    return isPeerAccessEnabled(owner.index, index);
  }
  return false;
}

//===----------------------------------------------------------------------===//
// Pools
//===----------------------------------------------------------------------===//

bool warp::isPoolEnabled(int device) {
  return !isHost(device) && cudaDevice(device).poolEnabled;
}

void warp::setPoolEnabled(int device, bool enable) {
  if (enable)
    expectPool(device);
  cudaDevice(device).poolEnabled = enable;
}

static uint64_t poolAttribute(int device, cuda::PoolAttribute which) {
  cuda::PoolHandle pool = expectPool(device);
  cuda::ContextScope scope(device);
  uint64_t value = 0;
  WARP_CUDA(memPoolGetAttribute, pool, which, &value);
  return value;
}

uint64_t warp::poolReleaseThreshold(int device) {
  return poolAttribute(device, cuda::poolReleaseThreshold);
}

void warp::setPoolReleaseThreshold(int device, uint64_t bytes) {
  cuda::PoolHandle pool = expectPool(device);
  WARP_CUDA(memPoolSetAttribute, pool, cuda::poolReleaseThreshold, &bytes);
}

std::pair<uint64_t, uint64_t> warp::poolUse(int device) {
  return {poolAttribute(device, cuda::poolUsedCurrent),
          poolAttribute(device, cuda::poolUsedHigh)};
}

//===----------------------------------------------------------------------===//
// Managed memory
//===----------------------------------------------------------------------===//

void *warp::allocateManaged(int device, size_t bytes) {
  if (!deviceInfo(device).hasManagedMemory)
    throw Error(Error::Kind::Runtime, "'" + deviceInfo(device).alias +
                                          "' does not support managed memory");
  cuda::ContextScope scope(device);
  Pointer memory = 0;
  WARP_CUDA(memAllocManaged, &memory, bytes, cuda::memAttachGlobal);
  return reinterpret_cast<void *>(memory);
}

void warp::freeManaged(int device, void *memory) {
  if (!cuda::isForked())
    reclaimDevice(device, addressOf(memory), false);
}

//===----------------------------------------------------------------------===//
// Other processes
//===----------------------------------------------------------------------===//

std::pair<IpcHandle, uint64_t> warp::exportMemory(int device,
                                                  const void *memory) {
  if (memoryKind(device, memory) != MemoryKind::Device)
    throw Error(Error::Kind::Runtime,
                "expects device memory that comes from no pool to share it "
                "with another process\nhint: allocate it in a block `with "
                "wp.ScopedMempool(\"" +
                    deviceInfo(device).alias + "\", False):`");
  cuda::ContextScope scope(device);
  Pointer base = 0;
  size_t size = 0;
  WARP_CUDA(memGetAddressRange, &base, &size, addressOf(memory));
  cuda::RawIpcHandle native;
  WARP_CUDA(ipcGetMemHandle, &native, base);
  IpcHandle handle;
  std::copy(native.bytes, native.bytes + handle.size(), handle.begin());
  return {handle, addressOf(memory) - base};
}

void *warp::importMemory(int device, const IpcHandle &handle) {
  cuda::ContextScope scope(device);
  cuda::RawIpcHandle native;
  std::copy(handle.begin(), handle.end(), native.bytes);
  Pointer memory = 0;
  cuda::Result result = cuda::driver()->ipcOpenMemHandle(
      &memory, native, cuda::ipcLazyPeerAccess);
  if (result == cuda::errorInvalidContext)
    throw Error(Error::Kind::Runtime,
                "the handle is of memory of this process, which CUDA opens in "
                "other processes alone\nhint: use the array that it is of");
  cuda::check(result, "ipcOpenMemHandle");
  return reinterpret_cast<void *>(memory);
}

void warp::closeImported(int device, void *memory) {
  if (cuda::isForked())
    return;
  cuda::ContextScope scope(device);
  // Work that still uses it must be done first.
  WARP_CUDA(ctxSynchronize);
  WARP_CUDA(ipcCloseMemHandle, addressOf(memory));
}
