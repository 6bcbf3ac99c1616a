//===- CudaDriver.cpp - The CUDA driver, found at run time ----------------===//

#include "CudaDriver.h"

#include "Support.h"

#include <dlfcn.h>
#include <mutex>
#include <vector>

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

struct ContextSlot {
  std::once_flag once;
  Context context = nullptr;
};

} // namespace

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
  usable = true;
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
  return true;
}

static const Loaded &loaded() {
  // Never destroyed: buffers freed at exit still need it.
  static const Loaded *once = new Loaded;
  return *once;
}

const Driver *cuda::driver() {
  static const Driver *table = loaded().usable ? &loaded().table : nullptr;
  return table;
}

const std::string &cuda::driverProblem() { return loaded().problem; }

static const char *symbolOf(const std::string &member) {
#define WARP_NAME(name, symbol, parameters)                                    \
  if (member == #name)                                                         \
    return #symbol;
  WARP_CUDA_SYMBOLS(WARP_NAME)
#undef WARP_NAME
  return "the driver";
}

void cuda::raise(Result result, const char *call) {
  const char *name = nullptr, *text = nullptr;
  driver()->getErrorName(result, &name);
  driver()->getErrorString(result, &text);
  throw Error(
      result == errorOutOfMemory ? Error::Kind::Memory : Error::Kind::Runtime,
      std::string(symbolOf(call)) +
          " failed: " + (name ? name : "error " + std::to_string(result)) +
          " (" + (text ? text : "no description") + ")");
}

Context cuda::primaryContext(int device) {
  static auto *slots = new std::vector<ContextSlot>(driver()->deviceCount);
  ContextSlot &slot = (*slots)[device];
  std::call_once(slot.once, [&] {
    DeviceHandle handle;
    WARP_CUDA(deviceGet, &handle, device);
    WARP_CUDA(primaryCtxRetain, &slot.context, handle);
  });
  return slot.context;
}

ContextScope::ContextScope(int device) {
  Context wanted = primaryContext(device);
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
