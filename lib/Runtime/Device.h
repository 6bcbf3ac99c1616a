//===- Device.h - Device interface ------------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Work that depends on the kind of device is a method of this class; the rest
// of the runtime is the same for all. cpu/ and cuda/ implement it, in files of
// equal names. docs/devices.md says how to add another kind.
//
// Callers check arguments and note the operation in the trace of a capture. A
// method queues the work on a stream (null: the current one), or does it before
// it returns on a device whose memory is the host's; there it hands the work
// to the recorder of a capture instead (`recordOnHost`). Extents are not zero.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_DEVICE_H
#define WARP_LIB_RUNTIME_DEVICE_H

#include "CopyNest.h"
#include "warp/Device.h"
#include "warp/Forks.h"
#include "warp/Graph.h"
#include "warp/Kernel.h"
#include "warp/Memory.h"
#include "warp/Sequences.h"

#include <memory>
#include <utility>
#include <vector>

namespace warp {

class CaptureBase;
class DeviceCode;
struct SparseProduct;
struct TreeBuild;

/// Streams and events, for devices that queue work.
class Queues {
public:
  virtual void *makeStream(int priority) = 0;
  /// Gives what the device keeps about a stream, for an object that names it.
  virtual StreamUse *retainStream(void *stream) = 0;
  /// The object goes away, and with `destroy` the stream. Never throws.
  virtual void releaseStream(const Stream &stream, bool destroy) = 0;
  virtual bool isComplete(const Stream &stream) = 0;
  virtual bool isCapturing(const Stream &stream) = 0;
  virtual bool isBlocking(const Stream &stream) = 0;
  virtual int priorityOf(const Stream &stream) = 0;
  virtual void synchronize(const Stream &stream) = 0;
  /// Lets a stream wait for all work queued so far.
  virtual void join(const Stream &stream) = 0;

  virtual void *makeEvent(bool timing, bool interprocess) = 0;
  virtual void *importEvent(const IpcHandle &handle) = 0;
  virtual IpcHandle exportEvent(const Event &event) = 0;
  virtual void destroyEvent(const Event &event) = 0;
  virtual void record(const Event &event, const Stream &stream,
                      bool external) = 0;
  virtual void wait(const Stream &stream, const Event &event,
                    bool external) = 0;
  virtual bool isComplete(const Event &event) = 0;
  virtual void synchronize(const Event &event) = 0;
  virtual float elapsed(const Event &start, const Event &end) = 0;

protected:
  ~Queues() = default;
};

class Device {
public:
  Device(int index, DeviceInfo info) : index(index), info(std::move(info)) {}
  Device(const Device &) = delete;
  Device &operator=(const Device &) = delete;

  const int index;
  DeviceInfo info;

  /// True if its memory is the host's and work is done on return.
  bool isHost() const { return warp::isHost(index); }
  /// Throws where work is not queued.
  virtual Queues &queues();
  /// Waits for all work, then throws what kernels reported.
  virtual void synchronize() = 0;
  /// Waits for streams that have work, without looking at reports.
  virtual void synchronizeBusyStreams() = 0;

  /// Bytes of memory: free, total.
  virtual std::pair<size_t, size_t> memoryUse() = 0;
  /// `pinned`: page-locked memory of the host. Gives what kind of memory it is,
  /// which `free` wants to know.
  virtual std::pair<void *, MemoryKind> allocate(size_t bytes, bool pinned,
                                                 const Stream *stream) = 0;
  /// Frees memory once all work queued so far is done. Never throws.
  virtual void free(void *memory, size_t bytes, MemoryKind kind) = 0;
  virtual MemoryKind kindOf(const void *memory) = 0;
  /// True if kernels can use memory of another device.
  virtual bool canReach(Device &owner, const void *memory) = 0;

