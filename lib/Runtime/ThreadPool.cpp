//===- ThreadPool.cpp - Parallel loops on the CPU -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Workers wait for a job by watching one word, `epoch`: they spin for about
// 50 microseconds (a launch that follows another finds them awake), then park
// on a futex. A job is open while the pool's `state` lacks the Closed bit; the
// lower bits count the workers inside. The caller opens it, works, closes it
// when nothing is left to take and waits for the workers inside only, so one
// that is slow to wake never delays a launch: it finds the door closed.
//
// The range is cut into one stretch per thread. A thread takes chunks from its
// own stretch, then from the others'. Each stretch is one atomic counter on a
// cache line of its own.
//
// Workers are pinned, one per CPU. The caller is a thread of the user and is
// not; if it sits on a worker's CPU when a job begins, that worker moves to
// the CPU that was left free for the caller. Without this both may share one
// core for milliseconds.
//
// After a fork the child has no workers. It forgets the parent's pool and
// builds its own at the first loop.
//
//===----------------------------------------------------------------------===//

#include "warp/ThreadPool.h"

#include "Support.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <linux/futex.h>
#include <memory>
#include <mutex>
#include <new>
#include <pthread.h>
#include <sched.h>
#include <sys/syscall.h>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

using namespace warp;

namespace {

constexpr uint32_t closed = 1u << 31;
constexpr auto spinTime = std::chrono::microseconds(50);

/// True on threads that run a body at this moment.
thread_local bool insideLoop = false;

inline void pause() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#else
  std::this_thread::yield();
#endif
}

class Pool {
public:
  explicit Pool(const std::vector<int> &cpus);
  int size() const { return static_cast<int>(stretches.size()); }
  void run(int64_t begin, int64_t end, int64_t grain, ThreadPool::Body body,
           void *context);

  /// Held by the thread whose loop runs.
  std::mutex busy;

private:
  struct alignas(64) Stretch {
    std::atomic<int64_t> next{0};
    int64_t end = 0;
  };

  void worker(int index);
  uint32_t waitForJob(uint32_t seen);
  bool enter();
  void work(int index);
  void runChunk(int64_t begin, int64_t end);
  void makeRoomForCaller();

  alignas(64) std::atomic<uint32_t> epoch{0};
  std::atomic<uint32_t> sleepers{0};
  alignas(64) std::atomic<uint32_t> state{closed};

  ThreadPool::Body body = nullptr;
  void *context = nullptr;
  int64_t chunk = 1;
  std::atomic<bool> failed{false};
  std::exception_ptr failure;

  std::vector<Stretch> stretches;
  /// CPU and kernel thread of each worker; entry 0 is the caller's free CPU.
  std::vector<int> cpus;
  std::vector<std::atomic<pid_t>> threads;
};

} // namespace

static void pinThread(pid_t thread, int cpu) {
  if (cpu < 0)
    return;
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(cpu, &set);
  // A refusal (the CPU went away) leaves the thread where it was.
  (void)sched_setaffinity(thread, sizeof(set), &set);
}

Pool::Pool(const std::vector<int> &cpus)
    : stretches(cpus.size()), cpus(cpus), threads(cpus.size()) {
  for (int i = 1; i < size(); ++i)
    std::thread([this, i] { worker(i); }).detach();
}

void Pool::worker(int index) {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  pthread_setname_np(pthread_self(), "warp-worker");
  pid_t self = static_cast<pid_t>(syscall(SYS_gettid));
  pinThread(self, cpus[index]);
  threads[index].store(self, std::memory_order_release);
  insideLoop = true;
  uint32_t seen = 0;
  while (true) {
    seen = waitForJob(seen);
    if (!enter())
      continue;
    work(index);
    state.fetch_sub(1, std::memory_order_release);
  }
}

uint32_t Pool::waitForJob(uint32_t seen) {
  auto start = std::chrono::steady_clock::now();
  while (true) {
    for (int i = 0; i < 64; ++i) {
      uint32_t now = epoch.load(std::memory_order_acquire);
      if (now != seen)
        return now;
      pause();
    }
    if (std::chrono::steady_clock::now() - start < spinTime)
      continue;
    sleepers.fetch_add(1);
    // The kernel compares again, so a job posted in between is not missed.
    syscall(SYS_futex, &epoch, FUTEX_WAIT_PRIVATE, seen, nullptr, nullptr, 0);
    sleepers.fetch_sub(1);
  }
}

bool Pool::enter() {
  uint32_t now = state.load(std::memory_order_acquire);
  while (!(now & closed))
    if (state.compare_exchange_weak(now, now + 1, std::memory_order_acq_rel))
      return true;
  return false;
}

void Pool::runChunk(int64_t begin, int64_t end) {
  try {
    body(context, begin, end);
  } catch (...) {
    if (!failed.exchange(true))
      failure = std::current_exception();
  }
}

void Pool::work(int index) {
  int count = size();
  for (int turn = 0; turn < count; ++turn) {
    Stretch &stretch = stretches[(index + turn) % count];
    while (!failed.load(std::memory_order_relaxed)) {
      // The first look spares finished stretches a write.
      if (stretch.next.load(std::memory_order_relaxed) >= stretch.end)
        break;
      int64_t from = stretch.next.fetch_add(chunk, std::memory_order_relaxed);
      if (from >= stretch.end)
        break;
      runChunk(from, std::min(from + chunk, stretch.end));
    }
  }
}

