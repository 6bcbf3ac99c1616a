//===- Gpu.h - Subgroup intrinsics: one interface for GPUs ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Device code names no maker's builtins. A target provides, in a header of its
// own, in namespace gpu:
//
//   warpSize       lanes of a subgroup
//   Lanes          an integer with a bit for each lane; allLanes
//   thread, block, blockRow, blocks, lane
//   syncThreads, syncThreadsOr, syncWarp
//   ballot, activeLanes
//   shuffleWord, shuffleWordUp, shuffleWordXor, of uint32_t and float
//   shuffleWithin  among lanes that follow each other
//   minimum, maximum of floats; NaN loses
//   flushedReciprocal, launder, loadOnce
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GPU_GPU_H
#define WARP_DEVICELIB_GPU_GPU_H

using uint32_t = unsigned;
using uint64_t = unsigned long;
using int32_t = int;
using int64_t = long;
static_assert(sizeof(uint64_t) == 8);

// Kernels are compiled as CUDA, for the sake of a few attributes; there is no
// toolkit. A kernel names its threads per block and how many blocks a
// multiprocessor is to hold.
#ifdef __CUDA__
#pragma clang force_cuda_host_device begin
#define WARP_KERNEL(threads, blocks)                                           \
  extern "C" __attribute__((global))                                           \
  __attribute__((launch_bounds(threads, blocks)))
#define WARP_SHARED static __attribute__((device)) __attribute__((shared))
#endif

#ifdef __AMDGCN__
#include "../amd/Subgroup.h"
#else
#include "../nvidia/Subgroup.h"

namespace gpu {

/// The lanes before this one.
inline Lanes lanesBefore() { return (Lanes(1) << lane()) - 1; }

inline float loadOnce(const float *at) {
  return __builtin_bit_cast(float,
                            loadOnce(reinterpret_cast<const int32_t *>(at)));
}
inline double loadOnce(const double *at) {
  return __builtin_bit_cast(double,
                            loadOnce(reinterpret_cast<const int64_t *>(at)));
}

/// Moves a value of 32 or 64 bits by the words of it.
template <typename T, typename Move> inline T byWords(T value, Move move) {
  if constexpr (sizeof(T) == 4) {
    return move(value);
  } else {
    auto bits = __builtin_bit_cast(uint64_t, value);
    uint64_t low = move(static_cast<uint32_t>(bits));
    uint64_t high = move(static_cast<uint32_t>(bits >> 32));
    return __builtin_bit_cast(T, high << 32 | low);
  }
}

/// The value that a lane has.
template <typename T> inline T shuffle(T value, int lane) {
  return byWords(value, [&](auto word) { return shuffleWord(word, lane); });
}

/// The value that the lane `distance` before this one has; its own at the
/// start of the warp.
template <typename T> inline T shuffleUp(T value, int distance) {
  return byWords(value,
                 [&](auto word) { return shuffleWordUp(word, distance); });
}

/// The value of the lane whose number differs by the bits of `mask`.
template <typename T> inline T shuffleXor(T value, int mask) {
  return byWords(value, [&](auto word) { return shuffleWordXor(word, mask); });
}

/// The sum of the values of this lane and those before it.
template <typename T> inline T sumOfLanes(T value) {
#pragma unroll
  for (int distance = 1; distance < warpSize; distance *= 2) {
    T other = shuffleUp(value, distance);
    if (lane() >= distance)
      value += other;
  }
  return value;
}

} // namespace gpu
#endif

#endif // WARP_DEVICELIB_GPU_GPU_H
