//===- Memory.cpp - Contiguous copies and fills ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Host work on many bytes is spread over the thread pool. Work on CUDA memory
// is queued and not waited for; only copies into pageable memory are, by the
// driver, which also takes its own copy of pageable memory that it reads.
//
//===----------------------------------------------------------------------===//

#include "warp/Memory.h"

#include "cuda/Device.h"
#include "GraphImpl.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <cstring>

using namespace warp;
using cuda::Pointer;
using cuda::StreamHandle;

/// Host bytes that one thread copies or fills at a time.
static constexpr int64_t hostGrain = int64_t(512) << 10;

//===----------------------------------------------------------------------===//
// Copies
//===----------------------------------------------------------------------===//

static void copyHost(void *dst, const void *src, size_t bytes) {
  auto *to = static_cast<char *>(dst);
  auto *from = static_cast<const char *>(src);
  if (to < from + bytes && from < to + bytes) {
    std::memmove(to, from, bytes);
    return;
  }
  ThreadPool::parallelFor(0, bytes, hostGrain, [&](int64_t begin, int64_t end) {
    std::memcpy(to + begin, from + begin, end - begin);
  });
}

static void copyPeer(Pointer dst, int dstDevice, Pointer src, int srcDevice,
                     size_t bytes, const Stream *stream) {
  // The copy runs on a stream of one side and must come after what the other
  // side's current stream was given, and before what it is given next.
  int here = stream ? stream->device() : dstDevice;
  int there = here == dstDevice ? srcDevice : dstDevice;
  std::shared_ptr<Stream> other = currentStream(there);
  Event before(there), after(here);
  before.record(*other);
  std::shared_ptr<Stream> mine = currentStream(here);
  const Stream &runner = stream ? *stream : *mine;
  waitEvent(runner, before);
  {
    QueuedWork work(here, &runner);
    WARP_CUDA(memcpyPeerAsync, dst, cuda::contextOf(dstDevice), src,
              cuda::contextOf(srcDevice), bytes, work.stream());
  }
  after.record(runner);
  waitEvent(*other, after);
}

static void traceCopy(GraphTrace &trace, void *dst, int dstDevice,
                      const void *src, int srcDevice, size_t bytes) {
  if (dstDevice == srcDevice)
    return trace.add(GraphOperation::Kind::CopyBytes,
                     graphs::CopyBytes{dst, src, bytes});
  if (srcDevice == cpuDevice)
    return trace.add(GraphOperation::Kind::Upload, graphs::Upload{dst},
                     std::string(static_cast<const char *>(src), bytes));
  trace.addOther(dstDevice == cpuDevice ? "a copy to the host"
                                        : "a copy between devices");
}

void warp::copyMemory(void *dst, int dstDevice, const void *src, int srcDevice,
                      size_t bytes, const Stream *stream) {
  if (bytes == 0)
    return;
  TraceScope tracing(dstDevice == cpuDevice ? srcDevice : dstDevice, stream);
  if (tracing)
    traceCopy(*tracing.operator->(), dst, dstDevice, src, srcDevice, bytes);
  if (dstDevice == cpuDevice && srcDevice == cpuDevice) {
    if (!recordOnHost(bytes, [=] { copyHost(dst, src, bytes); }))
      copyHost(dst, src, bytes);
    return;
  }
  auto to = reinterpret_cast<Pointer>(dst);
  auto from = reinterpret_cast<Pointer>(src);
  if (dstDevice != cpuDevice && srcDevice != cpuDevice &&
      dstDevice != srcDevice)
    return copyPeer(to, dstDevice, from, srcDevice, bytes, stream);
  int device = dstDevice == cpuDevice ? srcDevice : dstDevice;
  if (dstDevice != srcDevice && hostRecorder())
    throw Error(Error::Kind::Runtime,
                "cannot copy between devices while a graph is being captured "
                "on 'cpu'");
  QueuedWork work(device, stream);
  if (srcDevice == cpuDevice)
    return WARP_CUDA(memcpyHtoDAsync, to, src, bytes, work.stream());
  if (dstDevice != cpuDevice)
    return WARP_CUDA(memcpyDtoDAsync, to, from, bytes, work.stream());
  WARP_CUDA(memcpyDtoHAsync, dst, from, bytes, work.stream());
  // Into pageable memory the driver waits; what kernels reported is there.
  if (!isCapturing(device))
    DeviceErrorRecord::check(device);
}

//===----------------------------------------------------------------------===//
// Fills
//===----------------------------------------------------------------------===//

/// Shortest prefix, of 1, 2, 4 bytes or the whole, whose repetition is the
/// pattern.
static size_t shortestPeriod(const char *pattern, size_t size) {
  for (size_t period : {1, 2, 4})
    if (size % period == 0 &&
        std::memcmp(pattern, pattern + period, size - period) == 0)
      return period;
  return size;
}

