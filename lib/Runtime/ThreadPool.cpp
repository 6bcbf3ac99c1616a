//===- ThreadPool.cpp - Parallel loops on the CPU -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The caller's side of a job: what each thread gets and who is invited. Pool.h
// tells the whole.
//
//===----------------------------------------------------------------------===//

#include "warp/ThreadPool.h"

#include "Pool.h"
#include "PoolCpus.h"
#include "warp/Forks.h"

#include <algorithm>
#include <linux/futex.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <utility>

using namespace warp;

/// The number of a thread in the loop whose body it runs at this moment.
static constexpr int outside = -1;
static thread_local int numberInLoop = outside;

//===----------------------------------------------------------------------===//
// Chunks
//===----------------------------------------------------------------------===//

/// Takes a chunk and runs it; false if the stretch has none left.
bool Pool::runNextChunk(Stretch &stretch) {
  // The first look spares finished stretches a write.
  int64_t from = stretch.next.load(std::memory_order_relaxed), size;
  do {
    if (from >= stretch.end)
      return false;
    size = nextChunk(stretch.end - from, leastChunk, align);
  } while (!stretch.next.compare_exchange_weak(from, from + size,
                                               std::memory_order_relaxed));
  try {
    body(context, from, from + size);
  } catch (...) {
    if (!failed.exchange(true))
      failure = std::current_exception();
  }
  return true;
}

void Pool::work(int index) {
  numberInLoop = index;
  for (int turn = 0; turn < width; ++turn) {
    Stretch &stretch = stretches[(index + turn) % width];
    while (!failed.load(std::memory_order_relaxed) && runNextChunk(stretch)) {
    }
  }
  numberInLoop = outside;
}

void Pool::cut(int64_t begin, int64_t end) {
  align = chunkAlignment(end - begin, leastChunk, width);
  int64_t units = (end - begin - 1) / align + 1;
  int64_t from = begin;
  for (int i = 0; i < width; ++i) {
    int64_t mine = units / width + (i < units % width);
    stretches[i].next.store(from, std::memory_order_relaxed);
    from = mine > (end - from) / align ? end : from + mine * align;
    stretches[i].end = from;
  }
}

//===----------------------------------------------------------------------===//
// The caller
//===----------------------------------------------------------------------===//

void Pool::invite() {
  for (int i = 1; i < size(); ++i) {
    int stretch = i < width ? i : 0;
    // A write would take the line from a worker that reads it.
    if (workers[i].invited.load(std::memory_order_relaxed) != stretch)
      workers[i].invited.store(stretch, std::memory_order_relaxed);
  }
}

void Pool::run(int64_t begin, int64_t end, WidthPolicy::Plan plan,
               ThreadPool::Body body, void *context) {
  makeRoomForCaller();
  this->body = body;
  this->context = context;
  width = plan.width;
  leastChunk = plan.chunk;
  cut(begin, end);
  invite();
  failed.store(false, std::memory_order_relaxed);

  state.store(0, std::memory_order_release);
  epoch.fetch_add(1);
  wakeInvited();
  work(0);
  state.fetch_or(closed, std::memory_order_acq_rel);
  waitForWorkers();
  if (failed.load(std::memory_order_relaxed))
    std::rethrow_exception(std::exchange(failure, nullptr));
}

namespace {
std::atomic<Pool *> pool{nullptr};
ForkMutex poolMutex;
} // namespace

static void forgetPoolInChild() {
  pool.store(nullptr);
  numberInLoop = outside;
}

static Pool &getPool() {
  if (Pool *existing = pool.load(std::memory_order_acquire))
    return *existing;
  std::lock_guard lock(poolMutex);
  if (Pool *existing = pool.load(std::memory_order_acquire))
    return *existing;
  static bool registered = false;
  if (!registered)
    pthread_atfork(nullptr, nullptr, forgetPoolInChild);
  registered = true;
  // Never destroyed: its threads watch it until the process ends.
  Pool *created = new Pool(choosePoolCpus());
  pool.store(created, std::memory_order_release);
  return *created;
}

int ThreadPool::size() { return getPool().size(); }

int ThreadPool::quota() { return quotaOfOwnGroups(); }

int ThreadPool::worker() { return std::max(numberInLoop, 0); }

void ThreadPool::runTogether(int threads, Body body, void *context) {
  if (numberInLoop != outside || threads < 2)
    return body(context, 0, 1);
  Pool &shared = getPool();
  std::unique_lock<std::mutex> lock(shared.busy, std::try_to_lock);
  threads = std::min(threads, shared.size());
  if (!lock || threads == 1)
    return body(context, 0, 1);
  shared.run(0, threads, {threads, 1}, body, context);
}

void ThreadPool::parallelFor(int64_t begin, int64_t end, int64_t grain,
                             Body body, void *context, LoopHistory *history) {
  if (begin >= end)
    return;
  grain = std::max<int64_t>(grain, 1);
  int64_t items = end - begin;
  if (numberInLoop != outside || items <= grain)
    return body(context, begin, end);
  Pool &shared = getPool();
  std::unique_lock<std::mutex> lock(shared.busy, std::try_to_lock);
  if (!lock || shared.size() == 1)
    return body(context, begin, end);
  int64_t start = wallTime();
  WidthPolicy::Plan plan{shared.size(), 0};
  WidthPolicy *policy = history ? &history->of(items) : nullptr;
  if (policy)
    plan = policy->plan(items, plan.width);
  if (!plan.chunk)
    plan.chunk = grain;
  if (plan.width > 1) {
    shared.run(begin, end, plan, body, context);
  } else {
    // Others may have the workers meanwhile.
    lock.unlock();
    body(context, begin, end);
    if (!policy || !lock.try_lock())
      return;
  }
  if (policy) {
    policy->record(items, plan.width, static_cast<double>(wallTime() - start));
    if (history->isBrief(items) != policy->isBrief(items))
      history->setBrief(items, policy->isBrief(items));
  }
}
