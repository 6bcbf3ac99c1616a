//===- Gil.cpp - Work without Python's lock -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"

#include <pthread.h>

#include <atomic>
#include <chrono>
#include <shared_mutex>
#include <thread>

namespace py = pybind11;

static std::atomic<int> returning{0};
static std::atomic<bool> exiting{false};
static std::atomic<std::thread::id> exitingThread;

void warp::python::Unlocked::takeLock(PyThreadState *state) {
  ++returning;
  if (exiting && exitingThread.load() != std::this_thread::get_id()) {
    --returning;
    // The process ends while the thread waits.
    for (;;)
      std::this_thread::sleep_for(std::chrono::hours(1));
  }
  PyEval_RestoreThread(state);
  --returning;
}

/// Called when Python exits, before it ends threads.
static void beginExit() {
  exitingThread = std::this_thread::get_id();
  exiting = true;
  PyThreadState *state = PyEval_SaveThread();
  while (returning != 0)
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  PyEval_RestoreThread(state);
}

//===----------------------------------------------------------------------===//
// Forks
//===----------------------------------------------------------------------===//

static std::shared_timed_mutex compiling;
static bool forkHoldsIt = false;

warp::python::Compiling::Compiling() { compiling.lock_shared(); }
warp::python::Compiling::~Compiling() { compiling.unlock_shared(); }

static void beforeFork() {
  // A compilation that wants to tell Python something waits for this thread.
  forkHoldsIt = compiling.try_lock_for(std::chrono::seconds(5));
}

static void afterFork() {
  if (forkHoldsIt)
    compiling.unlock();
  forkHoldsIt = false;
}

static void afterForkInChild() {
  afterFork();
  // A child process has none of the threads that were on their way.
  returning = 0;
}

void warp::python::watchExit(py::module_ &m) {
  pthread_atfork(beforeFork, afterFork, afterForkInChild);
  m.def("begin_exit", &beginExit,
        "Threads that come back from native code wait from now on.");
  py::module_::import("atexit").attr("register")(m.attr("begin_exit"));
}
