//===- PoolWorkers.cpp - Workers of the pool ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The CPUs they run on, how they wait for jobs and are woken, and the caller's
// wait for those still inside, with the rescue of one that lost its core.
// Pool.h tells the whole.
//
//===----------------------------------------------------------------------===//

#include "Pool.h"

#include <csignal>
#include <linux/futex.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <thread>
#include <unistd.h>

using namespace warp;

/// How long a worker watches for the next job before it parks.
static constexpr int64_t spinTime = 50'000;
/// The caller's wait for the last chunks until it looks for workers that lost
/// their core, and the time between two looks at a worker's clock.
static constexpr int64_t patience = 25'000;
static constexpr int64_t lookTime = 10'000;
/// After this the caller sleeps while it waits.
static constexpr int64_t politeWait = 100'000;

/// Spends a moment of a loop that watches a word.
static void relax() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#else
  std::this_thread::yield();
#endif
}

/// Nanoseconds that the thread of this clock had a core.
static int64_t coreTime(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return time.tv_sec * int64_t(1'000'000'000) + time.tv_nsec;
}

//===----------------------------------------------------------------------===//
// Workers
//===----------------------------------------------------------------------===//

/// The futex bit of a worker: more than 32 share them.
static uint32_t wakeBit(int index) { return 1u << (index % 32); }

Pool::Pool(const std::vector<int> &cpus)
    : stretches(cpus.size()), workers(cpus.size()) {
  // Left empty where it does not fit; the kernel then refuses it as a mask.
  (void)sched_getaffinity(0, sizeof(everywhere), &everywhere);
  for (int i = 0; i < size(); ++i)
    workers[i].cpu.store(cpus[i]);
  for (int i = 1; i < size(); ++i)
    std::thread([this, i] { runWorker(i); }).detach();
}

static void bindThread(pid_t thread, const cpu_set_t &cpus) {
  // A refusal (the CPU went away) leaves the thread where it was.
  (void)sched_setaffinity(thread, sizeof(cpus), &cpus);
}

static void pinThread(pid_t thread, int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(cpu, &set);
  bindThread(thread, set);
}

void Pool::sendHome(const Worker &worker) {
  pid_t thread = worker.thread.load(std::memory_order_relaxed);
  int home = worker.cpu.load();
  if (home < 0)
    return bindThread(thread, everywhere);
  pinThread(thread, home);
  // A caller may have given it another one meanwhile.
  while (home != worker.cpu.load())
    pinThread(thread, home = worker.cpu.load());
}

void Pool::makeRoomForCaller() {
  int here = sched_getcpu();
  if (here < 0 || here == workers[0].cpu.load(std::memory_order_relaxed))
    return;
  for (int i = 1; i < size(); ++i) {
    pid_t thread = workers[i].thread.load(std::memory_order_acquire);
    if (workers[i].cpu.load(std::memory_order_relaxed) != here || !thread)
      continue;
    workers[i].cpu.store(workers[0].cpu.exchange(here));
    pinThread(thread, workers[i].cpu.load());
    return;
  }
}

void Pool::runWorker(int index) {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  pthread_setname_np(pthread_self(), "warp-worker");
  Worker &self = workers[index];
  pthread_getcpuclockid(pthread_self(), &self.clock);
  pid_t thread = static_cast<pid_t>(syscall(SYS_gettid));
  if (self.cpu.load() >= 0)
    pinThread(thread, self.cpu.load());
  self.thread.store(thread, std::memory_order_release);
  uint32_t seen = 0;
  while (true) {
    seen = waitForJob(index, seen);
    if (!self.invited.load(std::memory_order_relaxed) || !enter())
      continue;
    self.inside.store(true, std::memory_order_relaxed);
    // The job inside may be a later one than the one that was seen.
    if (int stretch = self.invited.load(std::memory_order_relaxed))
      work(stretch);
    leave(self);
  }
}

void Pool::leave(Worker &self) {
  self.inside.store(false);
  bool rescued = self.rescued.exchange(false);
  if (state.fetch_sub(1, std::memory_order_acq_rel) & watched)
    syscall(SYS_futex, &state, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
  if (rescued)
    sendHome(self);
}

uint32_t Pool::waitForJob(int index, uint32_t seen) {
  Worker &self = workers[index];
  bool invited = self.invited.load(std::memory_order_relaxed);
  int64_t start = wallTime();
  while (true) {
    for (int i = 0; i < 64; ++i) {
      uint32_t now = epoch.load(std::memory_order_acquire);
      if (now != seen)
        return now;
      relax();
    }
    if (invited && wallTime() - start < spinTime)
      continue;
    self.parked.store(true);
    // The kernel compares again, so a job posted in between is not missed.
    syscall(SYS_futex, &epoch, FUTEX_WAIT_BITSET_PRIVATE, seen, nullptr,
            nullptr, wakeBit(index));
    self.parked.store(false, std::memory_order_relaxed);
  }
}

void Pool::wakeInvited() {
  uint32_t bits = 0;
  for (int i = 1; i < size(); ++i)
    if (workers[i].invited.load(std::memory_order_relaxed) &&
        workers[i].parked.load())
      bits |= wakeBit(i);
  if (bits)
    syscall(SYS_futex, &epoch, FUTEX_WAKE_BITSET_PRIVATE, size(), nullptr,
            nullptr, bits);
}

bool Pool::enter() {
  uint32_t now = state.load(std::memory_order_acquire);
  while (!(now & closed))
    if (state.compare_exchange_weak(now, now + 1, std::memory_order_acq_rel))
      return true;
  return false;
}

//===----------------------------------------------------------------------===//
// The caller's wait
//===----------------------------------------------------------------------===//

void Pool::waitForWorkers() {
  if (state.load(std::memory_order_acquire) == closed)
    return;
  int64_t begin = wallTime();
  while (true) {
    for (int i = 0; i < 64; ++i) {
      if (state.load(std::memory_order_acquire) == closed)
        return;
      relax();
    }
    int64_t waited = wallTime() - begin;
    if (waited > politeWait || (waited > patience && rescueLost(begin)))
      return sleepUntilDone(begin);
  }
}

/// True if its clock stood still since the last look, if that is of this wait.
bool Pool::hasLostCore(Worker &worker, int64_t begin) {
  int64_t now = wallTime();
  int64_t passed = now - worker.lookedAt;
  bool again = worker.lookedAt >= begin;
  if (again && passed < lookTime)
    return false;
  int64_t core = coreTime(worker.clock);
  bool lost = again && core - worker.coreAtLook < passed / 4;
  worker.lookedAt = now;
  worker.coreAtLook = core;
  return lost;
}

/// Moves workers inside that lost their core to this thread's; true if any.
bool Pool::rescueLost(int64_t begin) {
  bool any = false;
  for (int i = 1; i < width; ++i) {
    Worker &worker = workers[i];
    if (!worker.inside.load(std::memory_order_relaxed) ||
        worker.rescued.load(std::memory_order_relaxed) ||
        !hasLostCore(worker, begin))
      continue;
    worker.rescued.store(true);
    pinThread(worker.thread.load(std::memory_order_relaxed), sched_getcpu());
    any = true;
    // It may have left meanwhile, before it saw that it must return.
    if (!worker.inside.load() && worker.rescued.exchange(false))
      sendHome(worker);
  }
  return any;
}

void Pool::sleepUntilDone(int64_t begin) {
  const timespec look{0, patience};
  uint32_t now = state.fetch_or(watched, std::memory_order_acq_rel) | watched;
  while (now != (closed | watched)) {
    syscall(SYS_futex, &state, FUTEX_WAIT_PRIVATE, now, &look, nullptr, 0);
    now = state.load(std::memory_order_acquire);
    if (now != (closed | watched))
      rescueLost(begin);
  }
  state.store(closed, std::memory_order_relaxed);
}
