//===- Memory.cpp - Allocation, contiguous copies and fills ---------------===//
//
// Host memory is aligned to a cache line; large blocks to huge pages, which
// saves most page faults. CUDA memory comes from the device's stream-ordered
// pool where there is one: allocated on the current stream, freed on the
// legacy default stream, which runs after what any of our streams was given
// before. When the pool holds back what a request needs, it is trimmed and
// the request repeated.
//
// Host work on many bytes is spread over the thread pool.
//
//===----------------------------------------------------------------------===//

#include "warp/Memory.h"

#include "DeviceState.h"
#include "Support.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <sys/mman.h>
#include <sys/sysinfo.h>

using namespace warp;
using cuda::Pointer;
using cuda::StreamHandle;

static constexpr size_t cacheLine = 64;
static constexpr size_t hugePage = size_t(2) << 20;
/// Host bytes that one thread copies or fills at a time.
static constexpr int64_t hostGrain = int64_t(512) << 10;

//===----------------------------------------------------------------------===//
// Allocation
//===----------------------------------------------------------------------===//

[[noreturn]] static void raiseOutOfMemory(int device, size_t bytes) {
  size_t free = deviceMemory(device).first;
  throw Error(Error::Kind::Memory, "out of memory on '" +
                                       deviceInfo(device).alias +
                                       "', requested " + formatBytes(bytes) +
                                       ", free " + formatBytes(free));
}

static void *allocateHost(size_t bytes) {
  // The kernel would promise more than there is and kill us later.
  struct sysinfo info;
  if (sysinfo(&info) == 0 &&
      bytes / info.mem_unit > info.totalram + info.totalswap)
    raiseOutOfMemory(cpuDevice, bytes);
  bool large = bytes >= 2 * hugePage;
  size_t align = large ? hugePage : cacheLine;
  void *memory = std::aligned_alloc(align, (bytes + align - 1) / align * align);
  if (!memory)
    raiseOutOfMemory(cpuDevice, bytes);
  if (large)
    madvise(memory, bytes, MADV_HUGEPAGE);
  return memory;
}

static void *allocatePinned(size_t bytes) {
  cuda::ContextScope scope(0);
  void *memory = nullptr;
  cuda::Result result = cuda::driver()->memHostAlloc(
      &memory, bytes, cuda::hostAllocPortable | cuda::hostAllocDeviceMap);
  if (result == cuda::errorOutOfMemory)
    raiseOutOfMemory(cpuDevice, bytes);
  cuda::check(result, "memHostAlloc");
  return memory;
}

/// The pool of a device, set up to keep freed memory for the next request.
static cuda::PoolHandle memoryPool(int device) {
  DeviceState &state = cudaDeviceState(device);
  if (!state.info.hasMemoryPool)
    return nullptr;
  std::call_once(state.poolOnce, [&] {
    cuda::DeviceHandle handle;
    WARP_CUDA(deviceGet, &handle, device);
    WARP_CUDA(deviceGetDefaultMemPool, &state.pool, handle);
    uint64_t threshold = UINT64_MAX;
    WARP_CUDA(memPoolSetAttribute, state.pool, cuda::poolReleaseThreshold,
              &threshold);
  });
  return state.pool;
}

static Pointer allocateCuda(int device, size_t bytes, bool &fromPool) {
  cuda::ContextScope scope(device);
  const cuda::Driver *driver = cuda::driver();
  cuda::PoolHandle pool = memoryPool(device);
  fromPool = pool != nullptr;
  Pointer memory = 0;
  cuda::Result result;
  for (int attempt = 0; attempt < 2; ++attempt) {
    result = fromPool ? driver->memAllocAsync(&memory, bytes,
                                              streamHandle(device, nullptr))
                      : driver->memAlloc(&memory, bytes);
    if (result != cuda::errorOutOfMemory || !fromPool)
      break;
    WARP_CUDA(ctxSynchronize);
    WARP_CUDA(memPoolTrimTo, pool, 0);
  }
  if (result == cuda::errorOutOfMemory)
    raiseOutOfMemory(device, bytes);
  cuda::check(result, fromPool ? "memAllocAsync" : "memAlloc");
  return memory;
}

