//===- ErrorRecords.cpp - Error records in pinned memory ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each variant with checks has a record in pinned memory that the device writes
// through a mapped address; the host looks at it after every synchronisation,
// when the kernels that could write it are done.
//
//===----------------------------------------------------------------------===//

#include "Device.h"

#include <algorithm>

using namespace warp;

namespace {
struct Registered {
  int device;
  ErrorRecord *record;
  const std::vector<Site> *sites;
};

struct Registry {
  ForkMutex mutex;
  std::vector<Registered> records;
};
} // namespace

static Registry &registry() {
  static auto *instance = new Registry;
  return *instance;
}

DeviceErrorRecord::DeviceErrorRecord(int device, const std::vector<Site> &sites)
    : sites(sites) {
  cuda::ContextScope scope(device);
  void *memory = nullptr;
  WARP_CUDA(memHostAlloc, &memory, sizeof(ErrorRecord),
            cuda::hostAllocPortable | cuda::hostAllocDeviceMap);
  record = new (memory) ErrorRecord;
  WARP_CUDA(memHostGetDevicePointer, &deviceAddress, memory, 0);
  std::lock_guard lock(registry().mutex);
  registry().records.push_back({device, record, &this->sites});
}

DeviceErrorRecord::~DeviceErrorRecord() {
  {
    std::lock_guard lock(registry().mutex);
    auto &records = registry().records;
    records.erase(std::remove_if(records.begin(), records.end(),
                                 [&](const Registered &entry) {
                                   return entry.record == record;
                                 }),
                  records.end());
  }
  cuda::driver()->memFreeHost(record);
}

void DeviceErrorRecord::check(int device) {
  std::lock_guard lock(registry().mutex);
  for (Registered &entry : registry().records) {
    if (entry.device != device ||
        !__atomic_load_n(&entry.record->flag, __ATOMIC_ACQUIRE))
      continue;
    ErrorRecord found = *entry.record;
    *entry.record = ErrorRecord();
    raiseFailedCheck(found, *entry.sites);
  }
}
