//===- KernelImpl.h - Inside of a kernel ------------------------*- C++ -*-===//

#ifndef WARP_LIB_RUNTIME_KERNELIMPL_H
#define WARP_LIB_RUNTIME_KERNELIMPL_H

#include "CudaDriver.h"
#include "DeviceState.h"
#include "warp/Kernel.h"

#include <atomic>
#include <mutex>

namespace warp {

/// What tells the variants of one kernel apart.
struct VariantKey {
  int device = cpuDevice;
  int rank = 1;
  bool index32 = true;
  bool flat = false;
  bool large = false;
  int blockDim = 0;
  uint64_t contiguous = 0;

  bool operator==(const VariantKey &other) const {
    return device == other.device && rank == other.rank &&
           index32 == other.index32 && flat == other.flat && large == other.large &&
           blockDim == other.blockDim && contiguous == other.contiguous;
  }
};

struct Kernel::Variant {
  VariantKey key;
  /// Without the binary, which the loader has.
  Code code;
  CpuEntry cpu = nullptr;
  cuda::ModuleHandle module = nullptr;
  cuda::Function function = nullptr;
  std::unique_ptr<DeviceErrorRecord> record;
  /// The variant made before; the list only grows.
  Variant *next = nullptr;

  ~Variant();
};

struct Kernel::Impl {
  Module module;
  std::string name;
  KernelOptions options;
  std::vector<Param> params;
  size_t paramSize = 0;
  /// Read without a lock by launches.
  std::atomic<Variant *> variants{nullptr};
  /// Held while a variant is made.
  mutable std::mutex mutex;
  std::map<std::string, double> times;

  explicit Impl(Module module) : module(std::move(module)) {}
  Variant *find(const VariantKey &key) const;
  Variant *make(const VariantKey &key);
  Plan plan(int device, const LaunchDim &dim, void *params, int blockDim,
            bool mayMake);
  VariantKey keyFor(int device, const LaunchDim &dim, const void *params,
                    int blockDim, int64_t &items) const;
  CompileOptions compileOptions(const VariantKey &key, int arch) const;
  Code obtain(const CompileOptions &compileOptions);
};

/// Loads PTX on a device.
void loadOnCuda(Kernel::Variant &variant);
/// Unloads it; while a graph is recorded that may use it, later.
void unloadFromCuda(int device, cuda::ModuleHandle module);
void launchOnCuda(const Kernel::Variant &variant, const std::string &name,
                  void *params, const Stream *stream);
/// Whether one grid axis per dimension can express the launch.
bool fitsGrid(const int32_t *dim, int rank, int blockDim);

} // namespace warp

#endif // WARP_LIB_RUNTIME_KERNELIMPL_H
