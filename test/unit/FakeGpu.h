//===- FakeGpu.h - Kernels of a GPU on the host -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Takes the place of lib/DeviceLib/gpu/Gpu.h: the threads of a block are
// contexts that alternate and wait for each other where the kernel says so,
// the blocks run one after the other.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GPU_GPU_H
#define WARP_DEVICELIB_GPU_GPU_H

#include <ucontext.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#define WARP_KERNEL(threads, blocks) static
#define WARP_SHARED static

namespace gpu {

constexpr int warpSize = 32;

inline float minimum(float a, float b) { return std::fmin(a, b); }
inline float maximum(float a, float b) { return std::fmax(a, b); }

/// Threads that wait for each other.
struct Barrier {
  int members = 0, arrived = 0, round = 0;
};

struct FakeThread {
  ucontext_t context;
  std::unique_ptr<char[]> stack;
  uint32_t given = 0;
  bool isDone = false;
};

struct FakeBlock {
  std::vector<FakeThread> threads;
  std::vector<Barrier> warps;
  Barrier all;
  ucontext_t scheduler;
  int current = 0, index = 0, count = 0;
  std::function<void()> body;
};
inline FakeBlock fake;

inline int thread() { return fake.current; }
inline int block() { return fake.index; }
inline int blocks() { return fake.count; }
inline int lane() { return fake.current % warpSize; }

inline void waitAt(Barrier &barrier) {
  int round = barrier.round;
  if (++barrier.arrived == barrier.members) {
    barrier.arrived = 0;
    ++barrier.round;
    return;
  }
  while (barrier.round == round)
    swapcontext(&fake.threads[fake.current].context, &fake.scheduler);
}
inline void syncThreads() { waitAt(fake.all); }
inline void syncWarp() { waitAt(fake.warps[fake.current / warpSize]); }

/// The sum of the values of this lane and those before it.
inline uint32_t sumOfLanes(uint32_t value) {
  fake.threads[fake.current].given = value;
  syncWarp();
  uint32_t sum = 0;
  for (int i = fake.current / warpSize * warpSize; i <= fake.current; ++i)
    sum += fake.threads[i].given;
  syncWarp();
  return sum;
}
inline uint32_t shuffleXor(uint32_t value, int mask) {
  fake.threads[fake.current].given = value;
  syncWarp();
  uint32_t other = fake.threads[fake.current ^ mask].given;
  syncWarp();
  return other;
}
inline float shuffleXor(float value, int mask) {
  return std::bit_cast<float>(shuffleXor(std::bit_cast<uint32_t>(value), mask));
}

inline void leave(Barrier &barrier) {
  if (--barrier.members && barrier.arrived == barrier.members) {
    barrier.arrived = 0;
    ++barrier.round;
  }
}

inline void runThread() {
  fake.body();
  fake.threads[fake.current].isDone = true;
  leave(fake.all);
  leave(fake.warps[fake.current / warpSize]);
}

/// Runs a kernel as `body` calls it, in so many blocks of as many threads.
inline void launch(int blocks, int threads, std::function<void()> body) {
  constexpr size_t stackSize = 64 << 10;
  fake.body = std::move(body);
  fake.count = blocks;
  fake.threads.resize(threads);
  for (fake.index = 0; fake.index < blocks; ++fake.index) {
    fake.all = {threads};
    fake.warps.assign((threads + warpSize - 1) / warpSize,
                      {std::min(threads, warpSize)});
    for (FakeThread &one : fake.threads) {
      if (!one.stack)
        one.stack = std::make_unique<char[]>(stackSize);
      one.isDone = false;
      getcontext(&one.context);
      one.context.uc_stack.ss_sp = one.stack.get();
      one.context.uc_stack.ss_size = stackSize;
      one.context.uc_link = &fake.scheduler;
      makecontext(&one.context, runThread, 0);
    }
    for (bool isLeft = true; isLeft;) {
      isLeft = false;
      for (int i = 0; i < threads; ++i) {
        if (fake.threads[i].isDone)
          continue;
        fake.current = i;
        swapcontext(&fake.scheduler, &fake.threads[i].context);
        isLeft = true;
      }
    }
  }
}

} // namespace gpu

#endif // WARP_DEVICELIB_GPU_GPU_H
