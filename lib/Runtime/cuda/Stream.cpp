//===- Stream.cpp - CUDA streams and events -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Streams are created as blocking ones, so that work on the legacy default
// stream, of other libraries too, keeps its order with ours.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "GraphDriver.h"
#include "GraphImpl.h"
#include "Runtime/LaunchQueue.h"

#include <algorithm>

using namespace warp;
using cuda::ContextScope;
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

//===----------------------------------------------------------------------===//
// Streams
//===----------------------------------------------------------------------===//

void *CudaDevice::makeStream(int priority) {
  BehindNothing exempt;
  ContextScope scope(index);
  StreamHandle stream;
  WARP_CUDA(streamCreate, &stream, cuda::streamDefault, priority);
  return stream;
}

void CudaDevice::releaseStream(const Stream &stream, bool destroy) {
  if (cuda::isForked())
    return;
  // Operations there name the stream.
  drainLaunches();
  reclaimStream(*stream.use(), destroy);
  // At exit the driver may be gone already; there is nobody to tell.
  if (destroy)
    cuda::driver()->streamDestroy(raw(stream));
}

bool CudaDevice::isCapturing(const Stream &stream) {
  // Captures, and streams that join one, begin and end with nothing waiting.
  BehindNothing exempt;
  ContextScope scope(index);
  int status = 0;
  if (stream.handle())
    WARP_CUDA(streamIsCapturing, raw(stream), &status);
  return status != 0;
}

bool CudaDevice::isBlocking(const Stream &stream) {
  BehindNothing exempt;
  ContextScope scope(index);
  unsigned flags = 0;
  WARP_CUDA(streamGetFlags, raw(stream), &flags);
  return !(flags & cuda::streamNonBlocking);
}

int CudaDevice::priorityOf(const Stream &stream) {
  BehindNothing exempt;
  ContextScope scope(index);
  int value = 0;
  WARP_CUDA(streamGetPriority, raw(stream), &value);
  return value;
}

bool CudaDevice::isComplete(const Stream &stream) {
  finishLaunches();
  ContextScope scope(index);
  return isDone(cuda::driver()->streamQuery(raw(stream)), "streamQuery");
}

void CudaDevice::synchronize(const Stream &stream) {
  finishLaunches();
  if (capturesInProgress && isCapturing(stream))
    checkNotCapturing(index, "wait for a stream of");
  {
    ContextScope scope(index);
    WARP_CUDA(streamSynchronize, raw(stream));
  }
  DeviceErrorRecord::check(index);
}

void CudaDevice::synchronizeBusyStreams() {
  // Waiting would end a capture; what it recorded does not run yet.
  if (cuda::isForked() || warp::isCapturing(index))
    return;
  finishLaunches();
  // Other threads may queue work meanwhile, or destroy a stream.
  for (EventHandle event : eventsOfStreams(index)) {
    ContextScope scope(index);
    WARP_CUDA(eventSynchronize, event);
  }
}

//===----------------------------------------------------------------------===//
// Events
//===----------------------------------------------------------------------===//

void *CudaDevice::makeEvent(bool timing, bool interprocess) {
  BehindNothing exempt;
  ContextScope scope(index);
  EventHandle event;
  WARP_CUDA(eventCreate, &event,
            (timing ? cuda::eventDefault : cuda::eventDisableTiming) |
                (interprocess ? cuda::eventInterprocess : 0));
  return event;
}

void *CudaDevice::importEvent(const IpcHandle &handle) {
  ContextScope scope(index);
  cuda::RawIpcHandle native;
  std::copy(handle.begin(), handle.end(), native.bytes);
  EventHandle event;
  WARP_CUDA(ipcOpenEventHandle, &event, native);
  return event;
}

IpcHandle CudaDevice::exportEvent(const Event &event) {
  ContextScope scope(index);
  cuda::RawIpcHandle native;
  WARP_CUDA(ipcGetEventHandle, &native, raw(event));
  IpcHandle handle;
  std::copy(native.bytes, native.bytes + handle.size(), handle.begin());
  return handle;
}

void CudaDevice::destroyEvent(const Event &event) {
  auto *handle = raw(event);
  if (queueBehind([handle] { cuda::driver()->eventDestroy(handle); }))
    return;
  cuda::driver()->eventDestroy(raw(event));
}

/// Tells the driver that an event is no edge of the graph that a stream is
/// captured into; 0 for all other events.
static unsigned externalFlag(const Stream &stream, bool external) {
  return external && capturesInProgress && stream.isCapturing() ? 1 : 0;
}

void CudaDevice::record(const Event &event, const Stream &stream,
                        bool external) {
  // A graph that is captured may take the event for one of its edges.
  if (!capturesInProgress && mustQueue()) {
    auto *handle = raw(event);
    queueBehind([this, handle, where = laterStream(index, &stream)] {
      ContextScope scope(index);
      WARP_CUDA(eventRecord, handle, raw(*where()));
    });
    return;
  }
  ContextScope scope(index);
  if (unsigned flag = externalFlag(stream, external))
    WARP_CUDA_GRAPH(recordEvent, raw(event), raw(stream), flag);
  else
    WARP_CUDA(eventRecord, raw(event), raw(stream));
}

void CudaDevice::wait(const Stream &stream, const Event &event, bool external) {
  if (!capturesInProgress && mustQueue()) {
    auto *handle = raw(event);
    queueBehind([this, handle, where = laterStream(index, &stream)] {
      ContextScope scope(index);
      WARP_CUDA(streamWaitEvent, raw(*where()), handle, 0);
    });
    return;
  }
  ContextScope scope(index);
  WARP_CUDA(streamWaitEvent, raw(stream), raw(event),
            externalFlag(stream, external));
}

bool CudaDevice::isComplete(const Event &event) {
  finishLaunches();
  ContextScope scope(index);
  return isDone(cuda::driver()->eventQuery(raw(event)), "eventQuery");
}

void CudaDevice::synchronize(const Event &event) {
  finishLaunches();
  {
    ContextScope scope(index);
    WARP_CUDA(eventSynchronize, raw(event));
  }
  DeviceErrorRecord::check(index);
}

float CudaDevice::elapsed(const Event &start, const Event &end) {
  finishLaunches();
  ContextScope scope(index);
  float milliseconds = 0;
  WARP_CUDA(eventElapsedTime, &milliseconds, raw(start), raw(end));
  return milliseconds;
}

//===----------------------------------------------------------------------===//
// Work on a stream
//===----------------------------------------------------------------------===//

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