Buffer::Buffer(int device, size_t size, bool pinned)
    : bytes(size), deviceIndex(device) {
  if (device != cpuDevice)
    cudaDeviceState(device);
  if (pinned && device == cpuDevice && cudaDeviceCount() > 0)
    how = How::Pinned;
  if (size == 0)
    return;
  if (device != cpuDevice) {
    bool fromPool;
    memory = reinterpret_cast<void *>(allocateCuda(device, size, fromPool));
    how = fromPool ? How::CudaPool : How::Cuda;
  } else {
    memory = pinned && how == How::Pinned ? allocatePinned(size)
                                          : allocateHost(size);
  }
}

Buffer::~Buffer() {
  if (!memory)
    return;
  const cuda::Driver *driver = cuda::driver();
  auto address = reinterpret_cast<Pointer>(memory);
  // A destructor has nobody to tell: after a fault or at exit the driver
  // refuses everything, and the next call of the user reports it.
  try {
    switch (how) {
    case How::Host:
      std::free(memory);
      return;
    case How::Pinned:
      driver->memFreeHost(memory);
      return;
    case How::Cuda:
    case How::CudaPool: {
      cuda::ContextScope scope(deviceIndex);
      if (how == How::Cuda)
        driver->memFree(address);
      else
        driver->memFreeAsync(address, nullptr);
    }
    }
  } catch (const Error &) {
  }
}

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
    cuda::ContextScope scope(here);
    WARP_CUDA(memcpyPeerAsync, dst, cuda::primaryContext(dstDevice), src,
              cuda::primaryContext(srcDevice), bytes,
              streamHandle(here, &runner));
  }
  after.record(runner);
  waitEvent(*other, after);
}

void warp::copyMemory(void *dst, int dstDevice, const void *src, int srcDevice,
                      size_t bytes, const Stream *stream) {
  if (bytes == 0)
    return;
  if (dstDevice == cpuDevice && srcDevice == cpuDevice)
    return copyHost(dst, src, bytes);
  auto to = reinterpret_cast<Pointer>(dst);
  auto from = reinterpret_cast<Pointer>(src);
  if (dstDevice != cpuDevice && srcDevice != cpuDevice &&
      dstDevice != srcDevice)
    return copyPeer(to, dstDevice, from, srcDevice, bytes, stream);
  int device = dstDevice == cpuDevice ? srcDevice : dstDevice;
  StreamHandle handle = streamHandle(device, stream);
  cuda::ContextScope scope(device);
  if (srcDevice == cpuDevice)
    return WARP_CUDA(memcpyHtoDAsync, to, src, bytes, handle);
  if (dstDevice != cpuDevice)
    return WARP_CUDA(memcpyDtoDAsync, to, from, bytes, handle);
  WARP_CUDA(memcpyDtoHAsync, dst, from, bytes, handle);
  // Into pageable memory the driver waits; what kernels reported is there.
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

static void fillCuda(Pointer dst, const char *pattern, size_t size,
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
  // The driver stages pageable memory before it returns.
  WARP_CUDA(memcpyHtoDAsync, dst, pattern, size, stream);
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
  if (device == cpuDevice) {
    if (shortestPeriod(bytes, size) == 1)
      return setMemory(dst, device, bytes[0], size * count);
    return fillHost(static_cast<char *>(dst), bytes, size, count);
  }
  StreamHandle handle = streamHandle(device, stream);
  cuda::ContextScope scope(device);
  fillCuda(reinterpret_cast<Pointer>(dst), bytes, size, count, handle);
}

void warp::setMemory(void *dst, int device, int byte, size_t bytes,
                     const Stream *stream) {
  if (bytes == 0)
    return;
  if (device == cpuDevice) {
    auto *to = static_cast<char *>(dst);
    return ThreadPool::parallelFor(0, bytes, hostGrain,
                                   [&](int64_t begin, int64_t end) {
                                     std::memset(to + begin, byte, end - begin);
                                   });
  }
  StreamHandle handle = streamHandle(device, stream);
  cuda::ContextScope scope(device);
  WARP_CUDA(memsetD8Async, reinterpret_cast<Pointer>(dst),
            static_cast<unsigned char>(byte), bytes, handle);
}
