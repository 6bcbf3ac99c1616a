//===- Driver.cpp - CUDA driver entry points, by dlopen -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Driver.h"

#include "Device.h"
#include "Runtime/LaunchQueue.h"
#include "Support.h"

#include <cstring>
#include <dlfcn.h>
#include <pthread.h>

using namespace warp;
using namespace warp::cuda;

namespace {

struct Loaded {
  Loaded();
  bool open(const char *library);
  bool findSymbols(void *library);

  Driver table{};
  bool usable = false;
  std::string problem;
};

} // namespace

/// In a child of a process that had started the driver.
static bool forked = false;

template <typename... Args> static Result refuse(Args...) {
  return errorNotInitialized;
}

template <typename... Args>
static void refuseCalls(Result (*&member)(Args...)) {
  member = refuse<Args...>;
}

bool cuda::isForked() { return forked; }

/// The driver does not work in a child, and calls into it may hang.
static void refuseInChild() {
  forked = true;
  Driver &table = const_cast<Driver &>(*driver());
#define WARP_REFUSE(member, symbol, parameters) refuseCalls(table.member);
  WARP_CUDA_SYMBOLS(WARP_REFUSE)
  WARP_CUDA_LATER_SYMBOLS(WARP_REFUSE)
#undef WARP_REFUSE
}

Loaded::Loaded() {
  std::string library = environment("WARP_CUDA_DRIVER");
  if (!open(library.empty() ? "libcuda.so.1" : library.c_str()))
    return;
  Result result = table.init(0);
  if (result == success)
    result = table.deviceGetCount(&table.deviceCount);
  if (result == success && table.deviceCount == 0)
    result = errorNoDevice;
  if (result != success) {
    const char *name = nullptr;
    table.getErrorName(result, &name);
    problem = std::string("the CUDA driver reports ") +
              (name ? name : "an unknown error");
    return;
  }
  table.driverGetVersion(&table.version);
  table.hasLibraries = table.libraryLoadData && table.libraryUnload &&
                       table.libraryGetKernel && table.kernelGetFunction;
  table.hasProgrammaticLaunches =
      table.version >= 12040 && table.launchKernelEx;
  usable = true;
  pthread_atfork(nullptr, nullptr, refuseInChild);
}

bool Loaded::open(const char *library) {
  // Never closed: the driver does not survive it.
  void *handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  if (!handle) {
    const char *reason = dlerror();
    problem = std::string("no CUDA driver: ") + (reason ? reason : library);
    return false;
  }
  return findSymbols(handle);
}

bool Loaded::findSymbols(void *library) {
#define WARP_FIND(member, symbol, parameters)                                  \
  table.member =                                                               \
      reinterpret_cast<Result(*) parameters>(dlsym(library, #symbol));         \
  if (!table.member) {                                                         \
    problem = "the CUDA driver is too old, it lacks '" #symbol "'";            \
    return false;                                                              \
  }
  WARP_CUDA_SYMBOLS(WARP_FIND)
#undef WARP_FIND
#define WARP_FIND(member, symbol, parameters)                                  \
  table.member =                                                               \
      reinterpret_cast<Result(*) parameters>(dlsym(library, #symbol));
  WARP_CUDA_LATER_SYMBOLS(WARP_FIND)
#undef WARP_FIND
  return true;
}

static Loaded &loaded() {
  // Never destroyed: buffers freed at exit still need it.
  static auto *once = new Loaded;
  return *once;
}

const Driver *cuda::driver() {
  static const Driver *table = loaded().usable ? &loaded().table : nullptr;
  return table;
}

const std::string &cuda::driverProblem() { return loaded().problem; }

/// The exported name of an entry of the table; other names are left alone.
static const char *symbolOf(const char *member) {
#define WARP_NAME(name, symbol, parameters)                                    \
  if (std::strcmp(member, #name) == 0)                                         \
    return #symbol;
  WARP_CUDA_SYMBOLS(WARP_NAME)
  WARP_CUDA_LATER_SYMBOLS(WARP_NAME)
#undef WARP_NAME
  return member;
}

/// Explains an error that a fault of a kernel leaves for every later call.
static std::string faultText(Result result) {
  switch (result) {
  case errorIllegalAddress:
  case 702: // launch timeout
  case 710: // assertion
  case 714: // stack error
  case 715: // illegal instruction
  case 716: // misaligned address
  case 717: // invalid address space
  case 718: // invalid program counter
  case 719: // launch failure
    break;
  default:
    return "";
  }
  Context context = nullptr;
  driver()->ctxGetCurrent(&context);
  CudaDevice *state = findCudaDevice(context);
  if (!state)
    return "";
  const char *kernel = state->lastKernel;
  std::string text = "; a kernel on '" + state->info.alias + "' faulted";
  if (kernel)
    text += ", launched last: '" + std::string(kernel) + "'";
  return text + ", and the device cannot be used until the process restarts"
                "\nhint: run with `wp.config.mode = \"debug\"` to find the "
                "access at fault";
}

void cuda::raise(Result result, const char *call) {
  if (forked)
    throw Error(Error::Kind::Runtime,
                "CUDA cannot be used in a process that was forked after its "
                "parent used CUDA\nhint: start it with the 'spawn' method of "
                "`multiprocessing`");
  const char *name = nullptr, *text = nullptr;
  driver()->getErrorName(result, &name);
  driver()->getErrorString(result, &text);
  throw Error(
      result == errorOutOfMemory ? Error::Kind::Memory : Error::Kind::Runtime,
      std::string(symbolOf(call)) +
          " failed: " + (name ? name : "error " + std::to_string(result)) +
          " (" + (text ? text : "no description") + ")" + faultText(result));
}

ContextScope::ContextScope(int device) {
  if (mustQueue())
    drainLaunches();
  Context wanted = contextOf(device);
  WARP_CUDA(ctxGetCurrent, &previous);
  if (previous == wanted)
    return;
  WARP_CUDA(ctxSetCurrent, wanted);
  // A thread that had no context keeps this one.
  changed = previous != nullptr;
}

ContextScope::~ContextScope() {
  if (changed)
    driver()->ctxSetCurrent(previous);
}
