//===- DeviceState.h - What the runtime keeps per CUDA device ---*- C++ -*-===//

#ifndef WARP_LIB_RUNTIME_DEVICESTATE_H
#define WARP_LIB_RUNTIME_DEVICESTATE_H

#include "CudaDriver.h"
#include "warp/Compile.h"
#include "warp/Device.h"
#include "warp/Launch.h"

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

namespace warp {

struct DeviceState {
  DeviceInfo info;
  std::mutex mutex;
  /// The current stream, and its handle for the launch path.
  std::shared_ptr<Stream> stream;
  std::atomic<cuda::StreamHandle> streamHandle{nullptr};
  /// The default memory pool, null if there are none; see `memoryPool`.
  std::once_flag poolOnce;
  cuda::PoolHandle pool = nullptr;
};

/// Throws for a device that does not exist or is the CPU.
DeviceState &cudaDeviceState(int device);

/// `stream`, or the device's current one.
cuda::StreamHandle streamHandle(int device, const Stream *stream);

/// Throws what a failed check of a debug-mode kernel says.
[[noreturn]] void raiseFailedCheck(const ErrorRecord &record,
                                   const std::vector<Site> &sites);

/// An error record that kernels on a CUDA device write to. Every
/// synchronisation looks at all of them.
class DeviceErrorRecord {
public:
  DeviceErrorRecord(int device, const std::vector<Site> &sites);
  ~DeviceErrorRecord();
  uint64_t address() const { return deviceAddress; }

  /// Throws the first failed check of that device, if any, and forgets it.
  static void check(int device);

private:
  const std::vector<Site> &sites;
  ErrorRecord *record = nullptr;
  uint64_t deviceAddress = 0;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_DEVICESTATE_H