void Pool::makeRoomForCaller() {
  int here = sched_getcpu();
  if (here < 0 || here == cpus[0])
    return;
  for (int i = 1; i < size(); ++i) {
    pid_t thread = threads[i].load(std::memory_order_acquire);
    if (cpus[i] != here || !thread)
      continue;
    std::swap(cpus[0], cpus[i]);
    pinThread(thread, cpus[i]);
    return;
  }
}

void Pool::run(int64_t begin, int64_t end, int64_t grain, ThreadPool::Body body,
               void *context) {
  makeRoomForCaller();
  int64_t items = end - begin;
  int64_t count = size();
  // Several chunks per thread let uneven work spread.
  chunk = std::max<int64_t>(1, items / (count * 8 * grain)) * grain;
  int64_t chunks = (items + chunk - 1) / chunk;
  int64_t from = begin;
  for (int64_t i = 0; i < count; ++i) {
    int64_t upto = begin + std::min(items, chunks * (i + 1) / count * chunk);
    stretches[i].next.store(from, std::memory_order_relaxed);
    stretches[i].end = upto;
    from = upto;
  }
  this->body = body;
  this->context = context;
  failed.store(false, std::memory_order_relaxed);

  state.store(0, std::memory_order_release);
  epoch.fetch_add(1);
  if (sleepers.load())
    syscall(SYS_futex, &epoch, FUTEX_WAKE_PRIVATE, INT_MAX, nullptr, nullptr,
            0);
  insideLoop = true;
  work(0);
  insideLoop = false;
  state.fetch_or(closed, std::memory_order_acq_rel);
  for (int spins = 0; state.load(std::memory_order_acquire) != closed;) {
    if (++spins < 4096)
      pause();
    else
      std::this_thread::yield();
  }
  if (failed.load(std::memory_order_relaxed))
    std::rethrow_exception(std::exchange(failure, nullptr));
}

/// CPUs that the control group's quota pays for; INT_MAX without one.
static int quotaOfControlGroup() {
  std::unique_ptr<FILE, int (*)(FILE *)> file(
      std::fopen("/sys/fs/cgroup/cpu.max", "r"), std::fclose);
  if (!file.get())
    return INT_MAX;
  long long quota = 0, period = 0;
  if (std::fscanf(file.get(), "%lld %lld", &quota, &period) != 2 ||
      quota <= 0 || period <= 0)
    return INT_MAX;
  return static_cast<int>(
      std::min<long long>(INT_MAX, (quota + period - 1) / period));
}

/// One entry per thread of the pool: its CPU, or -1 to leave it unpinned.
static std::vector<int> chooseCpus() {
  std::vector<int> cpus;
  // Machines with more CPUs than a cpu_set_t holds need a larger mask.
  for (int limit = CPU_SETSIZE; limit <= 1 << 16 && cpus.empty(); limit *= 4) {
    cpu_set_t *set = CPU_ALLOC(limit);
    size_t bytes = CPU_ALLOC_SIZE(limit);
    if (sched_getaffinity(0, bytes, set) == 0)
      for (int i = 0; i < limit; ++i)
        if (CPU_ISSET_S(i, bytes, set))
          cpus.push_back(i < CPU_SETSIZE ? i : -1);
    CPU_FREE(set);
  }
  if (cpus.empty())
    cpus.push_back(-1);
  size_t wanted = std::min<size_t>(cpus.size(), quotaOfControlGroup());
  std::string setting = environment("WARP_NUM_THREADS");
  if (!setting.empty()) {
    long number = std::strtol(setting.c_str(), nullptr, 10);
    if (number >= 1)
      wanted = std::min<long>(number, 1024);
  }
  // More threads than CPUs, or fewer: let the scheduler place them.
  if (wanted != cpus.size())
    cpus.assign(wanted, -1);
  return cpus;
}

namespace {
std::atomic<Pool *> pool{nullptr};
std::mutex poolMutex;
} // namespace

static void forgetPoolInChild() {
  pool.store(nullptr);
  new (&poolMutex) std::mutex;
  insideLoop = false;
}

static Pool &getPool() {
  if (Pool *existing = pool.load(std::memory_order_acquire))
    return *existing;
  std::lock_guard<std::mutex> lock(poolMutex);
  if (Pool *existing = pool.load(std::memory_order_acquire))
    return *existing;
  static bool registered = false;
  if (!registered)
    pthread_atfork(nullptr, nullptr, forgetPoolInChild);
  registered = true;
  // Never destroyed: its threads watch it until the process ends.
  Pool *created = new Pool(chooseCpus());
  pool.store(created, std::memory_order_release);
  return *created;
}

int ThreadPool::size() { return getPool().size(); }

void ThreadPool::parallelFor(int64_t begin, int64_t end, int64_t grain,
                             Body body, void *context) {
  if (begin >= end)
    return;
  grain = std::max<int64_t>(grain, 1);
  if (insideLoop || end - begin <= grain)
    return body(context, begin, end);
  Pool &shared = getPool();
  std::unique_lock<std::mutex> lock(shared.busy, std::try_to_lock);
  if (!lock || shared.size() == 1)
    return body(context, begin, end);
  shared.run(begin, end, grain, body, context);
}