static void fillHost(char *dst, const char *pattern, size_t size,
                     size_t count) {
  // Each thread first builds a block of whole patterns, then copies it.
  size_t perBlock = std::max<size_t>(1, 4096 / size);
  std::string block;
  for (size_t i = 0; i < perBlock; ++i)
    block.append(pattern, size);
  ThreadPool::parallelFor(0, count, hostGrain / static_cast<int64_t>(size) + 1,
                          [&](int64_t begin, int64_t end) {
                            char *to = dst + begin * size;
                            for (size_t left = (end - begin) * size;
                                 left > 0;) {
                              size_t part = std::min(left, block.size());
                              std::memcpy(to, block.data(), part);
                              to += part;
                              left -= part;
                            }
                          });
}

static void fillCuda(Pointer dst, int device, const char *pattern, size_t size,
                     size_t count, StreamHandle stream) {
  size_t period = shortestPeriod(pattern, size);
  size_t bytes = size * count;
  if (period == 1)
    return WARP_CUDA(memsetD8Async, dst, pattern[0], bytes, stream);
  if (period == 2 && dst % 2 == 0) {
    uint16_t value;
    std::memcpy(&value, pattern, 2);
    return WARP_CUDA(memsetD16Async, dst, value, bytes / 2, stream);
  }
  if (period == 4 && dst % 4 == 0) {
    uint32_t value;
    std::memcpy(&value, pattern, 4);
    return WARP_CUDA(memsetD32Async, dst, value, bytes / 4, stream);
  }
  // The driver stages pageable memory before it returns, unless the copy goes
  // into a graph.
  WARP_CUDA(memcpyHtoDAsync, dst, keepBytes(device, pattern, size), size,
            stream);
  for (size_t done = size; done < bytes;) {
    size_t part = std::min(done, bytes - done);
    WARP_CUDA(memcpyDtoDAsync, dst + done, dst, part, stream);
    done += part;
  }
}

void warp::fillMemory(void *dst, int device, const void *pattern, size_t size,
                      size_t count, const Stream *stream) {
  if (size == 0 || count == 0)
    return;
  auto *bytes = static_cast<const char *>(pattern);
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::FillBytes, graphs::FillBytes{dst, count},
                 std::string(bytes, size));
  if (device == cpuDevice) {
    if (shortestPeriod(bytes, size) == 1)
      return setMemory(dst, device, bytes[0], size * count);
    auto *to = static_cast<char *>(dst);
    std::string own(bytes, size);
    if (!recordOnHost(size * count,
                      [=] { fillHost(to, own.data(), size, count); }))
      fillHost(to, bytes, size, count);
    return;
  }
  QueuedWork work(device, stream);
  fillCuda(reinterpret_cast<Pointer>(dst), device, bytes, size, count,
           work.stream());
}

static void setHost(void *dst, int byte, size_t bytes) {
  auto *to = static_cast<char *>(dst);
  ThreadPool::parallelFor(0, bytes, hostGrain, [&](int64_t begin, int64_t end) {
    std::memset(to + begin, byte, end - begin);
  });
}

void warp::setMemory(void *dst, int device, int byte, size_t bytes,
                     const Stream *stream) {
  if (bytes == 0)
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::FillBytes, graphs::FillBytes{dst, bytes},
                 std::string(1, static_cast<char>(byte)));
  if (device == cpuDevice) {
    if (!recordOnHost(bytes, [=] { setHost(dst, byte, bytes); }))
      setHost(dst, byte, bytes);
    return;
  }
  QueuedWork work(device, stream);
  WARP_CUDA(memsetD8Async, reinterpret_cast<Pointer>(dst),
            static_cast<unsigned char>(byte), bytes, work.stream());
}

/// Queues work and waits for it, although graphs may be being captured.
template <typename Queue> static void doOutsideGraphs(int device, Queue queue) {
  cuda::RelaxedCaptures relaxed;
  cuda::ContextScope scope(device);
  Stream outside(device);
  auto handle = static_cast<StreamHandle>(outside.handle());
  queue(handle);
  WARP_CUDA(streamSynchronize, handle);
}

void warp::clearNewMemory(void *memory, int device, size_t bytes) {
  if (bytes == 0)
    return;
  if (device == cpuDevice)
    return setHost(memory, 0, bytes);
  if (!isCapturing(device))
    return setMemory(memory, device, 0, bytes);
  doOutsideGraphs(device, [&](StreamHandle stream) {
    WARP_CUDA(memsetD8Async, reinterpret_cast<Pointer>(memory), 0, bytes,
              stream);
  });
}

void warp::writeNewMemory(void *memory, int device, const void *contents,
                          size_t bytes) {
  if (bytes == 0)
    return;
  if (device == cpuDevice)
    return copyHost(memory, contents, bytes);
  if (!isCapturing(device))
    return copyMemory(memory, device, contents, cpuDevice, bytes);
  doOutsideGraphs(device, [&](StreamHandle stream) {
    WARP_CUDA(memcpyHtoDAsync, reinterpret_cast<Pointer>(memory), contents,
              bytes, stream);
  });
}
