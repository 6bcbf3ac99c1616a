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
// cache line of its own. Chunks shrink towards the end of a stretch, so that
// the last ones end together.
//
// A job invites as many workers as WidthPolicy.h says, from those whose core is
// theirs: a worker that keeps the caller waiting because another process had
// its core is left out for a while. Who is not invited parks at once.
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

#include "PoolCpus.h"
#include "WidthPolicy.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <ctime>
#include <exception>
#include <linux/futex.h>
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
constexpr int64_t spinTime = 50'000;
/// A wait for the last chunks below this is nobody's fault.
constexpr int64_t shortWait = 50'000;
/// After this the caller offers its core to others while it waits.
constexpr int64_t politeWait = 100'000;

/// True on threads that run a body at this moment.
thread_local bool insideLoop = false;

inline void pause() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#else
  std::this_thread::yield();
#endif
}

/// Nanoseconds since some moment.
int64_t wallTime() {
  return std::chrono::steady_clock::now().time_since_epoch() /
         std::chrono::nanoseconds(1);
}

/// Nanoseconds that this thread had a core.
int64_t coreTime() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return time.tv_sec * int64_t(1'000'000'000) + time.tv_nsec;
}

class Pool {
public:
  explicit Pool(const std::vector<int> &cpus);
  int size() const { return static_cast<int>(workers.size()); }
  /// Threads that a loop may have now.
  int available(int64_t now) const;
  /// Runs a loop by `width` threads, two or more; `start` is the time.
  void run(int64_t begin, int64_t end, WidthPolicy::Plan plan,
           ThreadPool::Body body, void *context, int64_t start);

  /// Held by the thread whose loop runs. It guards all histories, too.
  std::mutex busy;

private:
  struct alignas(64) Stretch {
    std::atomic<int64_t> next{0};
    int64_t end = 0;
  };

  /// Entry 0 stands for the caller.
  struct alignas(64) Worker {
    std::atomic<pid_t> thread{0};
    /// Index of its stretch in the job, 0 for none.
    std::atomic<int> invited{0};
    std::atomic<bool> parked{false};
    std::atomic<bool> lostCore{false};
    /// Its CPU; entry 0 has the one that is free for the caller.
    int cpu = -1;
    CoreWatch watch;
  };

  void runWorker(int index);
  uint32_t waitForJob(int index, uint32_t seen);
  bool enter();
  void takePart(Worker &self);
  void work(int index);
  bool runNextChunk(Stretch &stretch);
  void makeRoomForCaller();
  void invite(int64_t now);
  void cut(int64_t begin, int64_t end);
  void wakeInvited();
  void waitForWorkers(int64_t start);
  void reportLosses();

  alignas(64) std::atomic<uint32_t> epoch{0};
  alignas(64) std::atomic<uint32_t> state{closed};

  ThreadPool::Body body = nullptr;
  void *context = nullptr;
  int width = 1;
  int64_t leastChunk = 1;
  int64_t align = 1;
  int64_t launch = 0;
  std::atomic<bool> failed{false};
  /// Set when the caller has waited too long for those still inside.
  std::atomic<bool> late{false};
  std::exception_ptr failure;

  std::vector<Stretch> stretches;
  std::vector<Worker> workers;
};

} // namespace

//===----------------------------------------------------------------------===//
// Workers
//===----------------------------------------------------------------------===//

static void pinThread(pid_t thread, int cpu) {
  if (cpu < 0)
    return;
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(cpu, &set);
  // A refusal (the CPU went away) leaves the thread where it was.
  (void)sched_setaffinity(thread, sizeof(set), &set);
}

/// The futex bit of a worker: more than 32 share them.
static uint32_t wakeBit(int index) { return 1u << (index % 32); }

Pool::Pool(const std::vector<int> &cpus)
    : stretches(cpus.size()), workers(cpus.size()) {
  for (int i = 0; i < size(); ++i)
    workers[i].cpu = cpus[i];
  for (int i = 1; i < size(); ++i)
    std::thread([this, i] { runWorker(i); }).detach();
}

