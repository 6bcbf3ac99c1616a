//===- Stream.cpp - CUDA streams and events -------------------------------===//
//
// Streams are created as blocking ones, so that work on the legacy default
// stream, of other libraries too, keeps its order with ours. Each device has a
// current stream, made at first use.
//
//===----------------------------------------------------------------------===//

#include "CudaDriver.h"
#include "DeviceState.h"
#include "warp/Device.h"

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
}

Stream::Stream(int device, void *handle) : deviceIndex(device), stream(handle) {
  cudaDeviceState(device);
}

Stream::~Stream() {
  // At exit the driver may be gone already; there is nobody to tell.
  if (owned)
    cuda::driver()->streamDestroy(raw(*this));
}

bool Stream::isComplete() const {
  cuda::ContextScope scope(deviceIndex);
  return isDone(cuda::driver()->streamQuery(raw(*this)), "streamQuery");
}

void Stream::synchronize() const {
  {
    cuda::ContextScope scope(deviceIndex);
    WARP_CUDA(streamSynchronize, raw(*this));
  }
  DeviceErrorRecord::check(deviceIndex);
}

Event::Event(int device, bool enableTiming) : deviceIndex(device) {
  cudaDeviceState(device);
  cuda::ContextScope scope(device);
  EventHandle created;
  WARP_CUDA(eventCreate, &created,
            enableTiming ? cuda::eventDefault : cuda::eventDisableTiming);
  event = created;
}

Event::~Event() { cuda::driver()->eventDestroy(raw(*this)); }

void Event::record(const Stream &stream) {
  cuda::ContextScope scope(stream.device());
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

void warp::waitEvent(const Stream &stream, const Event &event) {
  cuda::ContextScope scope(stream.device());
  WARP_CUDA(streamWaitEvent, raw(stream), raw(event), 0);
}

float warp::elapsedMilliseconds(const Event &start, const Event &end) {
  cuda::ContextScope scope(start.device());
  float milliseconds = 0;
  WARP_CUDA(eventElapsedTime, &milliseconds, raw(start), raw(end));
  return milliseconds;
}

std::shared_ptr<Stream> warp::currentStream(int device) {
  DeviceState &state = cudaDeviceState(device);
  std::lock_guard<std::mutex> lock(state.mutex);
  if (!state.stream) {
    state.stream = std::make_shared<Stream>(device);
    state.streamHandle = raw(*state.stream);
  }
  return state.stream;
}

void warp::setCurrentStream(int device, std::shared_ptr<Stream> stream) {
  DeviceState &state = cudaDeviceState(device);
  if (!stream || stream->device() != device)
    throw Error(
        Error::Kind::Runtime,
        "expects a stream of 'cuda:" + std::to_string(device) + "', but got " +
            (stream ? "one of 'cuda:" + std::to_string(stream->device()) + "'"
                    : std::string("none")));
  std::lock_guard<std::mutex> lock(state.mutex);
  state.streamHandle = raw(*stream);
  state.stream = std::move(stream);
}

StreamHandle warp::streamHandle(int device, const Stream *stream) {
  if (stream)
    return raw(*stream);
  StreamHandle handle = cudaDeviceState(device).streamHandle.load();
  return handle ? handle : raw(*currentStream(device));
}
