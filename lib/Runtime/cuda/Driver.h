//===- Driver.h - CUDA driver entry points, by dlopen -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The part of the driver API that the runtime uses, declared here so that no
// CUDA toolkit is needed to build, and loaded from libcuda.so.1 so that none
// is needed to run. `WARP_CUDA_SYMBOLS` is the one list of entry points: name
// in our table, exported symbol, parameters. WARP_CUDA_DRIVER names another
// library to load instead, which is how tests put a recording stub in place.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_DRIVER_H
#define WARP_LIB_RUNTIME_CUDA_DRIVER_H

#include "warp/Error.h"

#include <cstddef>
#include <cstdint>
#include <string>

namespace warp::cuda {

using Result = int;
using DeviceHandle = int;
using Pointer = uint64_t;
using Context = struct ContextTag *;
using ModuleHandle = struct ModuleTag *;
using LinkHandle = struct LinkTag *;
using LibraryHandle = struct LibraryTag *;
using KernelHandle = struct KernelTag *;
using Function = struct FunctionTag *;
using StreamHandle = struct StreamTag *;
using EventHandle = struct EventTag *;
using PoolHandle = struct PoolTag *;

enum : Result {
  success = 0,
  errorOutOfMemory = 2,
  errorNotInitialized = 3,
  errorNoDevice = 100,
  errorInvalidContext = 201,
  errorNotReady = 600,
  errorIllegalAddress = 700,
  errorPeerAccessAlreadyEnabled = 704,
  errorPeerAccessNotEnabled = 705,
};

enum DeviceAttribute : int {
  maxSharedMemoryPerBlock = 8,
  multiprocessorCount = 16,
  l2CacheSize = 38,
  maxThreadsPerMultiprocessor = 39,
  maxRegistersPerMultiprocessor = 82,
  unifiedAddressing = 41,
  managedMemory = 83,
  computeCapabilityMajor = 75,
  computeCapabilityMinor = 76,
  hostNativeAtomics = 86,
  pageableMemoryAccess = 88,
  concurrentManagedAccess = 89,
  maxSharedMemoryPerBlockOptin = 97,
  directManagedAccessFromHost = 101,
  memoryPoolsSupported = 115,
};

enum FunctionAttribute : int {
  functionMaxThreads = 0,
  functionSharedSize = 1,
  functionConstantSize = 2,
  functionLocalSize = 3,
  functionRegisters = 4,
  functionBinaryVersion = 6,
  functionMostDynamicShared = 8,
};

enum JitOption : int {
  jitMaxRegisters = 0,
  jitErrorLogBuffer = 5,
  jitErrorLogBufferSizeBytes = 6,
  jitInputCubin = 0,
  jitInputPtx = 1,
};

enum : unsigned {
  streamDefault = 0,
  streamNonBlocking = 1,
  eventDefault = 0,
  eventDisableTiming = 2,
  eventInterprocess = 4,
  hostAllocPortable = 1,
  hostAllocDeviceMap = 2,
  memAttachGlobal = 1,
  ipcLazyPeerAccess = 1,
};

enum MemoryType : unsigned { memoryHost = 1, memoryDevice = 2 };
enum PoolAttribute : int {
  poolReleaseThreshold = 4,
  poolUsedCurrent = 7,
  poolUsedHigh = 8,
};
enum PointerAttribute : int {
  pointerMemoryType = 2,
  pointerIsManaged = 8,
  pointerIsIpcCapable = 10,
  pointerPool = 17,
};
enum AccessFlags : int { accessNone = 0, accessReadWrite = 3 };

/// CUmemLocation and CUmemAccessDesc of the driver API.
struct Location {
  int type = 1;
  int device = 0;
};
struct AccessDescription {
  Location location;
  AccessFlags flags = accessNone;
};

/// CUipcMemHandle and CUipcEventHandle.
struct RawIpcHandle {
  char bytes[64];
};

/// CUDA_MEMCPY2D of the driver API.
struct Copy2D {
  size_t srcX = 0, srcY = 0;
  MemoryType srcType = memoryDevice;
  const void *srcHost = nullptr;
  Pointer srcDevice = 0;
  void *srcArray = nullptr;
  size_t srcPitch = 0;
  size_t dstX = 0, dstY = 0;
  MemoryType dstType = memoryDevice;
  void *dstHost = nullptr;
  Pointer dstDevice = 0;
  void *dstArray = nullptr;
  size_t dstPitch = 0;
  size_t widthInBytes = 0, height = 0;
};

struct Uuid {
  char bytes[16];
};

/// CUlaunchAttribute.
struct LaunchAttribute {
  int id = 0, padding = 0;
  int value[16] = {};
};
enum : int { launchProgrammatic = 6 };

/// CUlaunchConfig.
struct LaunchConfig {
  unsigned grid[3] = {}, block[3] = {}, sharedBytes = 0;
  StreamHandle stream = nullptr;
  const LaunchAttribute *attributes = nullptr;
  unsigned attributeCount = 0;
};
static_assert(sizeof(LaunchAttribute) == 72 && sizeof(LaunchConfig) == 56);

#define WARP_CUDA_SYMBOLS(X)                                                   \
  X(init, cuInit, (unsigned))                                                  \
  X(driverGetVersion, cuDriverGetVersion, (int *))                             \
  X(getErrorName, cuGetErrorName, (Result, const char **))                     \
  X(getErrorString, cuGetErrorString, (Result, const char **))                 \
  X(deviceGetCount, cuDeviceGetCount, (int *))                                 \
  X(deviceGet, cuDeviceGet, (DeviceHandle *, int))                             \
  X(deviceGetName, cuDeviceGetName, (char *, int, DeviceHandle))               \
  X(deviceGetAttribute, cuDeviceGetAttribute, (int *, int, DeviceHandle))      \
  X(deviceGetUuid, cuDeviceGetUuid_v2, (Uuid *, DeviceHandle))                 \
  X(deviceGetPciBusId, cuDeviceGetPCIBusId, (char *, int, DeviceHandle))       \
  X(deviceTotalMem, cuDeviceTotalMem_v2, (size_t *, DeviceHandle))             \
  X(deviceGetDefaultMemPool, cuDeviceGetDefaultMemPool,                        \
    (PoolHandle *, DeviceHandle))                                              \
  X(deviceCanAccessPeer, cuDeviceCanAccessPeer,                                \
    (int *, DeviceHandle, DeviceHandle))                                       \
  X(memPoolGetAttribute, cuMemPoolGetAttribute, (PoolHandle, int, void *))     \
  X(memPoolSetAttribute, cuMemPoolSetAttribute, (PoolHandle, int, void *))     \
  X(memPoolGetAccess, cuMemPoolGetAccess, (int *, PoolHandle, Location *))     \
  X(memPoolSetAccess, cuMemPoolSetAccess,                                      \
    (PoolHandle, const AccessDescription *, size_t))                           \
  X(memPoolTrimTo, cuMemPoolTrimTo, (PoolHandle, size_t))                      \
  X(primaryCtxRetain, cuDevicePrimaryCtxRetain, (Context *, DeviceHandle))     \
  X(ctxGetCurrent, cuCtxGetCurrent, (Context *))                               \
  X(ctxSetCurrent, cuCtxSetCurrent, (Context))                                 \
  X(ctxGetDevice, cuCtxGetDevice, (DeviceHandle *))                            \
  X(ctxSynchronize, cuCtxSynchronize, ())                                      \
  X(ctxEnablePeerAccess, cuCtxEnablePeerAccess, (Context, unsigned))           \
  X(ctxDisablePeerAccess, cuCtxDisablePeerAccess, (Context))                   \
  X(memGetInfo, cuMemGetInfo_v2, (size_t *, size_t *))                         \
  X(memAlloc, cuMemAlloc_v2, (Pointer *, size_t))                              \
  X(memAllocManaged, cuMemAllocManaged, (Pointer *, size_t, unsigned))         \
  X(memFree, cuMemFree_v2, (Pointer))                                          \
  X(memAllocAsync, cuMemAllocAsync, (Pointer *, size_t, StreamHandle))         \
  X(memFreeAsync, cuMemFreeAsync, (Pointer, StreamHandle))                     \
  X(memGetAddressRange, cuMemGetAddressRange_v2,                               \
    (Pointer *, size_t *, Pointer))                                            \
  X(pointerGetAttribute, cuPointerGetAttribute, (void *, int, Pointer))        \
  X(ipcGetMemHandle, cuIpcGetMemHandle, (RawIpcHandle *, Pointer))             \
  X(ipcOpenMemHandle, cuIpcOpenMemHandle_v2,                                   \
    (Pointer *, RawIpcHandle, unsigned))                                       \
  X(ipcCloseMemHandle, cuIpcCloseMemHandle, (Pointer))                         \
  X(ipcGetEventHandle, cuIpcGetEventHandle, (RawIpcHandle *, EventHandle))     \
  X(ipcOpenEventHandle, cuIpcOpenEventHandle, (EventHandle *, RawIpcHandle))   \
  X(memHostAlloc, cuMemHostAlloc, (void **, size_t, unsigned))                 \
  X(memFreeHost, cuMemFreeHost, (void *))                                      \
  X(memHostGetDevicePointer, cuMemHostGetDevicePointer_v2,                     \
    (Pointer *, void *, unsigned))                                             \
  X(memcpyHtoDAsync, cuMemcpyHtoDAsync_v2,                                     \
    (Pointer, const void *, size_t, StreamHandle))                             \
  X(memcpyDtoHAsync, cuMemcpyDtoHAsync_v2,                                     \
    (void *, Pointer, size_t, StreamHandle))                                   \
  X(memcpyDtoDAsync, cuMemcpyDtoDAsync_v2,                                     \
    (Pointer, Pointer, size_t, StreamHandle))                                  \
  X(memcpyPeerAsync, cuMemcpyPeerAsync,                                        \
    (Pointer, Context, Pointer, Context, size_t, StreamHandle))                \
  X(memcpy2DAsync, cuMemcpy2DAsync_v2, (const Copy2D *, StreamHandle))         \
  X(memsetD8Async, cuMemsetD8Async,                                            \
    (Pointer, unsigned char, size_t, StreamHandle))                            \
  X(memsetD16Async, cuMemsetD16Async,                                          \
    (Pointer, unsigned short, size_t, StreamHandle))                           \
  X(memsetD32Async, cuMemsetD32Async,                                          \
    (Pointer, unsigned, size_t, StreamHandle))                                 \
  X(streamCreate, cuStreamCreateWithPriority, (StreamHandle *, unsigned, int)) \
  X(streamDestroy, cuStreamDestroy_v2, (StreamHandle))                         \
  X(streamQuery, cuStreamQuery, (StreamHandle))                                \
  X(streamGetFlags, cuStreamGetFlags, (StreamHandle, unsigned *))              \
  X(streamGetPriority, cuStreamGetPriority, (StreamHandle, int *))             \
  X(streamIsCapturing, cuStreamIsCapturing, (StreamHandle, int *))             \
  X(streamSynchronize, cuStreamSynchronize, (StreamHandle))                    \
  X(streamWaitEvent, cuStreamWaitEvent, (StreamHandle, EventHandle, unsigned)) \
  X(eventCreate, cuEventCreate, (EventHandle *, unsigned))                     \
  X(eventDestroy, cuEventDestroy_v2, (EventHandle))                            \
  X(eventRecord, cuEventRecord, (EventHandle, StreamHandle))                   \
  X(eventQuery, cuEventQuery, (EventHandle))                                   \
  X(eventSynchronize, cuEventSynchronize, (EventHandle))                       \
  X(eventElapsedTime, cuEventElapsedTime, (float *, EventHandle, EventHandle)) \
  X(moduleLoadDataEx, cuModuleLoadDataEx,                                      \
    (ModuleHandle *, const void *, unsigned, int *, void **))                  \
  X(linkCreate, cuLinkCreate_v2, (unsigned, int *, void **, LinkHandle *))     \
  X(linkAddData, cuLinkAddData_v2,                                             \
    (LinkHandle, int, void *, size_t, const char *, unsigned, int *, void **)) \
  X(linkComplete, cuLinkComplete, (LinkHandle, void **, size_t *))             \
  X(linkDestroy, cuLinkDestroy, (LinkHandle))                                  \
  X(moduleGetFunction, cuModuleGetFunction,                                    \
    (Function *, ModuleHandle, const char *))                                  \
  X(funcGetAttribute, cuFuncGetAttribute, (int *, int, Function))              \
  X(funcSetAttribute, cuFuncSetAttribute, (Function, int, int))                \
  X(occupancyMaxActiveBlocks, cuOccupancyMaxActiveBlocksPerMultiprocessor,     \
    (int *, Function, int, size_t))                                            \
  X(occupancyMaxPotentialBlockSize, cuOccupancyMaxPotentialBlockSize,          \
    (int *, int *, Function, size_t (*)(int), size_t, int))                    \
  X(moduleUnload, cuModuleUnload, (ModuleHandle))                              \
  X(launchKernel, cuLaunchKernel,                                              \
    (Function, unsigned, unsigned, unsigned, unsigned, unsigned, unsigned,     \
     unsigned, StreamHandle, void **, void **))

/// Entry points that drivers before CUDA 12 lack; null there.
#define WARP_CUDA_LATER_SYMBOLS(X)                                             \
  X(libraryLoadData, cuLibraryLoadData,                                        \
    (LibraryHandle *, const void *, int *, void **, unsigned, int *, void **,  \
     unsigned))                                                                \
  X(libraryUnload, cuLibraryUnload, (LibraryHandle))                           \
  X(libraryGetKernel, cuLibraryGetKernel,                                      \
    (KernelHandle *, LibraryHandle, const char *))                             \
  X(kernelGetFunction, cuKernelGetFunction, (Function *, KernelHandle))        \
  X(encodeTensorMap, cuTensorMapEncodeTiled,                                   \
    (void *, int, unsigned, void *, const uint64_t *, const uint64_t *,        \
     const uint32_t *, const uint32_t *, int, int, int, int))                  \
  X(launchKernelEx, cuLaunchKernelEx,                                          \
    (const LaunchConfig *, Function, void **, void **))

struct Driver {
#define WARP_DECLARE(member, symbol, parameters) Result(*member) parameters;
  WARP_CUDA_SYMBOLS(WARP_DECLARE)
  WARP_CUDA_LATER_SYMBOLS(WARP_DECLARE)
#undef WARP_DECLARE

