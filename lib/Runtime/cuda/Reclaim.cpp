//===- Reclaim.cpp - Stream-ordered frees of memory in use ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An array can be freed while kernels on any stream still read it. Arrays do
// not know their streams, since noting that would cost every launch time;
// instead every stream knows whether work was queued on it (`busy`).
//
// As long as one stream has done all the work of a device, memory is freed on
// that stream, in order and at no cost. Otherwise a stream of our own, the
// reclaim stream, first waits for an event on each busy stream, which is then
// no longer busy, and the free comes after. The memory pool takes care that
// memory given out again respects that order.
//
// `busy` is set after the work was queued and before the arrays of a launch
// are let go of, so a free that sees it unset has nothing to wait for.
//
// Pinned host memory has no stream-ordered free. It waits in a list, with one
// event per device, and is recycled or freed once these are done. While a
// stream is captured into a graph nothing may be freed; that is done later.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "Runtime/LaunchQueue.h"
#include "warp/Forks.h"

#include <algorithm>

using namespace warp;
using cuda::EventHandle;
using cuda::StreamHandle;

/// Pinned memory kept for reuse, at most.
static constexpr size_t pinnedReserve = size_t(512) << 20;

//===----------------------------------------------------------------------===//
// Streams
//===----------------------------------------------------------------------===//

StreamUse *CudaDevice::retainStream(void *stream) {
  auto handle = static_cast<StreamHandle>(stream);
  std::lock_guard lock(mutex);
  for (StreamUse *use : uses)
    if (use->handle == handle) {
      ++use->references;
      use->gone = false;
      return use;
    }
  auto *use = new StreamUse;
  use->handle = handle;
  use->references = 1;
  uses.push_back(use);
  return use;
}

static EventHandle makeEvent() {
  EventHandle event;
  WARP_CUDA(eventCreate, &event, cuda::eventDisableTiming);
  return event;
}

static bool isCaptured(StreamHandle stream) {
  int status = 0;
  // The default stream cannot be captured and may not be asked.
  if (!stream)
    return false;
  WARP_CUDA(streamIsCapturing, stream, &status);
  return status != 0;
}

static bool isCaptured(const CudaDevice &state) {
  return std::any_of(state.uses.begin(), state.uses.end(), [](StreamUse *use) {
    return use->exists() && isCaptured(use->handle);
  });
}

/// An event after all that was queued on a stream.
static EventHandle record(StreamUse &use) {
  if (!use.event)
    use.event = makeEvent();
  WARP_CUDA(eventRecord, use.event, use.handle);
  return use.event;
}

/// Lets the reclaim stream wait for a busy stream.
static void waitFor(CudaDevice &state, StreamUse &use) {
  if (!use.busy.exchange(false, std::memory_order_acq_rel))
    return;
  if (!state.reclaim)
    WARP_CUDA(streamCreate, &state.reclaim, cuda::streamDefault, 0);
  WARP_CUDA(streamWaitEvent, state.reclaim, record(use), 0);
  state.reclaimPending = true;
}

std::vector<EventHandle> warp::eventsOfStreams(int device) {
  // Before locks that operations take.
  drainLaunches();
  CudaDevice &state = cudaDevice(device);
  std::lock_guard lock(state.mutex);
  std::vector<EventHandle> events;
  for (StreamUse *use : state.uses)
    if (use->exists() && use->used) {
      cuda::ContextScope scope(device);
      events.push_back(record(*use));
    }
  return events;
}

/// A stream that comes after all work queued so far: the one that did it all,
/// or the reclaim stream. `apart`: that one in any case, for more to wait for.
static StreamHandle afterAllWork(CudaDevice &state, bool apart = false) {
  StreamUse *only = nullptr;
  int count = 0;
  for (StreamUse *use : state.uses)
    if (use->exists() && use->used.load(std::memory_order_relaxed)) {
      only = use;
      ++count;
    }
  if (state.reclaimPending &&
      cuda::driver()->streamQuery(state.reclaim) == cuda::success)
    state.reclaimPending = false;
  if (count == 1 && !state.reclaimPending && !apart)
    return only->handle;
  state.reclaimPending |= apart;
  if (!state.reclaim)
    WARP_CUDA(streamCreate, &state.reclaim, cuda::streamDefault, 0);
  for (StreamUse *use : state.uses)
    if (use->exists())
      waitFor(state, *use);
  return state.reclaim;
}

namespace {
/// An event of a device, to be waited for by others.
struct Pending {
  int device;
  EventHandle event;
};
} // namespace

/// Records an event after all work of a device. False while it is captured.
static bool recordPending(int device, std::vector<Pending> &list) {
  CudaDevice &state = cudaDevice(device);
  std::lock_guard lock(state.mutex);
  if (state.uses.empty())
    return true;
  cuda::ContextScope scope(device);
  if (isCaptured(state))
    return false;
  list.push_back({device, makeEvent()});
  WARP_CUDA(eventRecord, list.back().event, afterAllWork(state));
  return true;
}

void CudaDevice::reclaimStream(StreamUse &use, bool destroyed) {
  std::lock_guard lock(mutex);
  bool last = --use.references == 0;
  if (!last && !destroyed)
    return;
  if (!use.gone) {
    try {
      cuda::ContextScope scope(index);
      if (!isCaptured(use.handle))
        waitFor(*this, use);
    } catch (const Error &) {
    }
  }
  use.busy = use.used = false;
  use.gone = !last;
}

