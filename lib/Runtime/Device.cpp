//===- Device.cpp - CPU and CUDA devices ----------------------------------===//
//
// What a device is and what it has. CUDA devices are described once, when the
// first question about any of them comes; asking creates no context except
// where the answer needs one (free memory).
//
//===----------------------------------------------------------------------===//

#include "warp/Device.h"

#include "CudaDriver.h"
#include "DeviceState.h"
#include "Support.h"

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
  info.maxSharedMemoryPerBlock =
      attribute(handle, cuda::maxSharedMemoryPerBlockOptin);
  info.isUva = attribute(handle, cuda::unifiedAddressing);
  info.hasMemoryPool = attribute(handle, cuda::memoryPoolsSupported);
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

DeviceState &warp::cudaDeviceState(int device) {
  static auto *states = [] {
    auto *created = new std::vector<DeviceState>(cudaDeviceCount());
    for (size_t i = 0; i < created->size(); ++i)
      (*created)[i].info = describeCuda(static_cast<int>(i));
    return created;
  }();
  if (device >= 0 && device < static_cast<int>(states->size()))
    return (*states)[device];
  std::string message = "no device 'cuda:" + std::to_string(device) + "', ";
  if (states->empty())
    message += cudaUnavailableReason();
  else
    message += "there are " + std::to_string(states->size()) + " CUDA devices";
  throw Error(Error::Kind::Runtime, message);
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
  return cuda::primaryContext(device);
}

void warp::synchronizeDevice(int device) {
  if (device == cpuDevice)
    return;
  cudaDeviceState(device);
  {
    cuda::ContextScope scope(device);
    WARP_CUDA(ctxSynchronize);
  }
  DeviceErrorRecord::check(device);
}

void warp::synchronizeAll() {
  // Devices that nobody used have no stream and nothing to wait for.
  for (int device = 0; device < cudaDeviceCount(); ++device)
    if (cudaDeviceState(device).streamHandle.load())
      synchronizeDevice(device);
}
