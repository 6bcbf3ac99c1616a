//===- FakeMemory.cpp - Memory of the fake driver -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Device memory is host memory, 64 MiB for all devices together. Memory that
// the pool of a device holds back counts as used until it is trimmed. An IPC
// handle is an address: the other process is this one.
//
//===----------------------------------------------------------------------===//

#include "FakeCuda.h"
#include "FakeGraphs.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <map>
#include <set>

using namespace fake;

namespace {

constexpr size_t capacity = size_t(64) << 20;

std::map<uint64_t, size_t> deviceBlocks;
/// Freed, but held back by the pool until it is trimmed.
size_t inUse = 0, heldBack = 0;
uint64_t releaseThreshold = 0;
size_t highWater = 0;
int poolAccess = 0;
/// Plain and managed allocations, which do not come from the pool.
std::map<uint64_t, bool> plainBlocks;
/// Pinned memory of the host.
std::set<uint64_t> pinnedBlocks;

bool isDevice(uint64_t address, size_t bytes) {
  auto next = deviceBlocks.upper_bound(address);
  if (next == deviceBlocks.begin())
    return false;
  auto block = std::prev(next);
  return address + bytes <= block->first + block->second;
}

int allocate(uint64_t *out, size_t bytes) {
  std::lock_guard<std::mutex> lock(mutex);
  if (!current)
    return 201;
  if (fault)
    return fault;
  if (bytes > capacity - inUse - heldBack)
    return outOfMemory;
  inUse += bytes;
  highWater = std::max(highWater, inUse);
  *out = reinterpret_cast<uint64_t>(std::aligned_alloc(256, bytes + 256));
  deviceBlocks[*out] = bytes;
  return success;
}

int release(uint64_t address, bool toPool) {
  std::lock_guard<std::mutex> lock(mutex);
  auto found = deviceBlocks.find(address);
  if (found == deviceBlocks.end())
    return invalidValue;
  inUse -= found->second;
  heldBack += toPool ? found->second : 0;
  deviceBlocks.erase(found);
  std::free(reinterpret_cast<void *>(address));
  return success;
}

template <typename T> int fill(uint64_t to, T value, size_t count) {
  std::lock_guard<std::mutex> lock(mutex);
  if (fault)
    return fault;
  if (!isDevice(to, count * sizeof(T)) || to % sizeof(T) != 0)
    return illegalAddress;
  for (size_t i = 0; i < count; ++i)
    std::memcpy(reinterpret_cast<char *>(to) + i * sizeof(T), &value,
                sizeof(T));
  return success;
}

struct Copy2D {
  size_t srcX, srcY;
  unsigned srcType;
  const void *srcHost;
  uint64_t srcDevice;
  void *srcArray;
  size_t srcPitch;
  size_t dstX, dstY;
  unsigned dstType;
  void *dstHost;
  uint64_t dstDevice;
  void *dstArray;
  size_t dstPitch, width, height;
};

} // namespace

EXPORT size_t fakeCudaBytesInUse() { return inUse; }

EXPORT int cuDeviceTotalMem_v2(size_t *bytes, int) {
  *bytes = capacity;
  return success;
}
EXPORT int cuMemPoolSetAttribute(void *, int which, void *value) {
  if (which != 4)
    return invalidValue;
  std::memcpy(&releaseThreshold, value, 8);
  return success;
}
EXPORT int cuMemPoolGetAttribute(void *, int which, void *value) {
  uint64_t found = which == 4   ? releaseThreshold
                   : which == 7 ? inUse
                                : highWater;
  std::memcpy(value, &found, 8);
  return success;
}
EXPORT int cuMemPoolSetAccess(void *, const int *description, size_t) {
  poolAccess = description[2];
  return success;
}
EXPORT int cuMemPoolGetAccess(int *flags, void *, const int *) {
  *flags = poolAccess;
  return success;
}
EXPORT int cuMemPoolTrimTo(void *, size_t) {
  heldBack = 0;
  return success;
}
EXPORT int cuMemGetInfo_v2(size_t *free, size_t *total) {
  *free = capacity - inUse - heldBack;
  *total = capacity;
  return success;
}
EXPORT int cuMemAlloc_v2(uint64_t *out, size_t bytes) {
  int result = allocate(out, bytes);
  if (result == success)
    plainBlocks[*out] = false;
  return result;
}
EXPORT int cuMemAllocManaged(uint64_t *out, size_t bytes, unsigned) {
  int result = allocate(out, bytes);
  if (result == success)
    plainBlocks[*out] = true;
  return result;
}
EXPORT int cuMemFree_v2(uint64_t address) {
  plainBlocks.erase(address);
  return release(address, false);
}
EXPORT int cuPointerGetAttribute(void *out, int which, uint64_t address) {
  std::lock_guard<std::mutex> lock(mutex);
  if (pinnedBlocks.count(address)) {
    *static_cast<unsigned *>(out) = which == 2;
    return success;
  }
  if (!isDevice(address, 1))
    return invalidValue;
  uint64_t base = std::prev(deviceBlocks.upper_bound(address))->first;
  auto plain = plainBlocks.find(base);
  switch (which) {
  case 2:
    *static_cast<unsigned *>(out) = 2;
    return success;
  case 8:
    *static_cast<unsigned *>(out) = plain != plainBlocks.end() && plain->second;
    return success;
  case 17:
    *static_cast<void **>(out) = reinterpret_cast<void *>(
        uintptr_t(plain == plainBlocks.end() ? 0x900 : 0));
    return success;
  }
  return invalidValue;
}
EXPORT int cuMemGetAddressRange_v2(uint64_t *base, size_t *size,
                                   uint64_t address) {
  std::lock_guard<std::mutex> lock(mutex);
  if (!isDevice(address, 1))
    return invalidValue;
  auto block = std::prev(deviceBlocks.upper_bound(address));
  *base = block->first;
  *size = block->second;
  return success;
}

