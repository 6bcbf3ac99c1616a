//===- Kernel.h - CUDA kernels: load, launch --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_KERNEL_H
#define WARP_LIB_RUNTIME_CUDA_KERNEL_H

#include "Code.h"
#include "Device.h"
#include "Runtime/KernelImpl.h"

namespace warp {

/// Code that a CUDA device has, and what launches need to know of it.
class CudaEntry final : public DeviceCode {
public:
  explicit CudaEntry(CudaDevice &owner) : owner(owner) {}
  ~CudaEntry() override;

  void launch(const Kernel::Plan &plan, void *params, size_t paramSize,
              const Stream *stream) const override;
  int maxThreads() const override;
  std::pair<int, int> threadResources() const override;
  std::unique_ptr<LaunchTimer> makeTimer() const override;
  bool isProvisional() const override { return provisional; }
  void describe(const VariantKey &key,
                std::vector<Choice> &choices) const override;

  CudaDevice &owner;
  CudaCode loaded;
  cuda::Function function = nullptr;
  /// True if it may start before the kernel before it on its stream has ended.
  bool programmatic = false;
  /// Machine code from the driver's linker that is worse than what the driver
  /// makes of the whole program.
  bool provisional = false;
  /// Blocks of the variant's size that a multiprocessor runs at a time, and
  /// blocks of half as many threads; 0 where the code is for one size of
  /// blocks.
  int residentBlocks = 0, residentHalves = 0;
  /// True if threads keep a stack in memory: some search longer than others,
  /// and a block's room is free when its last thread has ended.
  bool keepsStack = false;
  /// The record of the code's checks; null if it has none.
  std::unique_ptr<DeviceErrorRecord> record;

private:
  /// Launches this code, whatever trials say.
  void launchOnce(const Kernel::Plan &plan, void *params, size_t paramSize,
                  const Stream *stream) const;
  /// Writes the extents of merged blocks into the header.
  void queueLaunch(const Kernel::Plan &plan, void *params,
                   const Stream *stream) const;
};

/// The driver's function of code that a CUDA device has.
inline cuda::Function functionOf(const DeviceCode &code) {
  return static_cast<const CudaEntry &>(code).function;
}

/// True if the code of a launch waits for the kernel before it in its first
/// instruction, so that it may be started before that has ended.
bool waitsFirst(const Kernel::Plan &plan);

/// Threads of a block for so many in all: half of the variant's if that keeps
/// more of the card at work.
int chooseBlock(const CudaEntry &entry, int blockDim, int64_t threads,
                int smCount);

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_KERNEL_H
