//===- Device.cpp - CUDA devices and contexts -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Devices are described once, when the first question about any of them comes;
// asking creates no context except where the answer needs one (free memory).
//
//===----------------------------------------------------------------------===//

#include "Device.h"

#include "GraphImpl.h"
#include "Runtime/LaunchQueue.h"

#include <algorithm>
#include <string>

using namespace warp;

int warp::cudaDeviceCount() {
  const cuda::Driver *driver = cuda::driver();
  return driver ? driver->deviceCount : 0;
}

const std::string &warp::cudaUnavailableReason() {
  return cuda::driverProblem();
}

int warp::cudaDriverVersion() {
  const cuda::Driver *driver = cuda::driver();
  return driver ? driver->version : 0;
}

static int attribute(cuda::DeviceHandle handle, cuda::DeviceAttribute which) {
  int value = 0;
  WARP_CUDA(deviceGetAttribute, &value, which, handle);
  return value;
}

static DeviceInfo describe(int device) {
  cuda::DeviceHandle handle;
  WARP_CUDA(deviceGet, &handle, device);
  DeviceInfo info;
  char text[256] = {};
  WARP_CUDA(deviceGetName, text, sizeof(text) - 1, handle);
  info.name = text;
  WARP_CUDA(deviceGetPciBusId, text, sizeof(text) - 1, handle);
  info.pciBusId = text;
  cuda::Uuid uuid;
  WARP_CUDA(deviceGetUuid, &uuid, handle);
  std::copy(uuid.bytes, uuid.bytes + 16, info.uuid.begin());
  info.arch = 10 * attribute(handle, cuda::computeCapabilityMajor) +
              attribute(handle, cuda::computeCapabilityMinor);
  info.smCount = attribute(handle, cuda::multiprocessorCount);
  info.cacheBytes = attribute(handle, cuda::l2CacheSize);
  info.maxSharedMemoryPerBlock =
      attribute(handle, cuda::maxSharedMemoryPerBlockOptin);
  info.isUva = attribute(handle, cuda::unifiedAddressing);
  info.hasMemoryPool = attribute(handle, cuda::memoryPoolsSupported);
  info.hasManagedMemory = attribute(handle, cuda::managedMemory);
  info.hasConcurrentManagedAccess =
      attribute(handle, cuda::concurrentManagedAccess);
  info.hasDirectManagedAccessFromHost =
      attribute(handle, cuda::directManagedAccessFromHost);
  info.hasPageableMemoryAccess = attribute(handle, cuda::pageableMemoryAccess);
  info.hasHostNativeAtomics = attribute(handle, cuda::hostNativeAtomics);
  return info;
}

CudaDevice::CudaDevice(DeviceInfo info, int index, int ordinal,
                       cuda::Context context)
    : Device(index, std::move(info)), ordinal(ordinal), context(context) {
  this->info.alias = "cuda:" + std::to_string(index);
  poolEnabled = this->info.hasMemoryPool;
}

namespace {
/// Physical devices in their order, then contexts that users mapped.
struct DeviceTable {
  static constexpr int capacity = 64;

  DeviceTable() {
    for (int i = 0; i < std::min(cudaDeviceCount(), capacity); ++i)
      add(i, nullptr);
  }
  int add(int ordinal, cuda::Context context) {
    states[count] = new CudaDevice(describe(ordinal), count, ordinal, context);
    return count++;
  }

  CudaDevice *states[capacity] = {};
  std::atomic<int> count{0};
  ForkMutex mutex;
};
} // namespace

static DeviceTable &deviceTable() {
  static auto *table = new DeviceTable;
  return *table;
}

int warp::acceleratorCount() { return deviceTable().count; }

Device &warp::acceleratorAt(int device) { return cudaDevice(device); }

CudaDevice &warp::cudaDevice(int device) {
  DeviceTable &table = deviceTable();
  if (device >= 0 && device < table.count.load(std::memory_order_acquire))
    return *table.states[device];
  std::string message = "no device 'cuda:" + std::to_string(device) + "', ";
  if (table.count == 0)
    message += cudaUnavailableReason();
  else
    message += "there are " + std::to_string(table.count) + " CUDA devices";
  throw Error(Error::Kind::Runtime, message);
}

CudaDevice *warp::findCudaDevice(cuda::Context context) {
  DeviceTable &table = deviceTable();
  for (int i = 0; context && i < table.count; ++i)
    if (table.states[i]->context == context)
      return table.states[i];
  return nullptr;
}

cuda::Context cuda::contextOf(int device) {
  CudaDevice &state = cudaDevice(device);
  std::call_once(state.contextOnce, [&] {
    if (state.context)
      return;
    DeviceHandle handle;
    WARP_CUDA(deviceGet, &handle, state.ordinal);
    WARP_CUDA(primaryCtxRetain, &state.context, handle);
  });
  return state.context;
}

void *warp::currentCudaContext() {
  cuda::Context context = nullptr;
  if (cudaDeviceCount() > 0)
    WARP_CUDA(ctxGetCurrent, &context);
  return context;
}

void *warp::setCurrentCudaContext(void *context) {
  void *previous = currentCudaContext();
  WARP_CUDA(ctxSetCurrent, static_cast<cuda::Context>(context));
  return previous;
}

int warp::mapContext(void *pointer) {
  auto context = static_cast<cuda::Context>(pointer);
  DeviceTable &table = deviceTable();
  std::lock_guard lock(table.mutex);
  cuda::Context previous = nullptr;
  cuda::DeviceHandle ordinal;
  WARP_CUDA(ctxGetCurrent, &previous);
  WARP_CUDA(ctxSetCurrent, context);
  cuda::Result result = cuda::driver()->ctxGetDevice(&ordinal);
  WARP_CUDA(ctxSetCurrent, previous);
  cuda::check(result, "ctxGetDevice");
  cuda::contextOf(ordinal);
  for (int i = 0; i < table.count; ++i)
    if (table.states[i]->context == context)
      return i;
  if (table.count == DeviceTable::capacity)
    throw Error(Error::Kind::Runtime, "expects at most 64 mapped contexts");
  return table.add(ordinal, context);
}

std::pair<size_t, size_t> CudaDevice::memoryUse() {
  cuda::ContextScope scope(index);
  size_t free = 0, total = 0;
  WARP_CUDA(memGetInfo, &free, &total);
  return {free, total};
}

void *warp::cudaContext(int device) {
  return isHost(device) ? nullptr : cuda::contextOf(device);
}

void CudaDevice::synchronize() {
  finishLaunches();
  checkNotCapturing(index, "wait for");
  {
    cuda::ContextScope scope(index);
    WARP_CUDA(ctxSynchronize);
  }
  DeviceErrorRecord::check(index);
}