/// A handle holds the address: the other process is this one.
struct IpcHandle {
  char bytes[64];
};
EXPORT int cuIpcGetMemHandle(IpcHandle *handle, uint64_t address) {
  std::memset(handle, 0, sizeof(*handle));
  std::memcpy(handle, &address, 8);
  return success;
}
EXPORT int cuIpcOpenMemHandle_v2(uint64_t *address, IpcHandle handle,
                                 unsigned) {
  std::memcpy(address, &handle, 8);
  return *address ? success : invalidValue;
}
EXPORT int cuIpcCloseMemHandle(uint64_t) { return success; }
EXPORT int cuIpcGetEventHandle(IpcHandle *handle, void *event) {
  std::memset(handle, 0, sizeof(*handle));
  std::memcpy(handle, &event, 8);
  return success;
}
EXPORT int cuIpcOpenEventHandle(void **event, IpcHandle) {
  *event = std::malloc(8);
  return success;
}
EXPORT int cuMemAllocAsync(uint64_t *out, size_t bytes, void *stream) {
  // The driver would make a node of it, which the runtime never wants.
  if (fakeIsCapturing(stream))
    return invalidValue;
  return stream ? allocate(out, bytes) : invalidValue;
}
EXPORT int cuMemFreeAsync(uint64_t address, void *stream) {
  noteOrder("free");
  if (!stream || fakeIsCapturing(stream))
    fakeInvalidateCaptures();
  if (int result = note("free", stream))
    return result;
  return release(address, true);
}
EXPORT int cuMemHostAlloc(void **out, size_t bytes, unsigned) {
  std::lock_guard<std::mutex> lock(mutex);
  *out = std::aligned_alloc(4096, (bytes + 4095) / 4096 * 4096);
  pinnedBlocks.insert(reinterpret_cast<uint64_t>(*out));
  return success;
}
EXPORT int cuMemFreeHost(void *memory) {
  std::lock_guard<std::mutex> lock(mutex);
  pinnedBlocks.erase(reinterpret_cast<uint64_t>(memory));
  std::free(memory);
  return success;
}
EXPORT int cuMemHostGetDevicePointer_v2(uint64_t *out, void *memory, unsigned) {
  *out = reinterpret_cast<uint64_t>(memory);
  return success;
}
EXPORT int cuMemcpyHtoDAsync_v2(uint64_t to, const void *from, size_t bytes,
                                void *stream) {
  noteOrder("upload");
  RECORDED(stream, cuMemcpyHtoDAsync_v2(to, from, bytes, nullptr))
  std::lock_guard<std::mutex> lock(mutex);
  if (fault)
    return fault;
  if (!isDevice(to, bytes))
    return illegalAddress;
  std::memcpy(reinterpret_cast<void *>(to), from, bytes);
  return success;
}
EXPORT int cuMemcpyDtoHAsync_v2(void *to, uint64_t from, size_t bytes,
                                void *stream) {
  noteOrder("download");
  RECORDED(stream, cuMemcpyDtoHAsync_v2(to, from, bytes, nullptr))
  std::lock_guard<std::mutex> lock(mutex);
  if (fault)
    return fault;
  if (!isDevice(from, bytes))
    return illegalAddress;
  std::memcpy(to, reinterpret_cast<void *>(from), bytes);
  return success;
}
EXPORT int cuMemcpyDtoDAsync_v2(uint64_t to, uint64_t from, size_t bytes,
                                void *stream) {
  noteOrder("copy");
  RECORDED(stream, cuMemcpyDtoDAsync_v2(to, from, bytes, nullptr))
  std::lock_guard<std::mutex> lock(mutex);
  if (!isDevice(from, bytes) || !isDevice(to, bytes))
    return illegalAddress;
  if (to < from + bytes && from < to + bytes)
    return invalidValue;
  std::memcpy(reinterpret_cast<void *>(to), reinterpret_cast<void *>(from),
              bytes);
  return success;
}
EXPORT int cuMemcpyPeerAsync(uint64_t to, void *toContext, uint64_t from,
                             void *fromContext, size_t bytes, void *stream) {
  if (!toContext || !fromContext || toContext == fromContext)
    return invalidValue;
  return cuMemcpyDtoDAsync_v2(to, from, bytes, stream);
}
EXPORT int cuMemcpy2DAsync_v2(const Copy2D *copy, void *stream) {
  if (copy->srcType != 2 || copy->dstType != 2 ||
      copy->srcPitch < copy->width || copy->dstPitch < copy->width)
    return invalidValue;
  for (size_t row = 0; row < copy->height; ++row)
    if (int result = cuMemcpyDtoDAsync_v2(
            copy->dstDevice + row * copy->dstPitch,
            copy->srcDevice + row * copy->srcPitch, copy->width, stream))
      return result;
  return success;
}
EXPORT int cuMemsetD8Async(uint64_t to, unsigned char value, size_t count,
                           void *stream) {
  noteOrder("fill");
  RECORDED(stream, cuMemsetD8Async(to, value, count, nullptr))
  return fill(to, value, count);
}
EXPORT int cuMemsetD16Async(uint64_t to, unsigned short value, size_t count,
                            void *stream) {
  RECORDED(stream, cuMemsetD16Async(to, value, count, nullptr))
  return fill(to, value, count);
}
EXPORT int cuMemsetD32Async(uint64_t to, unsigned value, size_t count,
                            void *stream) {
  noteOrder("fill");
  RECORDED(stream, cuMemsetD32Async(to, value, count, nullptr))
  return fill(to, value, count);
}
