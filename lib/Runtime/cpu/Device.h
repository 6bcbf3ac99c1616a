//===- Device.h - The CPU as a device ---------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CPU_DEVICE_H
#define WARP_LIB_RUNTIME_CPU_DEVICE_H

#include "Runtime/Device.h"

namespace warp {

class CpuDevice final : public Device {
public:
  CpuDevice();

  void synchronize() override {}
  void synchronizeBusyStreams() override {}

  std::pair<size_t, size_t> memoryUse() override;
  std::pair<void *, MemoryKind> allocate(size_t bytes, bool pinned,
                                         const Stream *stream) override;
  void free(void *memory, size_t bytes, MemoryKind kind) override;
  MemoryKind kindOf(const void *memory) override;
  bool canReach(Device &owner, const void *memory) override;

  void copy(void *dst, Device &to, const void *src, Device &from, size_t bytes,
            const Stream *stream) override;
  void copyStrided(const CopyNest &nest, size_t bytes,
                   const Stream *stream) override;
  void fill(void *dst, const void *pattern, size_t size, size_t count,
            const Stream *stream) override;
  void fillStrided(const ArrayDescriptor &dst, const void *pattern,
                   size_t elementSize, const Stream *stream) override;
  void initialize(void *dst, const void *contents, size_t bytes,
                  const Stream *stream) override;

  std::unique_ptr<DeviceCode> load(const Kernel::Variant &variant,
                                   Code &code) override;

  std::unique_ptr<CaptureBase> beginCapture(std::shared_ptr<Stream> stream,
                                            CaptureMode mode,
                                            bool external) override;

  void scan(NumberType kind, int width, Sequence out, Sequence in,
            int64_t count, bool inclusive, const Stream *stream) override;
  bool sort(const Pairs &pairs, int beginBit, int endBit,
            const Stream *stream) override;
  void sortSegments(const Pairs &pairs, const int32_t *begins,
                    const int32_t *ends, int64_t segments,
                    const Stream *stream) override;
  void findRuns(const Runs &runs, const Stream *stream) override;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_CPU_DEVICE_H
