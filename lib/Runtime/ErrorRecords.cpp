//===- ErrorRecords.cpp - What checks in kernels report -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A failed check leaves one record. Code of debug mode has checks, and code of
// the few operations that no mode goes on with. On the CPU the record lives on
// the stack of the launch. On CUDA each such variant has one in pinned memory
// that the device writes through a mapped address; the host looks at it after
// every synchronisation, when the kernels that could write it are done.
//
//===----------------------------------------------------------------------===//

#include "cuda/Driver.h"
#include "cuda/Device.h"
#include "warp/Forks.h"

#include <algorithm>
#include <string>

using namespace warp;

static std::string list(const std::string &name, int count,
                        const std::string *values) {
  std::string text = name + " (";
  for (int i = 0; i < count; ++i)
    text += (i ? ", " : "") + values[i];
  return text + (count == 1 ? ",)" : ")");
}

static std::string describeAccess(const ErrorRecord &record, const Site &site) {
  int rank = std::min<int>(record.rank, maxRank);
  std::string index[maxRank], shape[maxRank];
  for (int i = 0; i < rank; ++i) {
    // What is still negative was counted from the end; say what was written.
    int64_t written = record.index[i];
    if (written < 0 && record.kind != CheckKind::Offset)
      written -= record.shape[i];
    index[i] = std::to_string(written);
    shape[i] = std::to_string(record.shape[i]);
  }
  std::string what = record.kind == CheckKind::OutOfBounds
                         ? "array '" + site.array + "'"
                         : site.array;
  return list("index", rank, index) + " is out of bounds for " + what + " of " +
         list("shape", rank, shape);
}

void warp::raiseFailedCheck(const ErrorRecord &record,
                            const std::vector<Site> &sites) {
  Site site;
  if (record.site >= 0 && record.site < static_cast<int>(sites.size()))
    site = sites[record.site];
  std::string message = "kernel '" + site.kernel + "': ";
  if (record.kind == CheckKind::Assertion)
    message += "assertion failed: " + site.array;
  else if (record.kind == CheckKind::Failure)
    message += site.array;
  else
    message += describeAccess(record, site);
  throw Error(Error::Kind::Launch, message, site.file, site.line, site.column);
}

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
