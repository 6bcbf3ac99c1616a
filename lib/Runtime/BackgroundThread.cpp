//===- BackgroundThread.cpp - Background compilation threads --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BackgroundThread.h"

#include "Compiler/Abandon.h"
#include "LaunchQueue.h"
#include "warp/Background.h"
#include "warp/Forks.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <deque>
#include <new>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <thread>
#include <unistd.h>

using namespace warp;

/// Added to the niceness of the process by threads that nobody waits for.
static constexpr int politeness = 10;

/// Threads of a group, at most.
static constexpr int mostThreads = 16;

/// Time without urgent tasks after which the others begin. While a program
/// starts, the host translates one kernel after the other, and the driver's
/// assembler, which works for one thread at a time, is for those.
static constexpr std::chrono::milliseconds quietTime(250);

static thread_local bool isWorkerThread = false;

namespace {
using Clock = std::chrono::steady_clock;

class Workers {
public:
  /// With the threads of low priority first.
  static Workers &get(bool urgent) {
    // Never destroyed: the threads are never joined.
    static auto *groups = new Workers[2]{Workers(false), Workers(true)};
    return groups[urgent];
  }

  void add(std::function<void()> task, bool alsoAtExit = false);
  void wait();
  void stop();
  void restartInChild();
  void setMost(int count);
  int tasksLeft() const { return left; }

private:
  explicit Workers(bool urgent);
  void start();
  void run();
  /// Fewer tasks are left; those of low priority begin when none is.
  void end(int count);
  /// With the mutex held: waits for a task that may begin.
  void waitForTask(std::unique_lock<ForkMutex> &lock);

  bool urgent;
  ForkMutex mutex;
  std::condition_variable_any changed;
  struct Task {
    std::function<void()> run;
    bool alsoAtExit;
  };
  std::deque<Task> tasks;
  /// The processors of the process.
  cpu_set_t processors{};
  int most = 1, started = 0, busy = 0;
  /// Tasks that wait or run.
  std::atomic<int> left{0};
  /// Threads that wait for all tasks.
  int awaiting = 0;
  /// When the last urgent task ended.
  std::atomic<Clock::duration> lastEnd{-std::chrono::hours(1)};
  std::atomic<bool> isStopped{false};
};
} // namespace

/// Once, before the first thread.
static void watchProcess() {
  static const int watched = [] {
    pthread_atfork(nullptr, nullptr, [] {
      Workers::get(false).restartInChild();
      Workers::get(true).restartInChild();
    });
    std::atexit(stopBackground);
    return 0;
  }();
  (void)watched;
}

Workers::Workers(bool urgent) : urgent(urgent) {
  if (sched_getaffinity(getpid(), sizeof(processors), &processors) != 0)
    CPU_ZERO(&processors);
  setMost(0);
}

void Workers::setMost(int count) {
  std::lock_guard lock(mutex);
  int all = std::clamp(CPU_COUNT(&processors), 1, mostThreads);
  most = !urgent ? std::max(1, all / 4) : count > 0 ? count : all;
}

void Workers::add(std::function<void()> task, bool alsoAtExit) {
  watchProcess();
  std::lock_guard lock(mutex);
  if (isStopped)
    return;
  tasks.push_back({std::move(task), alsoAtExit});
  ++left;
  start();
  changed.notify_all();
}

/// With the mutex held: a thread for each task that waits, up to the limit.
void Workers::start() {
  while (started < most && started - busy < static_cast<int>(tasks.size())) {
    ++started;
    std::thread([this] { run(); }).detach();
  }
}

void Workers::run() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  pthread_setname_np(pthread_self(), "warp-compiler");
  isWorkerThread = true;
  // Who starts it may be bound to a processor.
  sched_setaffinity(0, sizeof(processors), &processors);
  // The priority of this thread alone, on Linux.
  if (!urgent)
    (void)setpriority(PRIO_PROCESS, 0,
                      getpriority(PRIO_PROCESS, 0) + politeness);
  Abandonable tasksAre(isStopped);
  BehindNothing exempt;
  std::unique_lock lock(mutex);
  for (;;) {
    waitForTask(lock);
    lock.unlock();
    // A fork waits for the task, which has locks, and no task begins meanwhile.
    ForkSection section;
    lock.lock();
    if (tasks.empty())
      continue;
    std::function<void()> task = std::move(tasks.front().run);
    tasks.pop_front();
    ++busy;
    lock.unlock();
    task();
    task = nullptr;
    lock.lock();
    --busy;
    changed.notify_all();
    lock.unlock();
    end(1);
    lock.lock();
  }
}

void Workers::waitForTask(std::unique_lock<ForkMutex> &lock) {
  Workers &first = get(true);
  for (;;) {
    changed.wait(lock,
                 [&] { return !tasks.empty() && (urgent || first.left == 0); });
    Clock::time_point begin(first.lastEnd.load() + quietTime);
    if (urgent || awaiting || Clock::now() >= begin)
      return;
    // Waits by the steady clock need a newer glibc than wheels do.
    changed.wait_until(lock, std::chrono::system_clock::now() +
                                 (begin - Clock::now()));
  }
}

void Workers::end(int count) {
  if (urgent)
    lastEnd = Clock::now().time_since_epoch();
  if ((left -= count) != 0 || !urgent)
    return;
  Workers &others = get(false);
  std::lock_guard lock(others.mutex);
  others.changed.notify_all();
}

void Workers::wait() {
  std::unique_lock lock(mutex);
  ++awaiting;
  changed.notify_all();
  changed.wait(lock, [&] { return tasks.empty() && busy == 0; });
  --awaiting;
}

void Workers::stop() {
  std::deque<Task> dropped;
  std::unique_lock lock(mutex);
  isStopped = true;
  dropped.swap(tasks);
  changed.wait(lock, [&] { return busy == 0; });
  lock.unlock();
  for (const Task &task : dropped)
    if (task.alsoAtExit)
      task.run();
  end(static_cast<int>(dropped.size()));
  // Tells those who wait for one.
  dropped.clear();
}

void Workers::restartInChild() {
  // Waiting and busy threads are not here.
  new (&changed) std::condition_variable_any;
  started = busy = awaiting = 0;
  left = static_cast<int>(tasks.size());
  if (!tasks.empty() && !isStopped)
    start();
}

void background::add(std::function<void()> task) {
  Workers::get(false).add(std::move(task));
}

void background::addUrgent(std::function<void()> task, bool alsoAtExit) {
  Workers::get(true).add(std::move(task), alsoAtExit);
}

int background::urgentTasks() { return Workers::get(true).tasksLeft(); }

bool background::isWorker() { return isWorkerThread; }

void background::setUrgentThreads(int count) {
  Workers::get(true).setMost(count);
}

void warp::waitForBackground() {
  // Urgent tasks leave others behind.
  Workers::get(true).wait();
  Workers::get(false).wait();
}

void warp::stopBackground() {
  Workers::get(true).stop();
  Workers::get(false).stop();
}
