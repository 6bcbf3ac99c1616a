//===- Copy.cpp - Copies and fills on CUDA devices ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A strided copy of many runs is a kernel's work (CopyKernel.cpp); of few, the
// last dimension is one two-dimensional copy of the driver and the others are
// loops around it.
//
//===----------------------------------------------------------------------===//

#include "CopyKernel.h"
#include "Device.h"
#include "GraphDriver.h"
#include "GraphImpl.h"
#include "Runtime/LaunchQueue.h"

#include <algorithm>
#include <cstring>
#include <vector>

using namespace warp;
using cuda::Pointer;
using cuda::StreamHandle;

//===----------------------------------------------------------------------===//
// Copies
//===----------------------------------------------------------------------===//

static void copyPeer(Pointer dst, int dstDevice, Pointer src, int srcDevice,
                     size_t bytes, const Stream *stream) {
  // The copy runs on a stream of one side and must come after what the other
  // side's current stream was given, and before what it is given next.
  int here = stream ? stream->device() : dstDevice;
  int there = here == dstDevice ? srcDevice : dstDevice;
  std::shared_ptr<Stream> other = warp::currentStream(there);
  Event before(there), after(here);
  before.record(*other);
  std::shared_ptr<Stream> mine = warp::currentStream(here);
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

void CudaDevice::copy(void *dst, Device &to, const void *src, Device &from,
                      size_t bytes, const Stream *stream) {
  auto target = reinterpret_cast<Pointer>(dst);
  auto source = reinterpret_cast<Pointer>(src);
  if (!to.isHost() && !from.isHost() && &to != &from)
    return copyPeer(target, to.index, source, from.index, bytes, stream);
  QueuedWork work(index, stream);
  if (from.isHost())
    return WARP_CUDA(memcpyHtoDAsync, target, src, bytes, work.stream());
  if (!to.isHost())
    return WARP_CUDA(memcpyDtoDAsync, target, source, bytes, work.stream());
  WARP_CUDA(memcpyDtoHAsync, dst, source, bytes, work.stream());
  // Into pageable memory the driver waits; what kernels reported is there.
  if (!warp::isCapturing(index))
    DeviceErrorRecord::check(index);
}

static void copyRow(char *dst, const char *src, const CopyNest::Dimension &dim,
                    int64_t run, cuda::StreamHandle stream) {
  if (dim.dstStride >= run && dim.srcStride >= run) {
    cuda::Copy2D copy;
    copy.srcDevice = reinterpret_cast<Pointer>(src);
    copy.srcPitch = dim.srcStride;
    copy.dstDevice = reinterpret_cast<Pointer>(dst);
    copy.dstPitch = dim.dstStride;
    copy.widthInBytes = run;
    copy.height = dim.extent;
    return WARP_CUDA(memcpy2DAsync, &copy, stream);
  }
  // Broadcast or reversed rows are no pitch that the driver knows.
  for (int64_t i = 0; i < dim.extent; ++i)
    WARP_CUDA(memcpyDtoDAsync,
              reinterpret_cast<Pointer>(dst) + i * dim.dstStride,
              reinterpret_cast<Pointer>(src) + i * dim.srcStride, run, stream);
}

static void copyNest(const CopyNest &nest, int level, char *dst,
                     const char *src, cuda::StreamHandle stream) {
  const CopyNest::Dimension &dim = nest.dims[level];
  if (level == nest.rank - 1)
    return copyRow(dst, src, dim, nest.run, stream);
  for (int64_t i = 0; i < dim.extent; ++i)
    copyNest(nest, level + 1, dst + i * dim.dstStride, src + i * dim.srcStride,
             stream);
}

void CudaDevice::copyStrided(const CopyNest &nest, size_t,
                             const Stream *stream) {
  if (copyByKernel(nest, index, stream))
    return;
  QueuedWork work(index, stream);
  copyNest(nest, 0, nest.dst, nest.src, work.stream());
}

//===----------------------------------------------------------------------===//
// Fills
//===----------------------------------------------------------------------===//

/// A copy of host bytes that lives as long as the graph being recorded; `data`
/// itself if no stream of the device is captured.
static const void *keepBytes(int device, const void *data, size_t size) {
  if (!isCapturing(device))
    return data;
  auto copy = std::make_shared<std::vector<char>>(size);
  std::memcpy(copy->data(), data, size);
  keepForCapture(device, [copy] {});
  return copy->data();
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

void CudaDevice::fill(void *dst, const void *pattern, size_t size, size_t count,
                      const Stream *stream) {
  QueuedWork work(index, stream);
  fillCuda(reinterpret_cast<Pointer>(dst), index,
           static_cast<const char *>(pattern), size, count, work.stream());
}

void CudaDevice::fillStrided(const ArrayDescriptor &dst, const void *pattern,
                             size_t elementSize, const Stream *stream) {
  int64_t count = countElements(dst);
  Buffer buffer(index, count * elementSize, false, stream);
  fill(buffer.data(), pattern, elementSize, count, stream);
  ArrayDescriptor packed = packedLike(dst, elementSize, buffer.data());
  copyArray({&dst, index}, {&packed, index}, elementSize, stream);
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

void CudaDevice::initialize(void *dst, const void *contents, size_t bytes,
                            const Stream *stream) {
  // Nothing that waits uses the memory.
  BehindNothing exempt;
  auto to = reinterpret_cast<Pointer>(dst);
  if (!warp::isCapturing(index))
    return contents ? upload(dst, index, contents, bytes, stream)
                    : setMemory(dst, index, 0, bytes, stream);
  doOutsideGraphs(index, [&](StreamHandle stream) {
    if (contents)
      WARP_CUDA(memcpyHtoDAsync, to, contents, bytes, stream);
    else
      WARP_CUDA(memsetD8Async, to, 0, bytes, stream);
  });
}