void Pool::runWorker(int index) {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  pthread_setname_np(pthread_self(), "warp-worker");
  Worker &self = workers[index];
  pid_t thread = static_cast<pid_t>(syscall(SYS_gettid));
  pinThread(thread, self.cpu);
  self.thread.store(thread, std::memory_order_release);
  insideLoop = true;
  uint32_t seen = 0;
  while (true) {
    seen = waitForJob(index, seen);
    if (!self.invited.load(std::memory_order_relaxed) || !enter())
      continue;
    takePart(self);
    state.fetch_sub(1, std::memory_order_release);
  }
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
      pause();
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

bool Pool::enter() {
  uint32_t now = state.load(std::memory_order_acquire);
  while (!(now & closed))
    if (state.compare_exchange_weak(now, now + 1, std::memory_order_acq_rel))
      return true;
  return false;
}

void Pool::takePart(Worker &self) {
  // The job inside may be a later one than the one that was seen.
  int index = self.invited.load(std::memory_order_relaxed);
  if (!index)
    return;
  int64_t start = wallTime(), core = coreTime();
  work(index);
  if (!late.load(std::memory_order_relaxed))
    return;
  int64_t took = wallTime() - start;
  int64_t absent = took - (coreTime() - core);
  if (absent > std::max(shortWait, took / 4))
    self.lostCore.store(true, std::memory_order_relaxed);
}

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
  for (int turn = 0; turn < width; ++turn) {
    Stretch &stretch = stretches[(index + turn) % width];
    while (!failed.load(std::memory_order_relaxed) && runNextChunk(stretch)) {
    }
  }
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

void Pool::makeRoomForCaller() {
  int here = sched_getcpu();
  if (here < 0 || here == workers[0].cpu)
    return;
  for (int i = 1; i < size(); ++i) {
    pid_t thread = workers[i].thread.load(std::memory_order_acquire);
    if (workers[i].cpu != here || !thread)
      continue;
    std::swap(workers[0].cpu, workers[i].cpu);
    pinThread(thread, workers[i].cpu);
    return;
  }
}

int Pool::available(int64_t now) const {
  int count = 1;
  for (int i = 1; i < size(); ++i)
    count += workers[i].watch.mayJoin(now);
  return count;
}

void Pool::invite(int64_t now) {
  int invited = 1;
  for (int i = 1; i < size(); ++i) {
    Worker &worker = workers[i];
    int place = 0;
    if (invited < width && worker.watch.mayJoin(now)) {
      worker.watch.join(launch, now);
      place = invited++;
    }
    // A write would take the line from a worker that reads it.
    if (worker.invited.load(std::memory_order_relaxed) != place)
      worker.invited.store(place, std::memory_order_relaxed);
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

void Pool::waitForWorkers(int64_t start) {
  if (state.load(std::memory_order_acquire) == closed)
    return;
  int64_t begin = wallTime();
  // A quarter of the whole launch is a third of what has passed.
  int64_t patience = std::max(shortWait, (begin - start) / 3);
  while (true) {
    for (int i = 0; i < 64; ++i) {
      if (state.load(std::memory_order_acquire) == closed)
        return;
      pause();
    }
    int64_t waited = wallTime() - begin;
    if (waited > patience)
      late.store(true, std::memory_order_relaxed);
    if (waited > politeWait)
      std::this_thread::yield();
  }
}

void Pool::reportLosses() {
  int64_t now = wallTime();
  for (int i = 1; i < size(); ++i)
    if (workers[i].lostCore.exchange(false, std::memory_order_relaxed))
      workers[i].watch.lost(launch, now);
}

void Pool::run(int64_t begin, int64_t end, WidthPolicy::Plan plan,
               ThreadPool::Body body, void *context, int64_t start) {
  makeRoomForCaller();
  ++launch;
  this->body = body;
  this->context = context;
  width = plan.width;
  leastChunk = plan.chunk;
  cut(begin, end);
  invite(start);
  failed.store(false, std::memory_order_relaxed);
  late.store(false, std::memory_order_relaxed);

  state.store(0, std::memory_order_release);
  epoch.fetch_add(1);
  wakeInvited();
  insideLoop = true;
  work(0);
  insideLoop = false;
  state.fetch_or(closed, std::memory_order_acq_rel);
  waitForWorkers(start);
  if (late.load(std::memory_order_relaxed))
    reportLosses();
  if (failed.load(std::memory_order_relaxed))
    std::rethrow_exception(std::exchange(failure, nullptr));
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
  Pool *created = new Pool(choosePoolCpus());
  pool.store(created, std::memory_order_release);
  return *created;
}

int ThreadPool::size() { return getPool().size(); }

void ThreadPool::parallelFor(int64_t begin, int64_t end, int64_t grain,
                             Body body, void *context, LoopHistory *history) {
  if (begin >= end)
    return;
  grain = std::max<int64_t>(grain, 1);
  int64_t items = end - begin;
  if (insideLoop || items <= grain)
    return body(context, begin, end);
  Pool &shared = getPool();
  std::unique_lock<std::mutex> lock(shared.busy, std::try_to_lock);
  if (!lock || shared.size() == 1)
    return body(context, begin, end);
  int64_t start = wallTime();
  WidthPolicy::Plan plan{shared.available(start), 0};
  WidthPolicy *policy = history ? &history->of(items) : nullptr;
  if (policy)
    plan = policy->plan(items, plan.width);
  if (!plan.chunk)
    plan.chunk = grain;
  if (plan.width > 1) {
    shared.run(begin, end, plan, body, context, start);
  } else {
    // Others may have the workers meanwhile.
    lock.unlock();
    body(context, begin, end);
    if (!policy || !lock.try_lock())
      return;
  }
  if (policy)
    policy->record(items, plan.width, static_cast<double>(wallTime() - start));
}
