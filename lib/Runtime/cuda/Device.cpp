//===- Device.cpp - CPU and CUDA devices ----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What a device is and what it has. CUDA devices are described once, when the
// first question about any of them comes; asking creates no context except
// where the answer needs one (free memory).
//
//===----------------------------------------------------------------------===//

#include "warp/Device.h"

#include "Driver.h"
#include "Device.h"
#include "GraphImpl.h"
#include "Support.h"
#include "warp/Forks.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <sys/sysinfo.h>
#include <sys/utsname.h>
#include <thread>
#include <vector>

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

static DeviceInfo describeCuda(int device) {
  cuda::DeviceHandle handle;
  WARP_CUDA(deviceGet, &handle, device);
  DeviceInfo info;
  info.alias = "cuda:" + std::to_string(device);
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
  return info;
}

static std::string processorName() {
  std::unique_ptr<FILE, int (*)(FILE *)> file(std::fopen("/proc/cpuinfo", "r"),
                                              std::fclose);
  char line[256];
  while (file.get() && std::fgets(line, sizeof(line), file.get())) {
    std::string text = line;
    size_t colon = text.find(": ");
    if (text.rfind("model name", 0) == 0 && colon != std::string::npos)
      return text.substr(colon + 2, text.find('\n') - colon - 2);
  }
  utsname system;
  return uname(&system) == 0 ? system.machine : "CPU";
}

static const DeviceInfo &describeCpu() {
  static const DeviceInfo info = [] {
    DeviceInfo cpu;
    cpu.alias = "cpu";
    cpu.name = processorName();
    cpu.smCount = static_cast<int>(std::thread::hardware_concurrency());
    return cpu;
  }();
  return info;
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
    auto *state = new DeviceState;
    state->info = describeCuda(ordinal);
    state->info.alias = "cuda:" + std::to_string(count.load());
    state->ordinal = ordinal;
    state->context = context;
    state->poolEnabled = state->info.hasMemoryPool;
    states[count] = state;
    return count++;
  }

  DeviceState *states[capacity] = {};
  std::atomic<int> count{0};
  ForkMutex mutex;
};
} // namespace

static DeviceTable &deviceTable() {
  static auto *table = new DeviceTable;
  return *table;
}

int warp::knownDeviceCount() { return deviceTable().count; }

DeviceState &warp::cudaDeviceState(int device) {
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

DeviceState *warp::findDeviceState(cuda::Context context) {
  DeviceTable &table = deviceTable();
  for (int i = 0; context && i < table.count; ++i)
    if (table.states[i]->context == context)
      return table.states[i];
  return nullptr;
}

cuda::Context cuda::contextOf(int device) {
  DeviceState &state = cudaDeviceState(device);
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

const DeviceInfo &warp::deviceInfo(int device) {
  return device == cpuDevice ? describeCpu() : cudaDeviceState(device).info;
}

static size_t availableHostMemory() {
  std::unique_ptr<FILE, int (*)(FILE *)> file(std::fopen("/proc/meminfo", "r"),
                                              std::fclose);
  char line[256];
  unsigned long long kilobytes;
  while (file.get() && std::fgets(line, sizeof(line), file.get()))
    if (std::sscanf(line, "MemAvailable: %llu kB", &kilobytes) == 1)
      return kilobytes * 1024;
  return 0;
}

std::pair<size_t, size_t> warp::deviceMemory(int device) {
  if (device == cpuDevice) {
    struct sysinfo info;
    size_t total = sysinfo(&info) == 0 ? info.totalram * info.mem_unit : 0;
    return {availableHostMemory(), total};
  }
  cudaDeviceState(device);
  cuda::ContextScope scope(device);
  size_t free = 0, total = 0;
  WARP_CUDA(memGetInfo, &free, &total);
  return {free, total};
}

void *warp::cudaContext(int device) {
  if (device == cpuDevice)
    return nullptr;
  cudaDeviceState(device);
  return cuda::contextOf(device);
}

void warp::synchronizeDevice(int device) {
  if (device == cpuDevice)
    return;
  cudaDeviceState(device);
  checkNotCapturing(device, "wait for");
  {
    cuda::ContextScope scope(device);
    WARP_CUDA(ctxSynchronize);
  }
  DeviceErrorRecord::check(device);
}

void warp::synchronizeAll() {
  // Devices that nobody used have no stream and nothing to wait for.
  auto isUsed = [](int device) {
    DeviceState &state = cudaDeviceState(device);
    std::lock_guard lock(state.mutex);
    return state.stream != nullptr;
  };
  for (int device = 0; device < knownDeviceCount(); ++device)
    if (isUsed(device))
      synchronizeDevice(device);
}
