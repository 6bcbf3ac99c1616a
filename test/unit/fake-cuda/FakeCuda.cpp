//===- FakeCuda.cpp - A CUDA driver made of host memory -------------------===//
//
// Stands in for libcuda.so.1 where there is no GPU, so that the runtime's CUDA
// paths run in every test: two devices with 64 MiB each, device memory that is
// host memory, streams that finish at once. Copies check that what they touch
// was allocated. `cuLaunchKernel` records the launch; tests read it back with
// `fakeCudaLastLaunch`.
//
//===----------------------------------------------------------------------===//

#include <algorithm>
#include "FakeGraphs.h"

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace {

constexpr int success = 0, invalidValue = 1, outOfMemory = 2, notFound = 500;
constexpr int illegalAddress = 700, notReady = 600;
constexpr size_t capacity = size_t(64) << 20;

std::mutex mutex;
std::map<uint64_t, size_t> deviceBlocks;
/// Freed, but held back by the pool until it is trimmed.
size_t inUse = 0, heldBack = 0;
thread_local void *current = nullptr;
std::string lastLaunch;
unsigned char lastParams[4096];

/// What happened to streams, one word per call: "record:2 wait:3 free:3".
std::string streamLog;
int streamCount = 0;
bool streamsBusy = false;
/// Returned by everything that touches the device, once set: a fault.
int fault = 0;
uint64_t releaseThreshold = 0;
size_t highWater = 0;
int poolAccess = 0;
bool peerAccess = false;
/// Plain and managed allocations, which do not come from the pool.
std::map<uint64_t, bool> plainBlocks;

int numberOf(void *stream) { return stream ? *static_cast<int *>(stream) : 0; }

int note(const char *call, void *stream) {
  std::lock_guard<std::mutex> lock(mutex);
  streamLog += (streamLog.empty() ? "" : " ") + std::string(call) + ":" +
               std::to_string(numberOf(stream));
  return fault;
}

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

#define EXPORT extern "C" __attribute__((visibility("default")))

/// Puts a call into a graph instead if its stream is captured.
#define RECORDED(stream, call)                                                 \
  if (fakeRecord(stream, [=] { return call; }))                                \
    return success;

EXPORT const char *fakeCudaLastLaunch() { return lastLaunch.c_str(); }
EXPORT const void *fakeCudaLastParams() { return lastParams; }
EXPORT size_t fakeCudaBytesInUse() { return inUse; }
/// Streams and events are done at once, or never.
EXPORT void fakeCudaSetBusy(bool busy) { streamsBusy = busy; }
EXPORT void fakeCudaSetFault(int result) { fault = result; }
/// The calls since the last time.
EXPORT const char *fakeCudaTakeStreamLog() {
  static std::string taken;
  std::lock_guard<std::mutex> lock(mutex);
  taken = std::exchange(streamLog, {});
  return taken.c_str();
}
EXPORT int fakeCudaNumberOf(void *stream) { return numberOf(stream); }

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
EXPORT int cuMemPoolSetAttribute(void *, int which, void *value) {
  if (which != 4)
    return invalidValue;
  std::memcpy(&releaseThreshold, value, 8);
  return success;
}
EXPORT int cuMemPoolGetAttribute(void *, int which, void *value) {
  uint64_t found = which == 4 ? releaseThreshold : which == 7 ? inUse : highWater;
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
EXPORT int cuDeviceCanAccessPeer(int *possible, int, int) {
  *possible = 1;
  return success;
}
EXPORT int cuCtxEnablePeerAccess(void *, unsigned) {
  return std::exchange(peerAccess, true) ? 704 : success;
}
EXPORT int cuCtxDisablePeerAccess(void *) {
  return std::exchange(peerAccess, false) ? success : 705;
}
EXPORT int cuCtxGetDevice(int *device) {
  *device = static_cast<int>(reinterpret_cast<uintptr_t>(current) & 0xf);
  return current ? success : 201;
}
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
EXPORT int cuCtxSynchronize() {
  fakeInvalidateCaptures();
  return fault ? fault : current ? success : 201;
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
  if (!stream || fakeIsCapturing(stream))
    fakeInvalidateCaptures();
  if (int result = note("free", stream))
    return result;
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
                                void *stream) {
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
  RECORDED(stream, cuMemsetD32Async(to, value, count, nullptr))
  return fill(to, value, count);
}
EXPORT int cuStreamCreateWithPriority(void **stream, unsigned, int) {
  *stream = new int(++streamCount);
  return success;
}
EXPORT int cuStreamDestroy_v2(void *stream) {
  delete static_cast<int *>(stream);
  return success;
}
EXPORT int cuStreamQuery(void *) { 
  return fault ? fault : streamsBusy ? notReady : success;
}
EXPORT int cuStreamGetFlags(void *, unsigned *flags) {
  *flags = 0;
  return success;
}
EXPORT int cuStreamGetPriority(void *, int *priority) {
  *priority = 0;
  return success;
}
EXPORT int cuStreamSynchronize(void *stream) {
  if (fakeIsCapturing(stream))
    fakeInvalidateCaptures();
  return fault;
}
EXPORT int cuStreamWaitEvent(void *stream, void *event, unsigned) {
  fakeWaitEvent(stream, event);
  return note("wait", stream);
}
EXPORT int cuEventCreate(void **event, unsigned) {
  *event = std::malloc(8);
  return success;
}
EXPORT int cuEventDestroy_v2(void *event) {
  std::free(event);
  return success;
}
EXPORT int cuEventRecord(void *event, void *stream) {
  fakeRecordEvent(event, stream);
  return note("record", stream);
}
EXPORT int cuEventQuery(void *) {
  return fault ? fault : streamsBusy ? notReady : success;
}
EXPORT int cuEventSynchronize(void *) { return success; }
EXPORT int cuEventElapsedTime(float *milliseconds, void *, void *) {
  *milliseconds = 1.5f;
  return success;
}
/// Linking checks the text and keeps it: the fake's machine code is PTX.
struct FakeLink {
  char *log = nullptr;
  std::string code;
};
EXPORT int cuLinkCreate_v2(unsigned count, int *options, void **values,
                           void **link) {
  auto *made = new FakeLink;
  for (unsigned i = 0; i < count; ++i)
    if (options[i] == 5)
      made->log = static_cast<char *>(values[i]);
  *link = made;
  return success;
}
EXPORT int cuLinkAddData_v2(void *link, int, void *data, size_t size,
                            const char *, unsigned, int *, void **) {
  auto *target = static_cast<FakeLink *>(link);
  target->code.assign(static_cast<char *>(data), size);
  if (target->code.find(".entry") != std::string::npos)
    return success;
  if (target->log)
    std::strcpy(target->log, "no entry in this PTX");
  return 218;
}
EXPORT int cuLinkComplete(void *link, void **code, size_t *size) {
  auto *target = static_cast<FakeLink *>(link);
  *code = target->code.data();
  *size = target->code.size();
  return success;
}
EXPORT int cuLinkDestroy(void *link) {
  delete static_cast<FakeLink *>(link);
  return success;
}
EXPORT int cuModuleLoadDataEx(void **module, const void *image, unsigned,
                              int *, void **) {
  *module = new std::string(static_cast<const char *>(image));
  return success;
}
EXPORT int cuModuleGetFunction(void **function, void *module,
                               const char *name) {
  if (static_cast<std::string *>(module)->find(name) == std::string::npos)
    return notFound;
  *function = module;
  return success;
}
EXPORT int cuFuncGetAttribute(int *value, int attribute, void *) {
  // Threads, shared, constant, local, registers, PTX, binary.
  const int values[] = {256, 1024, 0, 16, 40, 80, 90};
  if (attribute < 0 || attribute > 6)
    return invalidValue;
  *value = values[attribute];
  return success;
}
EXPORT int cuOccupancyMaxActiveBlocksPerMultiprocessor(int *blocks, void *,
                                                       int threads, size_t) {
  *blocks = 1024 / threads;
  return success;
}
EXPORT int cuOccupancyMaxPotentialBlockSize(int *blocks, int *threads, void *,
                                            size_t (*)(int), size_t,
                                            int limit) {
  *blocks = 264;
  *threads = limit ? limit : 1024;
  return success;
}
EXPORT int cuModuleUnload(void *module) {
  delete static_cast<std::string *>(module);
  return success;
}
EXPORT int cuLaunchKernel(void *function, unsigned gx, unsigned gy, unsigned gz,
                          unsigned bx, unsigned by, unsigned bz, unsigned,
                          void *stream, void **arguments, void **) {
  auto *code = static_cast<std::string *>(function);
  if (code && code->find("cudaGraphSetConditional") != std::string::npos) {
    uint64_t handle = *static_cast<uint64_t *>(arguments[0]);
    auto *value = *static_cast<const int **>(arguments[1]);
    bool negated = *static_cast<unsigned *>(arguments[2]);
    RECORDED(stream, fakeSetCondition(handle, value, negated))
    return invalidValue;
  }
  char text[128];
  std::snprintf(text, sizeof(text), "(%u, %u, %u) x (%u, %u, %u)", gx, gy, gz,
                bx, by, bz);
  std::string launch = text;
  RECORDED(stream, (lastLaunch = launch, fault))
  lastLaunch = launch;
  std::memcpy(lastParams, arguments[0], 24);
  return fault ? fault : stream && current ? success : invalidValue;
}
