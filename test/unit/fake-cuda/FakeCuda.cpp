//===- FakeCuda.cpp - A CUDA driver made of host memory -------------------===//
//
// Stands in for libcuda.so.1 where there is no GPU, so that the runtime's CUDA
// paths run in every test: two devices with 64 MiB each, device memory that is
// host memory, streams that finish at once. Copies check that what they touch
// was allocated. `cuLaunchKernel` records the launch; tests read it back with
// `fakeCudaLastLaunch`.
//
//===----------------------------------------------------------------------===//

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <string>

namespace {

constexpr int success = 0, invalidValue = 1, outOfMemory = 2, notFound = 500;
constexpr int illegalAddress = 700;
constexpr size_t capacity = size_t(64) << 20;

std::mutex mutex;
std::map<uint64_t, size_t> deviceBlocks;
/// Freed, but held back by the pool until it is trimmed.
size_t inUse = 0, heldBack = 0;
thread_local void *current = nullptr;
std::string lastLaunch;
unsigned char lastParams[4096];

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
  if (bytes > capacity - inUse - heldBack)
    return outOfMemory;
  inUse += bytes;
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

#define EXPORT extern "C" __attribute__((visibility("default")))

EXPORT const char *fakeCudaLastLaunch() { return lastLaunch.c_str(); }
EXPORT const void *fakeCudaLastParams() { return lastParams; }
EXPORT size_t fakeCudaBytesInUse() { return inUse; }

EXPORT int cuInit(unsigned) { return success; }
EXPORT int cuDriverGetVersion(int *version) {
  *version = 12080;
  return success;
}
EXPORT int cuGetErrorName(int result, const char **name) {
  *name = result == outOfMemory      ? "CUDA_ERROR_OUT_OF_MEMORY"
          : result == illegalAddress ? "CUDA_ERROR_ILLEGAL_ADDRESS"
                                     : "CUDA_ERROR_UNKNOWN";
  return success;
}
EXPORT int cuGetErrorString(int, const char **text) {
  *text = "as the fake driver says";
  return success;
}
EXPORT int cuDeviceGetCount(int *count) {
  *count = 2;
  return success;
}
EXPORT int cuDeviceGet(int *device, int ordinal) {
  *device = ordinal;
  return success;
}
EXPORT int cuDeviceGetName(char *name, int size, int) {
  std::snprintf(name, size, "Fake GPU");
  return success;
}
EXPORT int cuDeviceGetAttribute(int *value, int attribute, int device) {
  *value = attribute == 75   ? 9
           : attribute == 76 ? 0
           : attribute == 16 ? 132
           : attribute == 41 ? 1
           // Only the first device has memory pools.
           : attribute == 115 ? device == 0
                              : 1024;
  return success;
}
EXPORT int cuDeviceGetUuid_v2(char *uuid, int device) {
  std::memset(uuid, 0x10 + device, 16);
  return success;
}
EXPORT int cuDeviceGetPCIBusId(char *id, int size, int device) {
  std::snprintf(id, size, "0000:0%d:00.0", device);
  return success;
}
EXPORT int cuDeviceTotalMem_v2(size_t *bytes, int) {
  *bytes = capacity;
  return success;
}
EXPORT int cuDeviceGetDefaultMemPool(void **pool, int device) {
  *pool = reinterpret_cast<void *>(uintptr_t(0x900 + device));
  return success;
}
EXPORT int cuMemPoolSetAttribute(void *, int, void *) { return success; }
EXPORT int cuMemPoolTrimTo(void *, size_t) {
  heldBack = 0;
  return success;
}
EXPORT int cuDevicePrimaryCtxRetain(void **context, int device) {
  *context = reinterpret_cast<void *>(uintptr_t(0x100 + device));
  return success;
}
EXPORT int cuCtxGetCurrent(void **context) {
  *context = current;
  return success;
}
EXPORT int cuCtxSetCurrent(void *context) {
  current = context;
  return success;
}
EXPORT int cuCtxSynchronize() { return current ? success : 201; }
EXPORT int cuMemGetInfo_v2(size_t *free, size_t *total) {
  *free = capacity - inUse - heldBack;
  *total = capacity;
  return success;
}
EXPORT int cuMemAlloc_v2(uint64_t *out, size_t bytes) {
  return allocate(out, bytes);
}
EXPORT int cuMemFree_v2(uint64_t address) { return release(address, false); }
EXPORT int cuMemAllocAsync(uint64_t *out, size_t bytes, void *stream) {
  return stream ? allocate(out, bytes) : invalidValue;
}
EXPORT int cuMemFreeAsync(uint64_t address, void *) {
  return release(address, true);
}
EXPORT int cuMemHostAlloc(void **out, size_t bytes, unsigned) {
  *out = std::aligned_alloc(4096, (bytes + 4095) / 4096 * 4096);
  return success;
}
EXPORT int cuMemFreeHost(void *memory) {
  std::free(memory);
  return success;
}
EXPORT int cuMemHostGetDevicePointer_v2(uint64_t *out, void *memory, unsigned) {
  *out = reinterpret_cast<uint64_t>(memory);
  return success;
}
EXPORT int cuMemcpyHtoDAsync_v2(uint64_t to, const void *from, size_t bytes,
                                void *) {
  std::lock_guard<std::mutex> lock(mutex);
  if (!isDevice(to, bytes))
    return illegalAddress;
  std::memcpy(reinterpret_cast<void *>(to), from, bytes);
  return success;
}
EXPORT int cuMemcpyDtoHAsync_v2(void *to, uint64_t from, size_t bytes, void *) {
  std::lock_guard<std::mutex> lock(mutex);
  if (!isDevice(from, bytes))
    return illegalAddress;
  std::memcpy(to, reinterpret_cast<void *>(from), bytes);
  return success;
}
EXPORT int cuMemcpyDtoDAsync_v2(uint64_t to, uint64_t from, size_t bytes,
                                void *) {
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
                           void *) {
  return fill(to, value, count);
}
EXPORT int cuMemsetD16Async(uint64_t to, unsigned short value, size_t count,
                            void *) {
  return fill(to, value, count);
}
EXPORT int cuMemsetD32Async(uint64_t to, unsigned value, size_t count, void *) {
  return fill(to, value, count);
}
EXPORT int cuStreamCreateWithPriority(void **stream, unsigned, int) {
  *stream = std::malloc(8);
  return success;
}
EXPORT int cuStreamDestroy_v2(void *stream) {
  std::free(stream);
  return success;
}
EXPORT int cuStreamQuery(void *) { return success; }
EXPORT int cuStreamSynchronize(void *) { return success; }
EXPORT int cuStreamWaitEvent(void *, void *, unsigned) { return success; }
EXPORT int cuEventCreate(void **event, unsigned) {
  *event = std::malloc(8);
  return success;
}
EXPORT int cuEventDestroy_v2(void *event) {
  std::free(event);
  return success;
}
EXPORT int cuEventRecord(void *, void *) { return success; }
EXPORT int cuEventQuery(void *) { return success; }
EXPORT int cuEventSynchronize(void *) { return success; }
EXPORT int cuEventElapsedTime(float *milliseconds, void *, void *) {
  *milliseconds = 1.5f;
  return success;
}
EXPORT int cuModuleLoadDataEx(void **module, const void *image, unsigned count,
                              int *options, void **values) {
  auto *text = static_cast<const char *>(image);
  if (!std::strstr(text, ".entry")) {
    for (unsigned i = 0; i < count; ++i)
      if (options[i] == 5)
        std::strcpy(static_cast<char *>(values[i]), "no entry in this PTX");
    return 218;
  }
  *module = new std::string(text);
  return success;
}
EXPORT int cuModuleGetFunction(void **function, void *module,
                               const char *name) {
  if (static_cast<std::string *>(module)->find(name) == std::string::npos)
    return notFound;
  *function = module;
  return success;
}
EXPORT int cuModuleUnload(void *module) {
  delete static_cast<std::string *>(module);
  return success;
}
EXPORT int cuLaunchKernel(void *, unsigned gx, unsigned gy, unsigned gz,
                          unsigned bx, unsigned by, unsigned bz, unsigned,
                          void *stream, void **arguments, void **) {
  char text[128];
  std::snprintf(text, sizeof(text), "(%u, %u, %u) x (%u, %u, %u)", gx, gy, gz,
                bx, by, bz);
  lastLaunch = text;
  std::memcpy(lastParams, arguments[0], 24);
  return stream && current ? success : invalidValue;
}
