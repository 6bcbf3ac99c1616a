//===- FakeCuda.cpp - A CUDA driver made of host memory -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Stands in for libcuda.so.1 where there is no GPU, so that the runtime's CUDA
// paths run in every test: two devices, memory that is host memory, streams
// that finish at once. `cuLaunchKernel` records the launch; tests read it back
// with `fakeCudaLastLaunch`.
//
//===----------------------------------------------------------------------===//

#include "FakeCuda.h"
#include "FakeGraphs.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

using namespace fake;

namespace {

std::string lastLaunch;
unsigned char lastParams[4096];

/// The events of streams, one word per call: "record:2 wait:3 free:3".
std::string streamLog;
int streamCount = 0;
bool streamsBusy = false;
int programmaticLaunches = 0;
bool peerAccess = false;

int numberOf(void *stream) { return stream ? *static_cast<int *>(stream) : 0; }

} // namespace

std::mutex fake::mutex;
thread_local void *fake::current = nullptr;
int fake::fault = 0;

int fake::note(const char *call, void *stream) {
  std::lock_guard<std::mutex> lock(mutex);
  streamLog += (streamLog.empty() ? "" : " ") + std::string(call) + ":" +
               std::to_string(numberOf(stream));
  return fault;
}

static std::mutex orderMutex;
static std::string order;
void fake::noteOrder(const char *work) {
  std::lock_guard<std::mutex> lock(orderMutex);
  order += (order.empty() ? "" : " ") + std::string(work);
}
/// The work queued since the last time: "launch fill copy record wait free".
EXPORT const char *fakeCudaTakeOrder() {
  static std::string taken;
  std::lock_guard<std::mutex> lock(orderMutex);
  taken = std::exchange(order, {});
  return taken.c_str();
}