  /// One side is this device; the other one may be the host or a peer.
  virtual void copy(void *dst, Device &to, const void *src, Device &from,
                    size_t bytes, const Stream *stream) = 0;
  /// Within the device. `bytes`: of all runs.
  virtual void copyStrided(const CopyNest &nest, size_t bytes,
                           const Stream *stream) = 0;
  /// Writes `count` copies of a pattern of `size` bytes.
  virtual void fill(void *dst, const void *pattern, size_t size, size_t count,
                    const Stream *stream) = 0;
  virtual void fillStrided(const ArrayDescriptor &dst, const void *pattern,
                           size_t elementSize, const Stream *stream) = 0;
  /// Writes memory that nothing in the launch queue uses, zeros if `contents`
  /// is null. It is done at once and no part of a graph that is being captured.
  virtual void initialize(void *dst, const void *contents, size_t bytes,
                          const Stream *stream) = 0;

  /// Loads the code of a variant, which then launches it.
  virtual std::unique_ptr<DeviceCode> load(const Kernel::Variant &variant,
                                           Code &code) = 0;
  /// The same from machine code that the kernel cache keeps for the code; null
  /// if there is none.
  virtual std::unique_ptr<DeviceCode> loadKept(const Kernel::Variant &,
                                               const Code &) {
    return nullptr;
  }
  /// Provisional machine code of a long program by the driver's linker, which
  /// works for several threads at a time; kept for `loadKept`. Null for other
  /// programs.
  virtual std::unique_ptr<DeviceCode> loadLinked(const Kernel::Variant &,
                                                 const Code &) {
    return nullptr;
  }
  /// Machine code of the whole program by the toolkit's assembler, which works
  /// for several threads at a time; kept for `loadKept`. Null where there is no
  /// such program.
  /// mayBeWorse: also provisional code, by a program of another release than
  /// the driver's, or with less effort for a long program.
  virtual std::unique_ptr<DeviceCode> loadAssembled(const Kernel::Variant &,
                                                    const Code &, bool) {
    return nullptr;
  }
  /// Leaves machine code for `loadKept` of later processes. `loaded`: what
  /// `load` made of the code.
  virtual void keep(const Kernel::Variant &, Code, const DeviceCode &) {}
  /// Turns code for a file into machine code, which `load` need not compile.
  virtual void assemble(Code &) {}
  /// True if the arrays of a launch lie such that TMA can load tiles of them.
  virtual bool canMap(const std::vector<TensorMap> &, const void *) {
    return false;
  }

  virtual std::unique_ptr<CaptureBase>
  beginCapture(std::shared_ptr<Stream> stream, CaptureMode mode,
               bool external) = 0;

  virtual void scan(NumberType kind, int width, Sequence out, Sequence in,
                    int64_t count, bool inclusive, const Stream *stream) = 0;
  /// Returns whether the result is in the room behind the pairs.
  virtual bool sort(const Pairs &pairs, int beginBit, int endBit,
                    const Stream *stream) = 0;
  virtual void sortSegments(const Pairs &pairs, const int32_t *begins,
                            const int32_t *ends, int64_t segments,
                            const Stream *stream) = 0;
  virtual void findRuns(const Runs &runs, const Stream *stream) = 0;
  /// These throw where the host does the same by other means.
  virtual void multiplyRows(const SparseProduct &product, const Stream *stream);
  virtual void buildTree(const TreeBuild &build, bool refits,
                         const Stream *stream);

  /// The stream that work is queued on when none is named, made at first use.
  std::shared_ptr<Stream> currentStream();
  void setCurrentStream(std::shared_ptr<Stream> stream);
  bool hasCurrentStream() const;

protected:
  ~Device() = default;
  [[noreturn]] void refuse(const char *what) const;

  mutable ForkMutex mutex;

private:
  std::shared_ptr<Stream> current;
};

/// The device of a number; throws if there is none.
Device &deviceAt(int device);
/// cpu/Device.cpp.
Device &hostDevice();
/// cuda/Device.cpp: those that are no host. Throws if there is none.
Device &acceleratorAt(int device);
/// Physical devices and mapped contexts.
int acceleratorCount();

} // namespace warp

#endif // WARP_LIB_RUNTIME_DEVICE_H
