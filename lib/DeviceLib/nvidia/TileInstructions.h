//===- TileInstructions.h - Subgroup instructions of tiles ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In the assembler's words: the optimiser knows nothing of them, and leaves the
// loops around them as they are written. Functions for tiles are written for
// that; elsewhere nvidia/Subgroup.h has the same as builtins.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_NVIDIA_TILEINSTRUCTIONS_H
#define WARP_DEVICELIB_NVIDIA_TILEINSTRUCTIONS_H

#define WARP_INLINE __attribute__((always_inline)) inline

namespace {

constexpr int warpSize = 32;

WARP_INLINE int threadNumber() {
  int number;
  asm("mov.u32 %0, %%tid.x;" : "=r"(number));
  return number;
}

/// Waits for all threads of the block, or of the warp.
WARP_INLINE void syncThreads() { asm volatile("bar.sync 0;" ::: "memory"); }
WARP_INLINE void syncWarp() { asm volatile("bar.warp.sync -1;" ::: "memory"); }

/// The value that a lane has.
WARP_INLINE float shuffle(float value, int lane) {
  float result;
  asm volatile("shfl.sync.idx.b32 %0, %1, %2, 31, -1;"
               : "=f"(result)
               : "f"(value), "r"(lane));
  return result;
}
WARP_INLINE double shuffle(double value, int lane) {
  float halves[2];
  __builtin_memcpy(halves, &value, sizeof value);
  halves[0] = shuffle(halves[0], lane);
  halves[1] = shuffle(halves[1], lane);
  __builtin_memcpy(&value, halves, sizeof value);
  return value;
}
/// The value of the lane whose number differs by the bits of `mask`.
WARP_INLINE float shuffleXor(float value, int mask) {
  float other;
  asm volatile("shfl.sync.bfly.b32 %0, %1, %2, 31, -1;"
               : "=f"(other)
               : "f"(value), "r"(mask));
  return other;
}

// From compute capability 8.0 on.
WARP_INLINE int leastOfLanes(int value) {
  int found;
  asm volatile("redux.sync.min.s32 %0, %1, -1;" : "=r"(found) : "r"(value));
  return found;
}
WARP_INLINE int greatestOfLanes(int value) {
  int found;
  asm volatile("redux.sync.max.s32 %0, %1, -1;" : "=r"(found) : "r"(value));
  return found;
}

/// 1 / x to the last bit; flushed, infinite for what is less than the least
/// normal number.
WARP_INLINE float reciprocal(float x) {
  float result;
  asm("rcp.approx.f32 %0, %1;" : "=f"(result) : "f"(x));
  return result;
}
WARP_INLINE float flushedReciprocal(float x) {
  float result;
  asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x));
  return result;
}
WARP_INLINE float flushedReciprocalRoot(float x) {
  float result;
  asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(x));
  return result;
}

/// Keeps loads that follow behind the computation of these: registers are few.
WARP_INLINE void launderEight(float *x) {
  asm volatile(""
               : "+f"(x[0]), "+f"(x[1]), "+f"(x[2]), "+f"(x[3]), "+f"(x[4]),
                 "+f"(x[5]), "+f"(x[6]), "+f"(x[7]));
}

} // namespace

#endif // WARP_DEVICELIB_NVIDIA_TILEINSTRUCTIONS_H
