//===- TileInstructions.h - Block instructions of tiles ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Instructions of functions that do not depend on the lanes of a subgroup.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_AMD_TILEINSTRUCTIONS_H
#define WARP_DEVICELIB_AMD_TILEINSTRUCTIONS_H

#define WARP_INLINE __attribute__((always_inline)) inline

namespace {

WARP_INLINE int threadNumber() { return __builtin_amdgcn_workitem_id_x(); }

/// Waits for all threads of the block.
WARP_INLINE void syncThreads() {
  __builtin_amdgcn_fence(__ATOMIC_RELEASE, "workgroup");
  __builtin_amdgcn_s_barrier();
  __builtin_amdgcn_fence(__ATOMIC_ACQUIRE, "workgroup");
}

} // namespace

#endif // WARP_DEVICELIB_AMD_TILEINSTRUCTIONS_H
