//===- Gpu.h - What kernels in C++ use of a GPU -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Names for the compiler's builtins, and no more: there is no CUDA toolkit.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CUDA_GPU_H
#define WARP_DEVICELIB_CUDA_GPU_H

using uint32_t = unsigned;
using uint64_t = unsigned long;
using int32_t = int;
using int64_t = long;
static_assert(sizeof(uint64_t) == 8);

// Everything here is device code. A kernel names its threads per block and how
// many blocks a multiprocessor is to hold.
#pragma clang force_cuda_host_device begin
#define WARP_KERNEL(threads, blocks)                                           \
  extern "C" __attribute__((global))                                           \
  __attribute__((launch_bounds(threads, blocks)))
#define WARP_SHARED static __attribute__((device)) __attribute__((shared))

namespace gpu {

constexpr int warpSize = 32;

inline int thread() { return __nvvm_read_ptx_sreg_tid_x(); }
inline int block() { return __nvvm_read_ptx_sreg_ctaid_x(); }
inline int blockRow() { return __nvvm_read_ptx_sreg_ctaid_y(); }
inline int blocks() { return __nvvm_read_ptx_sreg_nctaid_x(); }
inline int lane() { return __nvvm_read_ptx_sreg_laneid(); }
/// The lanes before this one.
inline uint32_t lanesBefore() { return (1u << lane()) - 1; }

/// Waits for all threads of the block, or of the warp.
inline void meet() { __nvvm_bar_sync(0); }
inline void meetWarp() { __nvvm_bar_warp_sync(~0u); }

/// Waits for all threads of the block; whether `condition` holds for one.
inline bool meetAny(bool condition) { return __nvvm_bar0_or(condition); }

/// Keeps what follows from being computed before, and what was computed of
/// `value` from being kept for it: registers are dearer than a shift.
template <typename T> inline void forget(T &value) {
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
inline float loadOnce(const float *at) {
  return __builtin_bit_cast(float,
                            loadOnce(reinterpret_cast<const int32_t *>(at)));
}
inline double loadOnce(const double *at) {
  int64_t value;
  asm("ld.global.nc.L1::no_allocate.b64 %0, [%1];" : "=l"(value) : "l"(at));
  return __builtin_bit_cast(double, value);
}

/// The lanes for which `value` holds.
inline uint32_t ballot(bool value) {
  return __nvvm_vote_ballot_sync(~0u, value);
}

/// What `shuffle` gives of the halves of a value of 64 bits.
template <typename T, typename Shuffle>
inline T byHalves(T value, Shuffle shuffle) {
  auto bits = __builtin_bit_cast(uint64_t, value);
  uint64_t low = shuffle(static_cast<uint32_t>(bits));
  uint64_t high = shuffle(static_cast<uint32_t>(bits >> 32));
  return __builtin_bit_cast(T, high << 32 | low);
}

/// The value that the lane `distance` before this one has; its own at the
/// start of the warp.
inline uint32_t fromBefore(uint32_t value, int distance) {
  return __nvvm_shfl_sync_up_i32(~0u, value, distance, 0);
}
inline int32_t fromBefore(int32_t value, int distance) {
  return __nvvm_shfl_sync_up_i32(~0u, value, distance, 0);
}
inline float fromBefore(float value, int distance) {
  return __nvvm_shfl_sync_up_f32(~0u, value, distance, 0);
}
inline uint64_t fromBefore(uint64_t value, int distance) {
  return byHalves(value,
                  [&](uint32_t half) { return fromBefore(half, distance); });
}
inline double fromBefore(double value, int distance) {
  return byHalves(value,
                  [&](uint32_t half) { return fromBefore(half, distance); });
}

/// The value that a lane has.
inline uint32_t fromLane(uint32_t value, int lane) {
  return __nvvm_shfl_sync_idx_i32(~0u, value, lane, 31);
}
inline float fromLane(float value, int lane) {
  return __nvvm_shfl_sync_idx_f32(~0u, value, lane, 31);
}
inline uint64_t fromLane(uint64_t value, int lane) {
  return byHalves(value, [&](uint32_t half) { return fromLane(half, lane); });
}
inline double fromLane(double value, int lane) {
  return byHalves(value, [&](uint32_t half) { return fromLane(half, lane); });
}

/// The value of the lane whose number differs by the bits of `mask`.
inline uint32_t fromAcross(uint32_t value, int mask) {
  return __nvvm_shfl_sync_bfly_i32(~0u, value, mask, 31);
}
inline uint64_t fromAcross(uint64_t value, int mask) {
  return byHalves(value, [&](uint32_t half) { return fromAcross(half, mask); });
}
inline double fromAcross(double value, int mask) {
  return byHalves(value, [&](uint32_t half) { return fromAcross(half, mask); });
}
inline float fromAcross(float value, int mask) {
  return __nvvm_shfl_sync_bfly_f32(~0u, value, mask, 31);
}

/// The sum of the values of this lane and those before it.
template <typename T> inline T sumOfLanes(T value) {
#pragma unroll
  for (int distance = 1; distance < warpSize; distance *= 2) {
    T other = fromBefore(value, distance);
    if (lane() >= distance)
      value += other;
  }
  return value;
}

} // namespace gpu

#endif // WARP_DEVICELIB_CUDA_GPU_H
