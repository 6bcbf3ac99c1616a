//===- Stream.cpp - CUDA streams and events -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Streams are created as blocking ones, so that work on the legacy default
// stream, of other libraries too, keeps its order with ours. Each device has a
// current stream, made at first use.
//
//===----------------------------------------------------------------------===//

#include "Driver.h"
#include "Device.h"
#include "GraphDriver.h"
#include "GraphImpl.h"
#include "warp/Device.h"

#include <algorithm>

using namespace warp;
using cuda::EventHandle;
using cuda::StreamHandle;

static StreamHandle raw(const Stream &stream) {
  return static_cast<StreamHandle>(stream.handle());
}

static EventHandle raw(const Event &event) {
  return static_cast<EventHandle>(event.handle());
}

static bool isDone(cuda::Result result, const char *call) {
  if (result == cuda::errorNotReady)
    return false;
  cuda::check(result, call);
  return true;
}

Stream::Stream(int device, int priority) : deviceIndex(device), owned(true) {
  cudaDeviceState(device);
  cuda::ContextScope scope(device);
  StreamHandle created;
  WARP_CUDA(streamCreate, &created, cuda::streamDefault, priority);
  stream = created;
  known = retainStream(device, created);
}

Stream::Stream(int device, void *handle)
    : deviceIndex(device), stream(handle),
      known(retainStream(device, static_cast<StreamHandle>(handle))) {}

Stream::~Stream() {
  if (cuda::isForked())
    return;
  releaseStream(deviceIndex, known, owned);
  // At exit the driver may be gone already; there is nobody to tell.
  if (owned)
    cuda::driver()->streamDestroy(raw(*this));
}

bool Stream::isCapturing() const {
  cuda::ContextScope scope(deviceIndex);
  int status = 0;
  if (stream)
    WARP_CUDA(streamIsCapturing, raw(*this), &status);
  return status != 0;
}

bool Stream::isBlocking() const {
  cuda::ContextScope scope(deviceIndex);
  unsigned flags = 0;
  WARP_CUDA(streamGetFlags, raw(*this), &flags);
  return !(flags & cuda::streamNonBlocking);
}

int Stream::priority() const {
  cuda::ContextScope scope(deviceIndex);
  int value = 0;
  WARP_CUDA(streamGetPriority, raw(*this), &value);
  return value;
}

bool Stream::isComplete() const {
  cuda::ContextScope scope(deviceIndex);
  return isDone(cuda::driver()->streamQuery(raw(*this)), "streamQuery");
}

void Stream::synchronize() const {
  if (capturesInProgress && isCapturing())
    checkNotCapturing(deviceIndex, "wait for a stream of");
  {
    cuda::ContextScope scope(deviceIndex);
    WARP_CUDA(streamSynchronize, raw(*this));
  }
  DeviceErrorRecord::check(deviceIndex);
}

Event::Event(int device, bool enableTiming, bool interprocess)
    : deviceIndex(device), timing(enableTiming) {
  if (enableTiming && interprocess)
    throw Error(Error::Kind::LaunchValue,
                "expects an event with 'enable_timing' or 'interprocess', but "
                "got both");
  cuda::ContextScope scope(device);
  EventHandle created;
  WARP_CUDA(eventCreate, &created,
            (enableTiming ? cuda::eventDefault : cuda::eventDisableTiming) |
                (interprocess ? cuda::eventInterprocess : 0));
  event = created;
}

Event::Event(int device, const IpcHandle &handle) : deviceIndex(device) {
  cuda::ContextScope scope(device);
  cuda::RawIpcHandle native;
  std::copy(handle.begin(), handle.end(), native.bytes);
  EventHandle opened;
  WARP_CUDA(ipcOpenEventHandle, &opened, native);
  event = opened;
}

Event::~Event() { cuda::driver()->eventDestroy(raw(*this)); }

IpcHandle Event::ipcHandle() const {
  cuda::ContextScope scope(deviceIndex);
  cuda::RawIpcHandle native;
  WARP_CUDA(ipcGetEventHandle, &native, raw(*this));
  IpcHandle handle;
  std::copy(native.bytes, native.bytes + handle.size(), handle.begin());
  return handle;
}

