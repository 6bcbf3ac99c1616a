//===- Graph.cpp - Captures in progress, memory they keep -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A list of the captures in progress, which the rest of the runtime consults:
// memory freed meanwhile is not given back but put on the list of each capture
// that may have recorded a use of it, and is released by the last graph that
// holds it. Waiting for a device that is being captured is refused before the
// driver sees it, because the driver would throw the whole capture away.
//
//===----------------------------------------------------------------------===//

#include "GraphImpl.h"

#include "Device.h"
#include "GraphTrace.h"

#include <algorithm>
#include <thread>

using namespace warp;

namespace {
struct Entry {
  CaptureBase *capture;
  std::thread::id thread;
};

struct Registry {
  ForkMutex mutex;
  std::vector<Entry> entries;
};

/// Calls a function when the last graph that holds it goes away.
struct Release {
  explicit Release(std::function<void()> function)
      : function(std::move(function)) {}
  ~Release() { function(); }
  Release(const Release &) = delete;
  Release &operator=(const Release &) = delete;

  std::function<void()> function;
};
} // namespace

static Registry &registry() {
  static auto *instance = new Registry;
  return *instance;
}

std::atomic<int> warp::capturesInProgress{0};

static thread_local HostRecorder *recorderOfThread = nullptr;

HostRecorder *warp::threadRecorder() { return recorderOfThread; }
void warp::setThreadRecorder(HostRecorder *recorder) {
  recorderOfThread = recorder;
}

Graph::~Graph() = default;
Capture::~Capture() = default;

void Capture::addHost(std::function<void()>, const std::string &name) {
  throw Error(Error::Kind::Runtime, "a capture on '" +
                                        deviceInfo(device()).alias +
                                        "' cannot hold a call of the host, '" +
                                        name + "': only captures on 'cpu' can");
}

void Capture::noteOther(std::string what) {
  if (GraphTrace *trace = static_cast<CaptureBase *>(this)->trace())
    trace->addOther(std::move(what));
}

std::unique_ptr<Capture> Capture::begin(int device,
                                        std::shared_ptr<Stream> stream,
                                        CaptureMode mode, bool external,
                                        bool traced, NodeOrder order) {
  std::unique_ptr<CaptureBase> capture =
      deviceAt(device).beginCapture(std::move(stream), mode, external);
  if (!external)
    capture->order = order;
  if (traced || capture->order != NodeOrder::Recorded)
    capture->startTrace(traced);
  return capture;
}

CaptureBase::CaptureBase(int device) : Capture(device) {
  std::lock_guard lock(registry().mutex);
  registry().entries.push_back({this, std::this_thread::get_id()});
  ++capturesInProgress;
}

CaptureBase::~CaptureBase() { close(); }

std::shared_ptr<Kept> CaptureBase::close() {
  std::lock_guard lock(registry().mutex);
  if (!open)
    return nullptr;
  open = false;
  auto &entries = registry().entries;
  entries.erase(
      std::remove_if(entries.begin(), entries.end(),
                     [&](const Entry &entry) { return entry.capture == this; }),
      entries.end());
  --capturesInProgress;
  if (notes)
    --tracesInProgress;
  return std::move(kept);
}

void CaptureBase::startTrace(bool isSaved) {
  std::lock_guard lock(registry().mutex);
  notes = std::make_shared<GraphTrace>();
  notes->isSaved = isSaved;
  ++tracesInProgress;
}

GraphStep CaptureBase::beginStep(const Stream *stream) const {
  GraphStep step;
  if (notes) {
    step.first = notes->operations.size();
    step.before = position(stream);
  }
  return step;
}

void CaptureBase::endStep(GraphStep step, const Stream *stream) {
  if (!notes)
    return;
  step.last = notes->operations.size();
  if (step.after.empty())
    step.after = position(stream);
  notes->steps.back().push_back(std::move(step));
}

/// True if a capture may have recorded a use of memory of a device.
static bool mayUse(const Entry &entry, int device) {
  if (isHost(device))
    return entry.thread == std::this_thread::get_id();
  return entry.capture->device() == device;
}

bool warp::keepForCapture(int device, std::function<void()> release) {
  if (capturesInProgress.load(std::memory_order_relaxed) == 0)
    return false;
  std::shared_ptr<void> kept;
  std::lock_guard lock(registry().mutex);
  for (const Entry &entry : registry().entries) {
    if (!mayUse(entry, device))
      continue;
    if (!kept)
      kept = std::make_shared<Release>(std::move(release));
    entry.capture->kept->push_back(kept);
  }
  return kept != nullptr;
}

const GraphTrace *Graph::trace() const {
  return recorded && recorded->isSaved ? recorded.get() : nullptr;
}

CaptureBase *warp::findTraced(int device, const Stream *stream) {
  if (!isHost(device) &&
      !(stream ? stream : currentStream(device).get())->isCapturing())
    return nullptr;
  std::lock_guard lock(registry().mutex);
  for (const Entry &entry : registry().entries)
    if (entry.capture->device() == device && entry.capture->trace() &&
        mayUse(entry, device) && entry.capture->records(stream))
      return entry.capture;
  return nullptr;
}

/// True if this thread records, for the host, or if a capture on a GPU does of
/// which `test` is true.
template <typename Test> static bool hasCapture(int device, Test test) {
  if (capturesInProgress.load(std::memory_order_relaxed) == 0)
    return false;
  if (isHost(device))
    return threadRecorder() != nullptr;
  std::lock_guard lock(registry().mutex);
  return std::any_of(registry().entries.begin(), registry().entries.end(),
                     [&](const Entry &entry) {
                       return entry.capture->device() == device &&
                              test(*entry.capture);
                     });
}

bool warp::isCapturing(int device) {
  return hasCapture(device, [](const CaptureBase &) { return true; });
}

bool warp::capturesFixedCode(int device) {
  return hasCapture(device, [](const CaptureBase &capture) {
    return !capture.takesBetterCode();
  });
}

void warp::noteProvisional(int device, ProvisionalLaunch launch) {
  if (capturesInProgress.load(std::memory_order_relaxed) == 0)
    return;
  std::lock_guard lock(registry().mutex);
  for (const Entry &entry : registry().entries)
    if (entry.capture->device() == device)
      entry.capture->provisional.push_back(launch);
}

std::vector<ProvisionalLaunch> CaptureBase::takeProvisional() {
  std::lock_guard lock(registry().mutex);
  return std::move(provisional);
}

void warp::checkNotCapturing(int device, const char *what) {
  if (!isHost(device) && isCapturing(device))
    throw Error(Error::Kind::Runtime,
                std::string("cannot ") + what + " '" +
                    deviceInfo(device).alias +
                    "' while a graph is being captured on it");
}
