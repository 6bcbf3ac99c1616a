//===- Kernel.h - CPU launches ----------------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CPU_KERNEL_H
#define WARP_LIB_RUNTIME_CPU_KERNEL_H

#include "Runtime/KernelImpl.h"

namespace warp {

/// Code in the memory of this process.
class CpuCode final : public DeviceCode {
public:
  explicit CpuCode(CpuEntry entry) : entry(entry) {}
  ~CpuCode() override;

  void launch(const Kernel::Plan &plan, void *params, size_t paramSize,
              const Stream *stream) const override;

  const CpuEntry entry;
};

/// Runs some indices of a launch, by the code that the variant has now.
void runOnCpu(const Kernel::Variant &variant, const void *params, int64_t begin,
              int64_t end);

} // namespace warp

#endif // WARP_LIB_RUNTIME_CPU_KERNEL_H