void CudaDevice::join(const Stream &stream) {
  drainLaunches();
  std::lock_guard lock(mutex);
  cuda::ContextScope scope(index);
  StreamHandle handle = afterAllWork(*this);
  if (handle == stream.handle())
    return;
  EventHandle event = ::makeEvent();
  WARP_CUDA(eventRecord, event, handle);
  WARP_CUDA(streamWaitEvent, static_cast<StreamHandle>(stream.handle()), event,
            0);
  cuda::driver()->eventDestroy(event);
}

//===----------------------------------------------------------------------===//
// Device memory
//===----------------------------------------------------------------------===//

namespace {
/// Events of the other devices, where these may use our memory, too.
class PeerWork {
public:
  explicit PeerWork(int device) {
    if (!arePeersLinked())
      return;
    for (int other = 0; other < acceleratorCount(); ++other)
      if (other != device)
        recordPending(other, events);
  }
  ~PeerWork() {
    for (const Pending &pending : events)
      cuda::driver()->eventDestroy(pending.event);
  }
  bool empty() const { return events.empty(); }
  void wait(StreamHandle stream) const {
    for (const Pending &pending : events)
      cuda::driver()->streamWaitEvent(stream, pending.event, 0);
  }
  void synchronize() const {
    for (const Pending &pending : events)
      cuda::driver()->eventSynchronize(pending.event);
  }

private:
  std::vector<Pending> events;
};
} // namespace

static void freeNow(CudaDevice &state, const PeerWork &peers,
                    cuda::Pointer memory, bool pooled) {
  const cuda::Driver *driver = cuda::driver();
  if (pooled) {
    StreamHandle stream = afterAllWork(state, !peers.empty());
    peers.wait(stream);
    driver->memFreeAsync(memory, stream);
    return;
  }
  driver->memFree(memory);
}

void warp::reclaimDevice(int device, cuda::Pointer memory, bool pooled) {
  if (queueFree([=] { reclaimDevice(device, memory, pooled); }))
    return;
  CudaDevice &state = cudaDevice(device);
  PeerWork peers(device);
  cuda::ContextScope scope(device);
  std::vector<std::pair<cuda::Pointer, bool>> batch;
  {
    std::lock_guard lock(state.mutex);
    state.deferred.emplace_back(memory, pooled);
    if (isCaptured(state))
      return;
    batch.swap(state.deferred);
  }
  if (!std::all_of(batch.begin(), batch.end(),
                   [](const auto &entry) { return entry.second; })) {
    // Waits for all streams, those of other libraries, too.
    cuda::driver()->ctxSynchronize();
    peers.synchronize();
  }
  std::lock_guard lock(state.mutex);
  for (auto [address, fromPool] : batch)
    freeNow(state, peers, address, fromPool);
}

//===----------------------------------------------------------------------===//
// Pinned memory
//===----------------------------------------------------------------------===//

namespace {
struct PinnedBlock {
  void *memory;
  size_t bytes;
  /// Events to wait for before it can be used again; not known yet for blocks
  /// that were freed during a capture.
  std::vector<Pending> events;
  bool known = false;
};

struct PinnedList {
  ForkMutex mutex;
  std::vector<PinnedBlock> blocks;
  size_t bytes = 0;
};
} // namespace

static PinnedList &pinnedList() {
  static auto *list = new PinnedList;
  return *list;
}

static void forgetEvents(PinnedBlock &block) {
  for (const Pending &pending : block.events) {
    cuda::ContextScope scope(pending.device);
    cuda::driver()->eventDestroy(pending.event);
  }
  block.events.clear();
}

static void recordEvents(PinnedBlock &block) {
  block.known = true;
  for (int device = 0; device < acceleratorCount(); ++device)
    block.known &= recordPending(device, block.events);
  if (!block.known)
    forgetEvents(block);
}

static bool isDone(PinnedBlock &block) {
  if (!block.known)
    recordEvents(block);
  if (!block.known)
    return false;
  for (const Pending &pending : block.events) {
    cuda::ContextScope scope(pending.device);
    // After a fault nothing runs any more, so nothing uses the memory.
    if (cuda::driver()->eventQuery(pending.event) == cuda::errorNotReady)
      return false;
  }
  forgetEvents(block);
  return true;
}

/// Frees blocks that are done until at most `limit` bytes are kept.
static void trim(PinnedList &list, size_t limit) {
  for (size_t i = 0; i < list.blocks.size() && list.bytes > limit;) {
    PinnedBlock &block = list.blocks[i];
    if (!isDone(block)) {
      ++i;
      continue;
    }
    cuda::driver()->memFreeHost(block.memory);
    list.bytes -= block.bytes;
    list.blocks.erase(list.blocks.begin() + i);
  }
}

void warp::trimPinned() {
  drainLaunches();
  std::lock_guard lock(pinnedList().mutex);
  trim(pinnedList(), 0);
}

void *warp::recyclePinned(size_t bytes) {
  drainLaunches();
  PinnedList &list = pinnedList();
  std::lock_guard lock(list.mutex);
  for (size_t i = 0; i < list.blocks.size(); ++i) {
    PinnedBlock &block = list.blocks[i];
    if (block.bytes != bytes || !isDone(block))
      continue;
    void *memory = block.memory;
    list.bytes -= bytes;
    list.blocks.erase(list.blocks.begin() + i);
    return memory;
  }
  return nullptr;
}

void warp::reclaimPinned(void *memory, size_t bytes) {
  drainLaunches();
  PinnedBlock block{memory, bytes, {}};
  recordEvents(block);
  PinnedList &list = pinnedList();
  std::lock_guard lock(list.mutex);
  list.bytes += bytes;
  list.blocks.push_back(std::move(block));
  trim(list, pinnedReserve);
}