EXPORT const char *fakeCudaLastLaunch() { return lastLaunch.c_str(); }
EXPORT const void *fakeCudaLastParams() { return lastParams; }
/// Launches of kernels that may start before the one before them has ended.
EXPORT int fakeCudaProgrammaticLaunches() { return programmaticLaunches; }
/// Streams and events are done at once, or never.
EXPORT void fakeCudaSetBusy(bool busy) { streamsBusy = busy; }
EXPORT void fakeCudaSetFault(int result) { fault = result; }
/// Objects that were linked, and whether any will be.
static int linkedObjects = 0;
static bool linksObjects = true;
EXPORT int fakeCudaLinkedObjects() { return linkedObjects; }
/// Times that PTX became machine code, and the bytes of stack that linked code
/// takes.
static std::atomic<int> assemblies{0};
static int linkedStack = 16;
EXPORT int fakeCudaAssemblies() { return assemblies; }
/// Code is loaded while the gate is open, and if the driver takes any.
static std::atomic<bool> isGateOpen{true}, takesCode{true};
EXPORT void fakeCudaSetGate(bool isOpen) { isGateOpen = isOpen; }
EXPORT void fakeCudaSetTakesCode(bool takes) { takesCode = takes; }
EXPORT void fakeCudaSetLinkedStack(int bytes) { linkedStack = bytes; }
EXPORT void fakeCudaSetLinksObjects(bool links) { linksObjects = links; }
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
  // A test may have the driver updated between two processes.
  const char *given = std::getenv("FAKE_CUDA_VERSION");
  *version = given ? std::atoi(given) : 12080;
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
/// Cards have names of their own if FAKE_CUDA_CARDS is set.
EXPORT int cuDeviceGetName(char *name, int size, int device) {
  bool areOther = device != 0 && std::getenv("FAKE_CUDA_CARDS");
  std::snprintf(name, size, areOther ? "Other GPU" : "Fake GPU");
  return success;
}
EXPORT int cuDeviceGetAttribute(int *value, int attribute, int device) {
  *value = attribute == 75   ? 9
           : attribute == 76 ? 0
           : attribute == 16 ? 132
           : attribute == 41 ? 1
           : attribute == 82 ? 65536
           // As on a GPU behind PCIe.
           : attribute == 86 || attribute == 88 || attribute == 101 ? 0
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
EXPORT int cuDeviceGetDefaultMemPool(void **pool, int device) {
  *pool = reinterpret_cast<void *>(uintptr_t(0x900 + device));
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
  noteOrder("wait");
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
/// Blocks of the last launch; a launch takes a second divided by them if
/// FAKE_CUDA_FAST_BLOCKS is set.
static unsigned lastBlocks = 1;
EXPORT int cuEventRecord(void *event, void *stream) {
  noteOrder("record");
  fakeRecordEvent(event, stream);
  return note("record", stream);
}
EXPORT int cuEventQuery(void *) {
  return fault ? fault : streamsBusy ? notReady : success;
}
EXPORT int cuEventSynchronize(void *) { return success; }
EXPORT int cuEventElapsedTime(float *milliseconds, void *, void *) {
  static const bool areFast = std::getenv("FAKE_CUDA_FAST_BLOCKS") != nullptr;
  *milliseconds = areFast ? 1000.0f / lastBlocks : 1.5f;
  return success;
}
/// Writes what is wrong with PTX to the log among the options of a call.
static int checkCode(const std::string &code, unsigned count, int *options,
                     void **values) {
  if (code.find(".entry") != std::string::npos || code.rfind("\177ELF", 0) == 0)
    return success;
  for (unsigned i = 0; i < count; ++i)
    if (options[i] == 5)
      std::strcpy(static_cast<char *>(values[i]), "no entry in this PTX");
  return 218;
}
static bool isMachineCode(const std::string &code) {
  return code.rfind("\177ELF", 0) == 0;
}
/// Linking checks the text and keeps it: the fake's machine code is PTX behind
/// the first bytes of an object. Input that is machine code already adds
/// nothing.
struct FakeLink {
  unsigned count;
  int *options;
  void **values;
  std::string code;
};
EXPORT int cuLinkCreate_v2(unsigned count, int *options, void **values,
                           void **link) {
  *link = new FakeLink{count, options, values, {}};
  return success;
}
EXPORT int cuLinkAddData_v2(void *link, int type, void *data, size_t size,
                            const char *, unsigned, int *, void **) {
  auto *target = static_cast<FakeLink *>(link);
  std::string code(static_cast<char *>(data), size);
  if (type == 0) {
    ++linkedObjects;
    return isMachineCode(code) && linksObjects ? success : 209;
  }
  int result = checkCode(code, target->count, target->options, target->values);
  ++assemblies;
  target->code = "\177ELF" + std::string(code.c_str());
  return result;
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
EXPORT int cuLibraryLoadData(void **library, const void *image, int *options,
                             void **values, unsigned count, int *, void **,
                             unsigned) {
  std::string code = static_cast<const char *>(image);
  while (!isGateOpen)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  if (!takesCode)
    return 218;
  if (int result = checkCode(code, count, options, values))
    return result;
  assemblies += !isMachineCode(code);
  *library = new std::string(code);
  return success;
}
EXPORT int cuLibraryUnload(void *library) {
  delete static_cast<std::string *>(library);
  return success;
}
EXPORT int cuLibraryGetKernel(void **kernel, void *library, const char *name) {
  if (static_cast<std::string *>(library)->find(name) == std::string::npos)
    return notFound;
  *kernel = library;
  return success;
}
EXPORT int cuKernelGetFunction(void **function, void *kernel) {
  *function = kernel;
  return current ? success : 201;
}
EXPORT int cuModuleLoadDataEx(void **module, const void *image, unsigned, int *,
                              void **) {
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
EXPORT int cuFuncGetAttribute(int *value, int attribute, void *function) {
  // Threads, shared, constant, local, registers, PTX, binary.
  const int values[] = {256, 1024, 0, 16, 40, 80, 90};
  if (attribute < 0 || attribute > 6)
    return invalidValue;
  *value = values[attribute];
  if (attribute == 3 && isMachineCode(*static_cast<std::string *>(function)))
    *value = linkedStack;
  return success;
}
EXPORT int cuFuncSetAttribute(void *, int attribute, int value) {
  // Blocks may have 227 KiB.
  return attribute == 8 && value <= 227 << 10 ? success : invalidValue;
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
namespace {
/// The argument of the kernel that fills regions.
struct Fills {
  struct {
    uint64_t begin, end;
    char pattern[16];
  } regions[64];
  int firsts[64], count;

  int run() const {
    for (int i = 0; i < count; ++i)
      for (uint64_t at = regions[i].begin; at < regions[i].end; ++at)
        *reinterpret_cast<char *>(at) = regions[i].pattern[at % 16];
    return success;
  }
};
} // namespace
/// The effect of kernels in graphs, which get so many bytes of arguments.
static void (*effect)(const void *) = nullptr;
static size_t effectBytes = 0;
EXPORT void fakeCudaSetEffect(void (*call)(const void *), size_t bytes) {
  effect = call;
  effectBytes = bytes;
}
/// The launch that comes next may start before its predecessor has ended.
static thread_local bool isProgrammatic = false;
EXPORT int cuLaunchKernel(void *function, unsigned gx, unsigned gy, unsigned gz,
                          unsigned bx, unsigned by, unsigned bz, unsigned,
                          void *stream, void **arguments, void **) {
  auto *code = static_cast<std::string *>(function);
  if (code && code->find("cudaGraphSetConditional") != std::string::npos) {
    uint64_t handle = *static_cast<uint64_t *>(arguments[0]);
    auto *value = *static_cast<const int **>(arguments[1]);
    fakeSetter = function;
    bool negated = *static_cast<unsigned *>(arguments[2]);
    return fakeRecordCondition(stream, handle, value, negated) ? success
                                                               : invalidValue;
  }
  if (code && code->find("fill_regions(") != std::string::npos) {
    noteOrder("fill");
    Fills fills = *static_cast<Fills *>(arguments[0]);
    return fakeRecord(
               stream, [fills] { return fills.run(); }, function,
               isProgrammatic)
               ? success
               : fills.run();
  }
  char text[128];
  std::snprintf(text, sizeof(text), "(%u, %u, %u) x (%u, %u, %u)", gx, gy, gz,
                bx, by, bz);
  std::string launch = text;
  lastBlocks = gx * gy * gz;
  noteOrder("launch");
  auto run = [=, params = effect
                              ? std::string(static_cast<char *>(arguments[0]),
                                            effectBytes)
                              : std::string()] {
    lastLaunch = launch;
    if (effect)
      effect(params.data());
    return fault;
  };
  if (fakeRecord(stream, run, function, isProgrammatic))
    return success;
  lastLaunch = launch;
  std::memcpy(lastParams, arguments[0], 24);
  return fault ? fault : stream && current ? success : invalidValue;
}
/// CUlaunchConfig and the one attribute that is used.
struct FakeConfig {
  unsigned grid[3], block[3], sharedBytes;
  void *stream;
  const int *attributes;
  unsigned count;
};
EXPORT int cuLaunchKernelEx(const FakeConfig *config, void *function,
                            void **arguments, void **extra) {
  const unsigned *grid = config->grid, *block = config->block;
  // Id, padding, value.
  if (config->count != 1 || config->attributes[0] != 6 ||
      config->attributes[2] != 1)
    return invalidValue;
  ++programmaticLaunches;
  isProgrammatic = true;
  int result = cuLaunchKernel(function, grid[0], grid[1], grid[2], block[0],
                              block[1], block[2], config->sharedBytes,
                              config->stream, arguments, extra);
  isProgrammatic = false;
  return result;
}
