//===- Kernel.cpp - CPU launches: chunks on the thread pool ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch is a range of linear indices, in chunks that the threads of the pool
// take. Code that updates elements without atomic instructions runs on one
// thread, or on all with copies of the arrays (PrivateCopies.h), and keeps out
// all other code that updates any.
//
//===----------------------------------------------------------------------===//

#include "Kernel.h"

#include "Device.h"
#include "PrivateCopies.h"
#include "warp/ThreadPool.h"

#include <chrono>
#include <cstdio>
#include <new>
#include <pthread.h>
#include <shared_mutex>

using namespace warp;

/// Operations that are worth handing to another thread, until launches have
/// shown how long they take.
static constexpr double chunkWork = 16384;
/// Operations of a lane up to which code with atomic instructions stays on one
/// thread: its sums are then made in one order, and programs that decide by
/// them, such as optimisers, take the same way in every run. Some tens of
/// microseconds, in which vectors do the operations of all their lanes.
static constexpr double orderedWork = 262144;
/// Ticks that a brief launch takes, at most: some microseconds.
static constexpr uint64_t mostTicks = 16384;

/// Held alone by code that updates arrays without atomic instructions, shared
/// by code that does so with them: other threads may launch on the same array.
static std::shared_mutex &updateGate() {
  static std::shared_mutex gate;
  // A thread that held it is not in the child.
  static const int registered = pthread_atfork(nullptr, nullptr, [] {
    new (&updateGate()) std::shared_mutex;
    forgetCopiesInChild();
  });
  (void)registered;
  return gate;
}

/// Items that are worth handing to another thread. Multiples of 64 keep vector
/// code whole, and threads off each other's lines.
static int64_t grainOf(const Code &code) {
  if (code.schedule.cost > chunkWork)
    return 1;
  return (static_cast<int64_t>(chunkWork / code.schedule.cost) / 64 + 1) * 64;
}

std::unique_ptr<DeviceCode> CpuDevice::load(const Kernel::Variant &,
                                            Code &code) {
  return std::make_unique<CpuCode>(
      reinterpret_cast<CpuEntry>(Jit::get().load(code)));
}

CpuCode::~CpuCode() { Jit::get().unload(reinterpret_cast<void *>(entry)); }

void warp::runOnCpu(const Kernel::Variant &variant, const void *params,
                    int64_t begin, int64_t end) {
  using namespace std::chrono;
  auto run = [&] {
    auto *code = static_cast<const CpuCode *>(
        variant.current.load(std::memory_order_acquire));
    code->entry(params, begin, end);
  };
  if (!variant.isQuick.load(std::memory_order_relaxed))
    return run();
  steady_clock::time_point start = steady_clock::now();
  run();
  variant.quick->spend(nanoseconds(steady_clock::now() - start).count());
}

/// True for launches whose sums are made in one order, which pieces by other
/// code would change.
static bool isOrdered(const Kernel::Variant &variant, bool serial) {
  return serial && variant.code.schedule.atomics;
}

/// Runs some indices of a launch by lanes and the code of a trial in turn while
/// the variant's lanes are checked; returns which.
static LaneTrial::Part tryLanes(const Kernel::Variant &variant,
                                const void *params, int64_t items,
                                bool serial) {
  if (!variant.trial || !variant.trial->isOpen() || variant.isQuick ||
      isOrdered(variant, serial))
    return {};
  auto *other = static_cast<const CpuCode *>(variant.trial->otherCode());
  if (!other)
    return {};
  auto *lanes = static_cast<const CpuCode *>(
      variant.current.load(std::memory_order_acquire));
  return variant.trial->measure(
      other, items, [&](bool byLanes, int64_t begin, int64_t end) {
        (byLanes ? lanes : other)->entry(params, begin, end);
      });
}

/// Runs the indices of a launch but for those of a trial, on all threads.
template <typename Fn>
static void runOthers(const Kernel::Variant &variant, LaneTrial::Part tried,
                      int64_t items, Fn &&run) {
  if (tried.begin > 0)
    ThreadPool::parallelFor(0, tried.begin, grainOf(variant.code), run);
  ThreadPool::parallelFor(tried.end, items, grainOf(variant.code), run,
                          &variant.history);
}

