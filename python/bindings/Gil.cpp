//===- Gil.cpp - Work without Python's lock -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"

#include "warp/Background.h"

#include <pthread.h>

#include <atomic>
#include <chrono>
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
  warp::stopBackground();
  while (returning != 0)
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  PyEval_RestoreThread(state);
}

//===----------------------------------------------------------------------===//
// Exit
//===----------------------------------------------------------------------===//

void warp::python::watchExit(py::module_ &m) {
  // A child process has none of the threads that were on their way.
  pthread_atfork(nullptr, nullptr, [] { returning = 0; });
  m.def(
      "wait_for_background",
      [] {
        Unlocked unlocked;
        warp::waitForBackground();
      },
      "Waits until all better code that was asked for is in use.");
  m.def("begin_exit", &beginExit,
        "Threads that come back from native code wait from now on.");
  py::module_::import("atexit").attr("register")(m.attr("begin_exit"));
}
