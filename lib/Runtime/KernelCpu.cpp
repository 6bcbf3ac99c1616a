//===- KernelCpu.cpp - Launches on the CPU --------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch is a range of linear indices, in chunks that the threads of the pool
// take. Code that updates elements without atomic instructions runs on one
// thread, and keeps out all other code that updates any.
//
//===----------------------------------------------------------------------===//

#include "KernelImpl.h"
#include "warp/ThreadPool.h"

#include <new>
#include <pthread.h>
#include <shared_mutex>

using namespace warp;

/// Operations that are worth handing to another thread, until launches have
/// shown how long they take.
static constexpr double chunkWork = 16384;

/// Held alone by code that updates arrays without atomic instructions, shared
/// by code that does so with them: other threads may launch on the same array.
static std::shared_mutex &updateGate() {
  static std::shared_mutex gate;
  // A thread that held it is not in the child.
  static const int registered = pthread_atfork(
      nullptr, nullptr, [] { new (&updateGate()) std::shared_mutex; });
  (void)registered;
  return gate;
}

void warp::launchOnCpu(const Kernel::Variant &variant, const void *params,
                       int64_t items, bool serial) {
  CpuEntry entry = variant.cpu;
  if (variant.code.exclusive) {
    std::unique_lock<std::shared_mutex> alone(updateGate());
    return entry(params, 0, items);
  }
  std::shared_lock<std::shared_mutex> shared;
  if (variant.code.atomics)
    shared = std::shared_lock<std::shared_mutex>(updateGate());
  if (serial)
    return entry(params, 0, items);
  // Multiples of 64 keep vector code whole, and threads off each other's lines.
  int64_t grain =
      (static_cast<int64_t>(chunkWork / variant.code.cost) / 64 + 1) * 64;
  if (variant.code.cost > chunkWork)
    grain = 1;
  auto run = [&](int64_t begin, int64_t end) { entry(params, begin, end); };
  ThreadPool::parallelFor(0, items, grain, run, &variant.history);
}
