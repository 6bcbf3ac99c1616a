//===- Device.cpp - The CPU as a device -----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Device.h"

#include <cstdio>
#include <memory>
#include <string>
#include <sys/sysinfo.h>
#include <sys/utsname.h>
#include <thread>

using namespace warp;

/// The text behind a label in a file of /proc, to the end of the line.
static std::string findLine(const char *path, const std::string &label) {
  std::unique_ptr<FILE, int (*)(FILE *)> file(std::fopen(path, "r"),
                                              std::fclose);
  char line[256];
  while (file.get() && std::fgets(line, sizeof(line), file.get())) {
    std::string text = line;
    size_t colon = text.find(": ");
    if (text.rfind(label, 0) == 0 && colon != std::string::npos)
      return text.substr(colon + 2, text.find('\n') - colon - 2);
  }
  return "";
}

static std::string processorName() {
  std::string name = findLine("/proc/cpuinfo", "model name");
  utsname system;
  return !name.empty() ? name : uname(&system) == 0 ? system.machine : "CPU";
}

static DeviceInfo describe() {
  DeviceInfo info;
  info.alias = "cpu";
  info.name = processorName();
  info.smCount = static_cast<int>(std::thread::hardware_concurrency());
  return info;
}

CpuDevice::CpuDevice() : Device(cpuDevice, describe()) {}

Device &warp::hostDevice() {
  static auto *device = new CpuDevice;
  return *device;
}

std::pair<size_t, size_t> CpuDevice::memoryUse() {
  std::string available = findLine("/proc/meminfo", "MemAvailable");
  struct sysinfo info;
  size_t total = sysinfo(&info) == 0 ? info.totalram * info.mem_unit : 0;
  return {std::strtoull(available.c_str(), nullptr, 10) * 1024, total};
}
