//===- Device.cpp - Devices by their number -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Questions about devices, streams and events, which the device answers. Each
// device that queues work has a current stream, made at first use.
//
//===----------------------------------------------------------------------===//

#include "Device.h"

#include "warp/Error.h"

#include <string>

using namespace warp;

Device &warp::deviceAt(int device) {
  return isHost(device) ? hostDevice() : acceleratorAt(device);
}

void Device::refuse(const char *what) const {
  throw Error(Error::Kind::Value, "'" + info.alias + "' has no " + what);
}

Queues &Device::queues() { refuse("streams and events"); }

void Device::multiplyRows(const SparseProduct &, const Stream *) {
  refuse("sparse products");
}

void Device::buildTree(const TreeBuild &, bool, const Stream *) {
  refuse("builds of hierarchies");
}

//===----------------------------------------------------------------------===//
// Devices
//===----------------------------------------------------------------------===//

const DeviceInfo &warp::deviceInfo(int device) { return deviceAt(device).info; }

std::pair<size_t, size_t> warp::deviceMemory(int device) {
  return deviceAt(device).memoryUse();
}

void warp::synchronizeDevice(int device) { deviceAt(device).synchronize(); }

void warp::synchronizeAll() {
  // Devices that nobody used have no stream and nothing to wait for.
  for (int device = 0; device < acceleratorCount(); ++device)
    if (acceleratorAt(device).hasCurrentStream())
      synchronizeDevice(device);
}

void warp::synchronizeBusyStreams() {
  for (int device = 0; device < acceleratorCount(); ++device)
    acceleratorAt(device).synchronizeBusyStreams();
}

//===----------------------------------------------------------------------===//
// Streams
//===----------------------------------------------------------------------===//

static Queues &queuesOf(int device) { return deviceAt(device).queues(); }

Stream::Stream(int device, int priority)
    : Stream(device, queuesOf(device).makeStream(priority)) {
  owned = true;
}

Stream::Stream(int device, void *handle)
    : deviceIndex(device), stream(handle),
      known(queuesOf(device).retainStream(handle)) {}

Stream::~Stream() { queuesOf(deviceIndex).releaseStream(*this, owned); }

bool Stream::isComplete() const {
  return queuesOf(deviceIndex).isComplete(*this);
}

bool Stream::isCapturing() const {
  return queuesOf(deviceIndex).isCapturing(*this);
}

bool Stream::isBlocking() const {
  return queuesOf(deviceIndex).isBlocking(*this);
}

int Stream::priority() const { return queuesOf(deviceIndex).priorityOf(*this); }

void Stream::synchronize() const { queuesOf(deviceIndex).synchronize(*this); }

void warp::joinStreams(const Stream &stream) {
  queuesOf(stream.device()).join(stream);
}

std::shared_ptr<Stream> Device::currentStream() {
  {
    std::lock_guard lock(mutex);
    if (current)
      return current;
  }
  auto made = std::make_shared<Stream>(index);
  std::lock_guard lock(mutex);
  // Another thread may have been first. `made` goes after the lock does, since
  // that needs the mutex.
  if (current)
    return current;
  current = made;
  return made;
}

void Device::setCurrentStream(std::shared_ptr<Stream> stream) {
  if (!stream || stream->device() != index)
    throw Error(Error::Kind::Runtime,
                "expects a stream of '" + info.alias + "', but got " +
                    (stream
                         ? "one of '" + deviceInfo(stream->device()).alias + "'"
                         : std::string("none")));
  // The former one is released without the mutex, which that needs.
  std::lock_guard lock(mutex);
  current.swap(stream);
}

bool Device::hasCurrentStream() const {
  std::lock_guard lock(mutex);
  return current != nullptr;
}

std::shared_ptr<Stream> warp::currentStream(int device) {
  return deviceAt(device).currentStream();
}

void warp::setCurrentStream(int device, std::shared_ptr<Stream> stream) {
  deviceAt(device).setCurrentStream(std::move(stream));
}

//===----------------------------------------------------------------------===//
// Events
//===----------------------------------------------------------------------===//

Event::Event(int device, bool enableTiming, bool interprocess)
    : deviceIndex(device), timing(enableTiming) {
  if (enableTiming && interprocess)
    throw Error(Error::Kind::LaunchValue,
                "expects an event with 'enable_timing' or 'interprocess', but "
                "got both");
  event = queuesOf(device).makeEvent(enableTiming, interprocess);
}

Event::Event(int device, const IpcHandle &handle)
    : deviceIndex(device), event(queuesOf(device).importEvent(handle)) {}

Event::~Event() { queuesOf(deviceIndex).destroyEvent(*this); }

IpcHandle Event::ipcHandle() const {
  return queuesOf(deviceIndex).exportEvent(*this);
}

void Event::record(const Stream &stream, bool external) {
  if (stream.device() != deviceIndex)
    throw Error(Error::Kind::Runtime,
                "expects a stream of '" + deviceInfo(deviceIndex).alias +
                    "' to record an event of that device, but got one of '" +
                    deviceInfo(stream.device()).alias + "'");
  queuesOf(deviceIndex).record(*this, stream, external || timing);
}

bool Event::isComplete() const {
  return queuesOf(deviceIndex).isComplete(*this);
}

void Event::synchronize() const { queuesOf(deviceIndex).synchronize(*this); }

void warp::waitEvent(const Stream &stream, const Event &event, bool external) {
  queuesOf(stream.device()).wait(stream, event, external);
}

float warp::elapsedMilliseconds(const Event &start, const Event &end) {
  return queuesOf(start.device()).elapsed(start, end);
}
