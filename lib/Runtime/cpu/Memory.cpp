//===- Memory.cpp - Host memory: alignment and huge pages -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Blocks are aligned to a cache line; large ones to huge pages, which saves
// most page faults.
//
//===----------------------------------------------------------------------===//

#include "Device.h"
#include "Runtime/Allocation.h"

#include <cstdlib>
#include <sys/mman.h>
#include <sys/sysinfo.h>

using namespace warp;

static constexpr size_t cacheLine = 64;
static constexpr size_t hugePage = size_t(2) << 20;

std::pair<void *, MemoryKind> CpuDevice::allocate(size_t bytes, bool,
                                                  const Stream *) {
  // The kernel would promise more than there is and kill us later.
  struct sysinfo info;
  if (sysinfo(&info) == 0 &&
      bytes / info.mem_unit > info.totalram + info.totalswap)
    raiseOutOfMemory(*this, bytes);
  bool large = bytes >= 2 * hugePage;
  size_t align = large ? hugePage : cacheLine;
  void *memory = std::aligned_alloc(align, roundUp(bytes, align));
  if (!memory)
    raiseOutOfMemory(*this, bytes);
  if (large)
    madvise(memory, bytes, MADV_HUGEPAGE);
  return {memory, MemoryKind::Host};
}

void CpuDevice::free(void *memory, size_t, MemoryKind) { std::free(memory); }

/// Memory of the host that drivers know, they know best.
static MemoryKind kindForAccelerators(const void *memory) {
  return acceleratorCount() > 0 ? acceleratorAt(0).kindOf(memory)
                                : MemoryKind::Unknown;
}

MemoryKind CpuDevice::kindOf(const void *memory) {
  if (!memory)
    return MemoryKind::Unknown;
  MemoryKind kind = kindForAccelerators(memory);
  return kind == MemoryKind::Unknown ? MemoryKind::Host : kind;
}

bool CpuDevice::canReach(Device &owner, const void *memory) {
  MemoryKind kind = owner.kindOf(memory);
  return kind == MemoryKind::Pinned || kind == MemoryKind::Managed;
}
