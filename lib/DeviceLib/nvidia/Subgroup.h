//===- Subgroup.h - Subgroup intrinsics of NVIDIA's GPUs --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Included by gpu/Gpu.h, which says what each is for.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_NVIDIA_SUBGROUP_H
#define WARP_DEVICELIB_NVIDIA_SUBGROUP_H

// Lanes can search together (geometry/scalar/Team.h).
#define WARP_TEAMS

namespace gpu {

constexpr int warpSize = 32;
using Lanes = uint32_t;
constexpr Lanes allLanes = ~Lanes(0);

inline int thread() { return __nvvm_read_ptx_sreg_tid_x(); }
inline int block() { return __nvvm_read_ptx_sreg_ctaid_x(); }
inline int blockRow() { return __nvvm_read_ptx_sreg_ctaid_y(); }
inline int blocks() { return __nvvm_read_ptx_sreg_nctaid_x(); }
inline int lane() { return __nvvm_read_ptx_sreg_laneid(); }

/// Waits for all threads of the block, or of the warp.
inline void syncThreads() { __nvvm_bar_sync(0); }
inline void syncWarp() { __nvvm_bar_warp_sync(allLanes); }

/// Waits for all threads of the block; whether `condition` holds for one.
inline bool syncThreadsOr(bool condition) { return __nvvm_bar0_or(condition); }

/// The lanes for which `value` holds.
inline Lanes ballot(bool value) {
  return __nvvm_vote_ballot_sync(allLanes, value);
}
/// The lanes that are here, whichever they are.
inline Lanes activeLanes() {
  uint32_t here;
  asm volatile("activemask.b32 %0;" : "=r"(here));
  return here;
}

inline uint32_t shuffleWord(uint32_t word, int lane) {
  return __nvvm_shfl_sync_idx_i32(allLanes, word, lane, 31);
}
inline float shuffleWord(float value, int lane) {
  return __nvvm_shfl_sync_idx_f32(allLanes, value, lane, 31);
}
/// Among as many lanes, a power of two, that follow each other.
template <int lanes> inline uint32_t shuffleWithin(uint32_t word, int lane) {
  constexpr int packed = (warpSize - lanes) << 8 | 31;
  return __nvvm_shfl_sync_idx_i32(allLanes, word, lane, packed);
}
inline uint32_t shuffleWordUp(uint32_t word, int distance) {
  return __nvvm_shfl_sync_up_i32(allLanes, word, distance, 0);
}
inline float shuffleWordUp(float value, int distance) {
  return __nvvm_shfl_sync_up_f32(allLanes, value, distance, 0);
}
inline uint32_t shuffleWordXor(uint32_t word, int mask) {
  return __nvvm_shfl_sync_bfly_i32(allLanes, word, mask, 31);
}
inline float shuffleWordXor(float value, int mask) {
  return __nvvm_shfl_sync_bfly_f32(allLanes, value, mask, 31);
}

inline float minimum(float a, float b) { return __nvvm_fmin_f(a, b); }
inline float maximum(float a, float b) { return __nvvm_fmax_f(a, b); }

/// 1 / x to the last bit, infinite for what is less than the least normal
/// number.
inline float flushedReciprocal(float x) { return __nvvm_rcp_approx_ftz_f(x); }

/// Keeps what follows from being computed before, and what was computed of
/// `value` from being kept for it: registers are dearer than a shift.
template <typename T> inline void launder(T &value) {
  if constexpr (sizeof(T) == 8)
    asm volatile("" : "+l"(value));
  else
    asm volatile("" : "+r"(value));
}

/// A number that nothing writes and nobody reads again: no cache of a
/// multiprocessor keeps it.
inline int32_t loadOnce(const int32_t *at) {
  int32_t value;
  asm("ld.global.nc.L1::no_allocate.b32 %0, [%1];" : "=r"(value) : "l"(at));
  return value;
}
inline int64_t loadOnce(const int64_t *at) {
  int64_t value;
  asm("ld.global.nc.L1::no_allocate.b64 %0, [%1];" : "=l"(value) : "l"(at));
  return value;
}

} // namespace gpu

#endif // WARP_DEVICELIB_NVIDIA_SUBGROUP_H
