//===- Device.h - What the runtime keeps per CUDA device --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_DEVICE_H
#define WARP_LIB_RUNTIME_CUDA_DEVICE_H

#include "Driver.h"
#include "warp/Compile.h"
#include "warp/Device.h"
#include "warp/Forks.h"
#include "warp/Launch.h"
#include "warp/Memory.h"

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

namespace warp {

/// What is known of one CUstream, however many objects name it. Never deleted:
/// a handle that comes back finds its old entry.
struct StreamUse {
  cuda::StreamHandle handle = nullptr;
  /// Work was queued that no free has waited for; see Reclaim.cpp.
  std::atomic<bool> busy{false};
  /// Work was queued since the stream became known.
  std::atomic<bool> used{false};
  /// The rest is guarded by the mutex of the device.
  int references = 0;
  /// The stream was destroyed while objects that borrow it are left.
  bool gone = false;
  cuda::EventHandle event = nullptr;

  bool exists() const { return references > 0 && !gone; }

  void markBusy() {
    if (!busy.load(std::memory_order_relaxed)) {
      used.store(true, std::memory_order_relaxed);
      busy.store(true, std::memory_order_release);
    }
  }
};

struct DeviceState {
  DeviceInfo info;
  int ordinal = 0;
  std::once_flag contextOnce;
  cuda::Context context = nullptr;

  ForkMutex mutex;
  /// The current stream.
  std::shared_ptr<Stream> stream;
  std::vector<StreamUse *> uses;

  /// The stream that frees wait on; see Reclaim.cpp.
  cuda::StreamHandle reclaim = nullptr;
  bool reclaimPending = false;
  /// Freed while a graph was captured, and whether they came from the pool.
  std::vector<std::pair<cuda::Pointer, bool>> deferred;

  /// The default memory pool, null if there are none; see `memoryPool`.
  std::once_flag poolOnce;
  cuda::PoolHandle pool = nullptr;
  std::atomic<bool> poolEnabled{false};

  /// Whether the last launch that alternates began at the last block.
  std::atomic<bool> isReversed{false};

  /// Name of the kernel launched last.
  std::atomic<const char *> lastKernel{nullptr};
};

/// Throws for a device that does not exist or is the CPU.
DeviceState &cudaDeviceState(int device);
/// Physical devices and mapped contexts.
int knownDeviceCount();
/// Whether some device may use the memory of another one directly.
bool arePeersLinked();
/// The device whose context this is; null if it is none of ours.
DeviceState *findDeviceState(cuda::Context context);

/// Work about to be queued on a stream, or on the device's current one, which
/// other threads may exchange and let go of meanwhile. Makes the context
/// current and, at the end, marks the stream as busy.
class QueuedWork {
public:
  QueuedWork(int device, const Stream *stream);
  ~QueuedWork() { use->markBusy(); }
  QueuedWork(const QueuedWork &) = delete;
  QueuedWork &operator=(const QueuedWork &) = delete;

  cuda::StreamHandle stream() const { return use->handle; }

private:
  /// The current stream, if the work is on that.
  std::shared_ptr<Stream> current;
  StreamUse *use;
  cuda::ContextScope scope;
};

/// The pool of a device, set up to keep freed memory for the next request.
cuda::PoolHandle memoryPool(int device);

/// Frees device memory once all work queued so far is done. `pooled`: it came
/// from the memory pool.
void reclaimDevice(int device, cuda::Pointer memory, bool pooled);
/// The same for pinned host memory, which any device may be using.
void reclaimPinned(void *memory, size_t bytes);
/// Pinned memory that was freed and is no longer used, or null.
void *recyclePinned(size_t bytes);
/// Gives the pinned memory that is kept for reuse back to the system.
void trimPinned();

/// Notes that an object for a stream was made, and that it goes away.
StreamUse *retainStream(int device, cuda::StreamHandle handle);
/// `destroyed`: the caller destroys the stream next.
void releaseStream(int device, StreamUse *use, bool destroyed);
/// Events after what was queued on the streams that have had work. They stay
/// when a stream goes, and later calls record them again.
std::vector<cuda::EventHandle> eventsOfStreams(int device);

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

#endif // WARP_LIB_RUNTIME_CUDA_DEVICE_H