  /// Devices that `init` found.
  int deviceCount = 0;
  int version = 0;
  /// True if code is loaded as libraries: by several threads at a time.
  bool hasLibraries = false;
  /// True if a kernel may start while the one before it on its stream ends, in
  /// graphs too.
  bool hasProgrammaticLaunches = false;
};

/// The driver, initialised; null when there is none or it has no device.
const Driver *driver();
/// Why `driver` is null.
const std::string &driverProblem();

/// True in a child of a process that had started the driver; every call
/// fails there.
bool isForked();

/// Throws an error that names call, driver error and its text.
[[noreturn]] void raise(Result result, const char *call);

inline void check(Result result, const char *call) {
  if (__builtin_expect(result != success, 0))
    raise(result, call);
}

/// Calls an entry of the driver's table and checks the result.
#define WARP_CUDA(member, ...)                                                 \
  ::warp::cuda::check(::warp::cuda::driver()->member(__VA_ARGS__), #member)

/// The context of a device: its primary one, retained at first use, or the one
/// that `mapContext` was given.
Context contextOf(int device);

/// Makes a device's context current; gives the caller's back at the end.
class ContextScope {
public:
  explicit ContextScope(int device);
  ~ContextScope();
  ContextScope(const ContextScope &) = delete;
  ContextScope &operator=(const ContextScope &) = delete;

private:
  Context previous = nullptr;
  bool changed = false;
};

} // namespace warp::cuda

#endif // WARP_LIB_RUNTIME_CUDA_DRIVER_H