/// What tells the driver that an event is no edge of the graph that a stream is
/// captured into; nothing else may be told so.
static unsigned externalFlag(const Stream &stream, bool external) {
  return external && capturesInProgress && stream.isCapturing() ? 1 : 0;
}

void Event::record(const Stream &stream, bool external) {
  if (stream.device() != deviceIndex)
    throw Error(Error::Kind::Runtime,
                "expects a stream of '" + deviceInfo(deviceIndex).alias +
                    "' to record an event of that device, but got one of '" +
                    deviceInfo(stream.device()).alias + "'");
  cuda::ContextScope scope(stream.device());
  if (unsigned flag = externalFlag(stream, external || timing))
    WARP_CUDA_GRAPH(recordEvent, raw(*this), raw(stream), flag);
  else
    WARP_CUDA(eventRecord, raw(*this), raw(stream));
}

bool Event::isComplete() const {
  cuda::ContextScope scope(deviceIndex);
  return isDone(cuda::driver()->eventQuery(raw(*this)), "eventQuery");
}

void Event::synchronize() const {
  {
    cuda::ContextScope scope(deviceIndex);
    WARP_CUDA(eventSynchronize, raw(*this));
  }
  DeviceErrorRecord::check(deviceIndex);
}

void warp::waitEvent(const Stream &stream, const Event &event, bool external) {
  cuda::ContextScope scope(stream.device());
  WARP_CUDA(streamWaitEvent, raw(stream), raw(event),
            externalFlag(stream, external));
}

float warp::elapsedMilliseconds(const Event &start, const Event &end) {
  cuda::ContextScope scope(start.device());
  float milliseconds = 0;
  WARP_CUDA(eventElapsedTime, &milliseconds, raw(start), raw(end));
  return milliseconds;
}

std::shared_ptr<Stream> warp::currentStream(int device) {
  DeviceState &state = cudaDeviceState(device);
  {
    std::lock_guard lock(state.mutex);
    if (state.stream)
      return state.stream;
  }
  auto made = std::make_shared<Stream>(device);
  std::lock_guard lock(state.mutex);
  // Another thread may have been first. `made` goes after the lock does, since
  // that needs the mutex.
  if (state.stream)
    return state.stream;
  state.stream = made;
  return made;
}

void warp::setCurrentStream(int device, std::shared_ptr<Stream> stream) {
  DeviceState &state = cudaDeviceState(device);
  if (!stream || stream->device() != device)
    throw Error(
        Error::Kind::Runtime,
        "expects a stream of 'cuda:" + std::to_string(device) + "', but got " +
            (stream ? "one of 'cuda:" + std::to_string(stream->device()) + "'"
                    : std::string("none")));
  // The former one is released without the mutex, which that needs.
  std::lock_guard lock(state.mutex);
  state.stream.swap(stream);
}

static const Stream *checked(int device, const Stream *stream) {
  if (stream && stream->device() != device)
    throw Error(Error::Kind::LaunchValue,
                "expects a stream of '" + deviceInfo(device).alias +
                    "', but got one of '" + deviceInfo(stream->device()).alias +
                    "'");
  return stream;
}

QueuedWork::QueuedWork(int device, const Stream *stream)
    : current(checked(device, stream) ? nullptr : currentStream(device)),
      use((current ? current.get() : stream)->use()), scope(device) {}

void warp::synchronizeBusyStreams() {
  if (cudaDeviceCount() == 0 || cuda::isForked())
    return;
  for (int device = 0; device < knownDeviceCount(); ++device) {
    // Waiting would end a capture; what it recorded does not run yet.
    if (isCapturing(device))
      continue;
    // Other threads may queue work meanwhile, or destroy a stream.
    for (EventHandle event : eventsOfStreams(device)) {
      cuda::ContextScope scope(device);
      WARP_CUDA(eventSynchronize, event);
    }
  }
}
