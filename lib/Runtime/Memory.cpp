//===- Memory.cpp - Memory with an owner, contiguous copies and fills -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Work on the memory of a GPU is queued and not waited for; only copies into
// pageable memory are, by the driver, which also takes its own copy of pageable
// memory that it reads.
//
//===----------------------------------------------------------------------===//

#include "warp/Memory.h"

#include "Allocation.h"
#include "GraphImpl.h"
#include "LaunchQueue.h"
#include "Support.h"
#include "warp/MemoryTracker.h"
#include "warp/Peers.h"

using namespace warp;

//===----------------------------------------------------------------------===//
// Allocation
//===----------------------------------------------------------------------===//

void warp::raiseOutOfMemory(Device &device, size_t bytes) {
  size_t free = device.memoryUse().first;
  std::string text = "out of memory on '" + device.info.alias +
                     "', requested " + formatBytes(bytes) + ", free " +
                     formatBytes(free);
  std::string users = MemoryTracker::get().largestUsers(device.index);
  text += users.empty() ? "\nhint: `wp.config.track_memory = True` lets this "
                          "message name the largest users"
                        : "; largest users: " + users;
  throw Error(Error::Kind::Memory, text);
}

/// The device that gives memory: of pinned memory, any that has some.
static Device &giverOf(int device, bool pinned) {
  return deviceAt(pinned ? 0 : device);
}

Buffer::Buffer(int device, size_t size, bool pinned, const Stream *stream)
    : bytes(size), deviceIndex(device) {
  pinned = pinned && isHost(device) && acceleratorCount() > 0;
  if (pinned)
    kind = MemoryKind::Pinned;
  Device &giver = giverOf(device, pinned);
  if (size != 0)
    std::tie(memory, kind) = giver.allocate(size, pinned, stream);
}

void Buffer::track(const std::string &site) {
  if (!memory)
    return;
  tracked = true;
  MemoryTracker::get().add(memory, bytes, deviceIndex, pinned(), site);
}

Buffer::~Buffer() {
  if (!memory)
    return;
  if (tracked)
    MemoryTracker::get().remove(memory);
  auto release = [&giver = giverOf(deviceIndex, pinned()), memory = memory,
                  bytes = bytes,
                  kind = kind] { giver.free(memory, bytes, kind); };
  if (!keepForCapture(deviceIndex, release))
    release();
}

MemoryKind warp::memoryKind(int device, const void *memory) {
  return deviceAt(device).kindOf(memory);
}

bool warp::canAccess(int device, int owner, const void *memory) {
  return device == owner || !memory ||
         deviceAt(device).canReach(deviceAt(owner), memory);
}

//===----------------------------------------------------------------------===//
// Copies and fills
//===----------------------------------------------------------------------===//

static void traceCopy(GraphTrace &trace, void *dst, const Device &to,
                      const void *src, const Device &from, size_t bytes) {
  if (&to == &from)
    return trace.add(GraphOperation::Kind::CopyBytes,
                     graphs::CopyBytes{dst, src, bytes});
  if (from.isHost())
    return trace.addUpload(dst, src, bytes);
  if (to.isHost() && !trace.isSaved) {
    trace.add(GraphOperation::Kind::CopyBytes,
              graphs::CopyBytes{dst, src, bytes});
    trace.operations.back().toHost = true;
    return;
  }
  trace.addOther(to.isHost() ? "a copy to the host" : "a copy between devices");
}

/// Queues a copy behind launches that wait; false if it is to be done now, and
/// then nothing waits any more.
static bool queueCopy(void *dst, Device &to, const void *src, Device &from,
                      size_t bytes, const Stream *stream) {
  if (to.isHost()) {
    finishLaunches();
    return false;
  }
  // Both of two devices have an order.
  bool crosses = !from.isHost() && &from != &to;
  // The source may change as soon as this returns, but a graph reads it later.
  bool staysThere = from.isHost() && capturesInProgress;
  if (crosses || staysThere || (from.isHost() && bytes > mostStaged)) {
    drainLaunches();
    return false;
  }
  std::shared_ptr<std::vector<char>> staged;
  auto *given = static_cast<const char *>(src);
  if (from.isHost())
    staged = std::make_shared<std::vector<char>>(given, given + bytes);
  return queueCall(to.index, stream,
                   [=, to = to.index, from = from.index](const Stream *where) {
                     copyMemory(dst, to, staged ? staged->data() : src, from,
                                bytes, where);
                   });
}

void warp::copyMemory(void *dst, int dstDevice, const void *src, int srcDevice,
                      size_t bytes, const Stream *stream) {
  if (bytes == 0)
    return;
  Device &to = deviceAt(dstDevice), &from = deviceAt(srcDevice);
  Device &runner = to.isHost() ? from : to;
  if (mustQueue() && !runner.isHost() &&
      queueCopy(dst, to, src, from, bytes, stream))
    return;
  TraceScope tracing(runner.index, stream);
  if (tracing)
    traceCopy(*tracing.operator->(), dst, to, src, from, bytes);
  if (to.isHost() != from.isHost() && hostRecorder())
    throw Error(Error::Kind::Runtime,
                "cannot copy between devices while a graph is being captured "
                "on 'cpu'");
  runner.copy(dst, to, src, from, bytes, stream);
}

void warp::fillMemory(void *dst, int device, const void *pattern, size_t size,
                      size_t count, const Stream *stream) {
  if (size == 0 || count == 0)
    return;
  auto *bytes = static_cast<const char *>(pattern);
  if (mustQueue() && !isHost(device)) {
    std::vector<char> kept(bytes, bytes + size);
    if (queueFill(dst, kept, count, [=, where = laterStream(device, stream)] {
          fillMemory(dst, device, kept.data(), size, count, where());
        }))
      return;
  }
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::FillBytes, graphs::FillBytes{dst, count},
                 std::string(bytes, size));
  deviceAt(device).fill(dst, pattern, size, count, stream);
}

void warp::setMemory(void *dst, int device, int byte, size_t bytes,
                     const Stream *stream) {
  char pattern = static_cast<char>(byte);
  fillMemory(dst, device, &pattern, 1, bytes, stream);
}

void warp::clearNewMemory(void *memory, int device, size_t bytes) {
  if (bytes != 0)
    deviceAt(device).initialize(memory, nullptr, bytes, nullptr);
}

void warp::writeNewMemory(void *memory, int device, const void *contents,
                          size_t bytes) {
  if (bytes != 0)
    deviceAt(device).initialize(memory, contents, bytes, nullptr);
}

void warp::changeMemory(void *memory, int device, const void *contents,
                        size_t bytes) {
  auto *given = static_cast<const char *>(contents);
  if (mustQueue() &&
      queueCall(device, nullptr,
                [=, kept = std::vector<char>(given, given + bytes)](
                    const Stream *where) {
                  deviceAt(device).initialize(memory, kept.data(), bytes,
                                              where);
                }))
    return;
  writeNewMemory(memory, device, contents, bytes);
}
