//===- GraphImpl.h - Captures and recorders of host work --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The rest of the runtime asks before it does work: is somebody recording it?
// Without a capture in progress, that is one read of an atomic.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHIMPL_H
#define WARP_LIB_RUNTIME_GRAPHIMPL_H

#include "GraphTrace.h"
#include "warp/Graph.h"
#include "warp/Kernel.h"

#include <atomic>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

namespace warp {

/// Objects that live as long as a graph.
using Kept = std::vector<std::shared_ptr<void>>;

class DeviceCode;

/// A launch of tier-0 code that a capture on a GPU has recorded.
struct ProvisionalLaunch {
  const Kernel::Variant *variant;
  const DeviceCode *code;
};

/// A capture as others see it. `owner` is the thread, for host memory.
class CaptureBase : public Capture {
public:
  ~CaptureBase() override;

  /// Notes what is recorded from now on.
  void startTrace(bool isSaved);
  /// Null if none is kept.
  GraphTrace *trace() const { return notes.get(); }
  /// True if it records what is queued on a stream, null for the current one.
  virtual bool records(const Stream *) const { return true; }
  /// The nodes that the next one on a stream comes behind.
  virtual std::vector<NodeId> position(const Stream *) const { return {}; }
  /// True if the graph gets tier-1 code once that is there.
  virtual bool takesBetterCode() const { return false; }
  /// The order that the graph gets.
  NodeOrder order = NodeOrder::Recorded;

protected:
  explicit CaptureBase(int device);
  /// No more to be found by others; what was kept so far. Thread-safe.
  std::shared_ptr<Kept> close();
  /// Around work that is no call of the runtime's public functions.
  GraphStep beginStep(const Stream *stream) const;
  void endStep(GraphStep step, const Stream *stream);
  /// Gives a graph what was noted.
  void handTrace(Graph &graph) { graph.recorded = notes; }
  /// The launches of tier-0 code so far.
  std::vector<ProvisionalLaunch> takeProvisional();
  static void handSchedule(Graph &graph,
                           std::shared_ptr<const GraphSchedule> schedule) {
    graph.ordered = std::move(schedule);
  }

private:
  friend bool keepForCapture(int device, std::function<void()> release);
  friend void noteProvisional(int device, ProvisionalLaunch launch);
  std::shared_ptr<Kept> kept = std::make_shared<Kept>();
  std::shared_ptr<GraphTrace> notes;
  std::vector<ProvisionalLaunch> provisional;
  bool open = true;
};

/// Records host work of one thread.
class HostRecorder {
public:
  virtual ~HostRecorder() = default;
  virtual void launch(Kernel &kernel, const Kernel::Plan &plan,
                      const void *params) = 0;
  /// `bytes`: that the call touches, for `Graph::isShort`.
  virtual void call(std::function<void()> function, size_t bytes) = 0;
};

extern std::atomic<int> capturesInProgress;
HostRecorder *threadRecorder();
void setThreadRecorder(HostRecorder *recorder);

/// The recorder of this thread, if it is recording host work.
inline HostRecorder *hostRecorder() {
  if (__builtin_expect(capturesInProgress.load(std::memory_order_relaxed) == 0,
                       1))
    return nullptr;
  return threadRecorder();
}

/// Hands host work to the recorder of this thread; false if there is none.
template <typename Fn> bool recordOnHost(size_t bytes, Fn &&function) {
  HostRecorder *recorder = hostRecorder();
  if (recorder)
    recorder->call(std::forward<Fn>(function), bytes);
  return recorder != nullptr;
}

/// Host work that is done now unless this thread records it.
template <typename Fn> void recordOrRun(size_t bytes, Fn &&function) {
  if (HostRecorder *recorder = hostRecorder())
    recorder->call(std::forward<Fn>(function), bytes);
  else
    function();
}

/// If graphs are being recorded that may use memory of a device (the CPU: on
/// this thread), puts `release` off until they are destroyed. False if none.
bool keepForCapture(int device, std::function<void()> release);

/// True if a capture on a device keeps the code that launches have now, as
/// graphs of other libraries and those that are verified do.
bool capturesFixedCode(int device);
/// Tells the captures on a GPU of a launch of tier-0 code, which one of them
/// may have recorded.
void noteProvisional(int device, ProvisionalLaunch launch);

/// Throws if a device is being captured, for what waits or reads results.
void checkNotCapturing(int device, const char *what);

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHIMPL_H
