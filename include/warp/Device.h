//===- Device.h - Devices, streams and events -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Devices are numbered: -1 is the CPU, 0.. are the CUDA devices. The driver is
// loaded with `dlopen` the first time somebody asks; where there is none,
// `cudaDeviceCount` is 0 and `cudaUnavailableReason` says why. A device's
// primary context is retained at its first use, so that memory and streams
// are shared with every other library of the process.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICE_H
#define WARP_DEVICE_H

#include "warp/Export.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace warp {

struct StreamUse;

inline constexpr int cpuDevice = -1;
/// True if memory of a device is memory of the host, and work is done on
/// return.
constexpr bool isHost(int device) { return device == cpuDevice; }

/// Memory by who gave it; the peer package uses the same numbers.
enum class MemoryKind : int {
  Unknown = 0,
  Host = 1,
  Pinned = 2,
  Device = 3,
  Pool = 4,
  Managed = 5,
};

struct DeviceInfo {
  /// "cpu" or "cuda:0".
  std::string alias;
  std::string name;
  /// Compute capability as 10 * major + minor; 0 for the CPU.
  int arch = 0;
  int smCount = 0;
  /// The size of a GPU's second-level cache.
  int64_t cacheBytes = 0;
  int maxSharedMemoryPerBlock = 0;
  bool isUva = false;
  bool hasMemoryPool = false;
  bool hasManagedMemory = false;
  /// Managed memory: the host may use it while kernels run, and without moving
  /// it off the GPU.
  bool hasConcurrentManagedAccess = false;
  bool hasDirectManagedAccessFromHost = false;
  /// Memory of the host that is not pinned: kernels may use it; atomics of both
  /// sides on it are native ones.
  bool hasPageableMemoryAccess = false;
  bool hasHostNativeAtomics = false;
  std::array<uint8_t, 16> uuid = {};
  std::string pciBusId;
};

/// Number of CUDA devices; 0 when there is no driver.
WARP_API int cudaDeviceCount();
/// Empty if there are CUDA devices.
WARP_API const std::string &cudaUnavailableReason();
/// Version of the driver as 1000 * major + 10 * minor; 0 without one.
WARP_API int cudaDriverVersion();

/// Throws for a device that does not exist.
WARP_API const DeviceInfo &deviceInfo(int device);
/// Bytes of memory: free, total.
WARP_API std::pair<size_t, size_t> deviceMemory(int device);
/// The device's primary context, for other libraries; null for the CPU.
WARP_API void *cudaContext(int device);
/// The context that is current on this thread, null if none is.
WARP_API void *currentCudaContext();
/// Makes a context current on this thread; returns the former one.
WARP_API void *setCurrentCudaContext(void *context);
/// The number of the device with this context; a context that is new gets the
/// next number.
WARP_API int mapContext(void *context);

/// A stream of a device that queues work (a CUstream), owned or borrowed.
class WARP_API Stream {
public:
  /// Creates a stream.
  explicit Stream(int device, int priority = 0);
  /// Borrows an existing one.
  Stream(int device, void *handle);
  ~Stream();
  Stream(const Stream &) = delete;
  Stream &operator=(const Stream &) = delete;

  int device() const { return deviceIndex; }
  void *handle() const { return stream; }
  bool isComplete() const;
  /// True if what is queued goes into a graph.
  bool isCapturing() const;
  /// True if it keeps its order with work on the legacy default stream.
  bool isBlocking() const;
  /// Negative numbers come first.
  int priority() const;
  void synchronize() const;
  /// The device's record of the stream.
  StreamUse *use() const { return known; }

private:
  int deviceIndex;
  void *stream = nullptr;
  StreamUse *known = nullptr;
  bool owned = false;
};

/// The bytes with which another process opens an event or an allocation.
using IpcHandle = std::array<char, 64>;

class WARP_API Event {
public:
  explicit Event(int device, bool enableTiming = false,
                 bool interprocess = false);
  /// Opens an event of another process.
  Event(int device, const IpcHandle &handle);
  ~Event();
  Event(const Event &) = delete;
  Event &operator=(const Event &) = delete;

  int device() const { return deviceIndex; }
  void *handle() const { return event; }
  IpcHandle ipcHandle() const;
  /// `external`: where the stream is captured, the graph's launches record it,
  /// for whoever is not part of the graph; events that measure time always are.
  void record(const Stream &stream, bool external = false);
  bool isComplete() const;
  void synchronize() const;

private:
  int deviceIndex;
  void *event = nullptr;
  bool timing = false;
};

/// Lets what is queued on a stream from now on wait for all work queued on the
/// device so far.
WARP_API void joinStreams(const Stream &stream);
/// `external`: where the stream is captured, the graph's launches wait for it.
WARP_API void waitEvent(const Stream &stream, const Event &event,
                        bool external = false);
/// Milliseconds between two recorded events.
WARP_API float elapsedMilliseconds(const Event &start, const Event &end);

/// The stream that launches and copies use when none is named.
WARP_API std::shared_ptr<Stream> currentStream(int device);
WARP_API void setCurrentStream(int device, std::shared_ptr<Stream> stream);

/// Wait for all work, then throw what debug-mode kernels reported.
WARP_API void synchronizeDevice(int device);
WARP_API void synchronizeAll();
/// Waits for the streams that have work, without looking at reports.
WARP_API void synchronizeBusyStreams();

} // namespace warp

#endif // WARP_DEVICE_H
