//===- BackgroundThread.cpp - Work that nobody waits for ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "BackgroundThread.h"

#include "Compiler/Abandon.h"
#include "warp/Background.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <deque>
#include <mutex>
#include <new>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <thread>
#include <unistd.h>

using namespace warp;

/// Added to the niceness of the process.
static constexpr int politeness = 10;
/// How long a fork waits for the task in progress.
static constexpr std::chrono::seconds mostForkWait(5);

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
  void beforeFork();
  void afterFork(bool inChild);

  std::mutex mutex;
  std::condition_variable changed;
  std::deque<std::function<void()>> tasks;
  /// Those of the process.
  cpu_set_t processors{};
  bool isStarted = false, isBusy = false, isForking = false;
  std::atomic<bool> isStopped{false};
};
} // namespace

Worker::Worker() {
  (void)sched_getaffinity(getpid(), sizeof(processors), &processors);
  pthread_atfork([] { get().beforeFork(); }, [] { get().afterFork(false); },
                 [] { get().afterFork(true); });
  std::atexit([] { get().stop(); });
}

void Worker::add(std::function<void()> task) {
  std::lock_guard<std::mutex> lock(mutex);
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
  // Of this thread alone, on Linux.
  (void)setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + politeness);
  Abandonable tasksAre(isStopped);
  std::unique_lock<std::mutex> lock(mutex);
  for (;;) {
    changed.wait(lock, [&] { return !tasks.empty() && !isForking; });
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
  std::unique_lock<std::mutex> lock(mutex);
  changed.wait(lock, [&] { return tasks.empty() && !isBusy; });
}

void Worker::stop() {
  std::unique_lock<std::mutex> lock(mutex);
  isStopped = true;
  tasks.clear();
  changed.wait(lock, [&] { return !isBusy; });
}

void Worker::beforeFork() {
  std::unique_lock<std::mutex> lock(mutex);
  isForking = true;
  changed.wait_for(lock, mostForkWait, [&] { return !isBusy; });
  // Held until the fork is over, so that it is this thread's in the child.
  lock.release();
}

void Worker::afterFork(bool inChild) {
  isForking = false;
  if (inChild) {
    // Those who waited, and who was busy, are not here.
    new (&changed) std::condition_variable;
    isStarted = isBusy = false;
    if (!tasks.empty() && !isStopped)
      start();
  }
  mutex.unlock();
  changed.notify_all();
}

void background::add(std::function<void()> task) {
  Worker::get().add(std::move(task));
}

void warp::waitForBackground() { Worker::get().wait(); }
void warp::stopBackground() { Worker::get().stop(); }