/// The same on this thread.
static void runOthersHere(const Kernel::Variant &variant, LaneTrial::Part tried,
                          int64_t items, const void *params) {
  if (tried.begin > 0)
    runOnCpu(variant, params, 0, tried.begin);
  runOnCpu(variant, params, tried.end, items);
}

static void launchOnCopies(const Kernel::Variant &variant, const void *params,
                           size_t paramSize, int64_t items) {
  PrivateCopies copies(variant.code.schedule.copied, params, paramSize);
  LaneTrial::Part tried =
      tryLanes(variant, copies.paramsOf(ThreadPool::worker()), items,
               /*serial=*/false);
  auto run = [&](int64_t begin, int64_t end) {
    runOnCpu(variant, copies.paramsOf(ThreadPool::worker()), begin, end);
  };
  runOthers(variant, tried, items, run);
  copies.merge();
}

/// Runs code that must have its arrays to itself.
static void launchAlone(const Kernel::Variant &variant, const void *params,
                        size_t paramSize, int64_t items, bool serial) {
  std::unique_lock<std::shared_mutex> alone(updateGate());
  const CopiedArrays &copied = variant.code.schedule.copied;
  if (!serial && !copied.list.empty() &&
      chooseUpdates(copied, params, items) == UpdateMode::Copies)
    return launchOnCopies(variant, params, paramSize, items);
  freeIdleCopies();
  runOthersHere(variant, tryLanes(variant, params, items, serial), items,
                params);
}

/// Runs the indices below `items`; on this thread if `serial`.
static void launch(const Kernel::Variant &variant, const void *params,
                   size_t paramSize, int64_t items, bool serial) {
  if (variant.code.schedule.exclusive)
    return launchAlone(variant, params, paramSize, items, serial);
  std::shared_lock<std::shared_mutex> shared;
  if (variant.code.schedule.atomics)
    shared = std::shared_lock<std::shared_mutex>(updateGate());
  LaneTrial::Part tried = tryLanes(variant, params, items, serial);
  if (serial)
    return runOthersHere(variant, tried, items, params);
  auto run = [&](int64_t begin, int64_t end) {
    runOnCpu(variant, params, begin, end);
  };
  runOthers(variant, tried, items, run);
}

/// The same; adds its time to those after which the variant's lanes are
/// checked.
static void launchTimed(const Kernel::Variant &variant, const void *params,
                        size_t paramSize, int64_t items, bool serial) {
  bool isTimed = variant.trial && variant.trial->isOpen() &&
                 !variant.trial->otherCode() && !isOrdered(variant, serial);
  if (!isTimed)
    return launch(variant, params, paramSize, items, serial);
  using namespace std::chrono;
  steady_clock::time_point start = steady_clock::now();
  launch(variant, params, paramSize, items, serial);
  variant.trial->spend(nanoseconds(steady_clock::now() - start).count());
}

/// A clock without a unit that takes a few nanoseconds to read.
static uint64_t ticks() {
#ifdef __x86_64__
  return __builtin_ia32_rdtsc();
#else
  return static_cast<uint64_t>(
      std::chrono::steady_clock::now().time_since_epoch().count());
#endif
}

/// Runs a launch that is expected to be brief; notes it if it was not, so that
/// the next one asks the pool.
static void launchBriefly(const Kernel::Variant &variant, const void *params,
                          int64_t items) {
  uint64_t start = ticks();
  runOnCpu(variant, params, 0, items);
  if (ticks() - start > mostTicks)
    variant.history.setBrief(items, false);
}

void CpuCode::launch(const Kernel::Plan &plan, void *params, size_t paramSize,
                     const Stream *) const {
  const Kernel::Variant &variant = *plan.variant;
  if (!isCheap(plan) && variant.isBrief(plan.items))
    return launchBriefly(variant, params, plan.items);
  bool serial =
      isCheap(plan) || (variant.code.schedule.atomics &&
                        plan.work < orderedWork * variant.code.schedule.lanes);
  if (variant.code.sites.empty()) {
    launchTimed(variant, params, paramSize, plan.items, serial);
  } else {
    ErrorRecord record;
    setErrorRecord(params, reinterpret_cast<uint64_t>(&record));
    ::launch(variant, params, paramSize, plan.items, serial);
    if (record.flag)
      raiseFailedCheck(record, variant.code.sites);
  }
  if (variant.code.schedule.usesPrintf)
    std::fflush(stdout);
}
