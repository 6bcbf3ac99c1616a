//===- Device.h - CUDA devices: state, streams ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_DEVICE_H
#define WARP_LIB_RUNTIME_CUDA_DEVICE_H

#include "Driver.h"
#include "Runtime/Device.h"
#include "Runtime/ErrorRecords.h"

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

namespace warp {

/// State of one CUstream, however many objects name it. Never deleted:
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

class CudaDevice final : public Device, public Queues {
public:
  CudaDevice(DeviceInfo info, int index, int ordinal, cuda::Context context);

  Queues &queues() override { return *this; }
  void synchronize() override;
  void synchronizeBusyStreams() override;

  std::pair<size_t, size_t> memoryUse() override;
  std::pair<void *, MemoryKind> allocate(size_t bytes, bool pinned,
                                         const Stream *stream) override;
  void free(void *memory, size_t bytes, MemoryKind kind) override;
  MemoryKind kindOf(const void *memory) override;
  bool canReach(Device &owner, const void *memory) override;

  void copy(void *dst, Device &to, const void *src, Device &from, size_t bytes,
            const Stream *stream) override;
  void copyStrided(const CopyNest &nest, size_t bytes,
                   const Stream *stream) override;
  void fill(void *dst, const void *pattern, size_t size, size_t count,
            const Stream *stream) override;
  void fillStrided(const ArrayDescriptor &dst, const void *pattern,
                   size_t elementSize, const Stream *stream) override;
  void initialize(void *dst, const void *contents, size_t bytes,
                  const Stream *stream) override;

  std::unique_ptr<DeviceCode> load(const Kernel::Variant &variant,
                                   Code &code) override;
  std::unique_ptr<DeviceCode> loadKept(const Kernel::Variant &variant,
                                       const Code &code) override;
  std::unique_ptr<DeviceCode> loadLinked(const Kernel::Variant &variant,
                                         const Code &code) override;
  std::unique_ptr<DeviceCode> loadAssembled(const Kernel::Variant &variant,
                                            const Code &code,
                                            bool mayBeWorse) override;
  void keep(const Kernel::Variant &variant, Code code,
            const DeviceCode &loaded) override;
  void assemble(Code &code) override;
  bool canMap(const std::vector<TensorMap> &maps, const void *params) override;

  std::unique_ptr<CaptureBase> beginCapture(std::shared_ptr<Stream> stream,
                                            CaptureMode mode,
                                            bool external) override;

  void scan(NumberType kind, int width, Sequence out, Sequence in,
            int64_t count, bool inclusive, const Stream *stream) override;
  bool sort(const Pairs &pairs, int beginBit, int endBit,
            const Stream *stream) override;
  void sortSegments(const Pairs &pairs, const int32_t *begins,
                    const int32_t *ends, int64_t segments,
                    const Stream *stream) override;
  void findRuns(const Runs &runs, const Stream *stream) override;
  void multiplyRows(const SparseProduct &product,
                    const Stream *stream) override;
  void buildTree(const TreeBuild &build, bool refits,
                 const Stream *stream) override;

  void *makeStream(int priority) override;
  StreamUse *retainStream(void *stream) override;
  void releaseStream(const Stream &stream, bool destroy) override;
  bool isComplete(const Stream &stream) override;
  bool isCapturing(const Stream &stream) override;
  bool isBlocking(const Stream &stream) override;
  int priorityOf(const Stream &stream) override;
  void synchronize(const Stream &stream) override;
  void join(const Stream &stream) override;
  void *makeEvent(bool timing, bool interprocess) override;
  void *importEvent(const IpcHandle &handle) override;
  IpcHandle exportEvent(const Event &event) override;
  void destroyEvent(const Event &event) override;
  void record(const Event &event, const Stream &stream, bool external) override;
  void wait(const Stream &stream, const Event &event, bool external) override;
  bool isComplete(const Event &event) override;
  void synchronize(const Event &event) override;
  float elapsed(const Event &start, const Event &end) override;

  /// Number of the physical device.
  const int ordinal;
  std::once_flag contextOnce;
  cuda::Context context = nullptr;

  using Device::mutex;
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

  /// True if the last launch in alternating block order began at the last
  /// block.
  std::atomic<bool> isReversed{false};

  /// Name of the kernel launched last.
  std::atomic<const char *> lastKernel{nullptr};

private:
  cuda::Pointer allocateOwn(size_t bytes, bool &fromPool, const Stream *stream);
  /// Frees no longer wait for the stream itself, which is destroyed next.
  void reclaimStream(StreamUse &use, bool destroyed);
};

/// Throws for a device that does not exist or is the CPU.
CudaDevice &cudaDevice(int device);
/// True if some device may use the memory of another one directly.
bool arePeersLinked();
/// The device whose context this is; null if it is none of ours.
CudaDevice *findCudaDevice(cuda::Context context);

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

/// Events after what was queued on the streams that have had work. They stay
/// when a stream goes, and later calls record them again.
std::vector<cuda::EventHandle> eventsOfStreams(int device);

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
