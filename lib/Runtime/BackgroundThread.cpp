//===- BackgroundThread.cpp - Work that nobody waits for ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BackgroundThread.h"

#include "Compiler/Abandon.h"
#include "warp/Background.h"
#include "warp/Forks.h"

#include <atomic>
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

/// Added to the niceness of the process.
static constexpr int politeness = 10;

namespace {
class Worker {
public:
  static Worker &get() {
    // Never destroyed: the thread is never joined.
    static auto *worker = new Worker;
    return *worker;
  }

  void add(std::function<void()> task);
  void wait();
  void stop();

private:
  Worker();
  void start();
  void run();
  void restartInChild();

  ForkMutex mutex;
  std::condition_variable_any changed;
  std::deque<std::function<void()>> tasks;
  /// The threads of the process.
  cpu_set_t processors{};
  bool isStarted = false, isBusy = false;
  std::atomic<bool> isStopped{false};
};
} // namespace

Worker::Worker() {
  (void)sched_getaffinity(getpid(), sizeof(processors), &processors);
  pthread_atfork(nullptr, nullptr, [] { get().restartInChild(); });
  std::atexit([] { get().stop(); });
}

void Worker::add(std::function<void()> task) {
  std::lock_guard lock(mutex);
  if (isStopped)
    return;
  tasks.push_back(std::move(task));
  start();
  changed.notify_all();
}

/// With the mutex held.
void Worker::start() {
  if (isStarted)
    return;
  isStarted = true;
  std::thread([this] { run(); }).detach();
}

void Worker::run() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  pthread_setname_np(pthread_self(), "warp-compiler");
  // Who starts it may be bound to a processor.
  sched_setaffinity(0, sizeof(processors), &processors);
  // The priority of this thread alone, on Linux.
  (void)setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + politeness);
  Abandonable tasksAre(isStopped);
  std::unique_lock lock(mutex);
  for (;;) {
    changed.wait(lock, [&] { return !tasks.empty(); });
    lock.unlock();
    // A fork waits for the task, which has locks, and no task begins meanwhile.
    ForkSection section;
    lock.lock();
    if (tasks.empty())
      continue;
    std::function<void()> task = std::move(tasks.front());
    tasks.pop_front();
    isBusy = true;
    lock.unlock();
    task();
    task = nullptr;
    lock.lock();
    isBusy = false;
    changed.notify_all();
  }
}

void Worker::wait() {
  std::unique_lock lock(mutex);
  changed.wait(lock, [&] { return tasks.empty() && !isBusy; });
}

void Worker::stop() {
  std::unique_lock lock(mutex);
  isStopped = true;
  tasks.clear();
  changed.wait(lock, [&] { return !isBusy; });
}

void Worker::restartInChild() {
  // Waiting and busy threads are not here.
  new (&changed) std::condition_variable_any;
  isStarted = isBusy = false;
  if (!tasks.empty() && !isStopped)
    start();
}

void background::add(std::function<void()> task) {
  Worker::get().add(std::move(task));
}

void warp::waitForBackground() { Worker::get().wait(); }
void warp::stopBackground() { Worker::get().stop(); }
