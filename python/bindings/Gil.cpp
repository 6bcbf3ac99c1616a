//===- Gil.cpp - Release of the GIL ---------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"

#include "warp/Background.h"
#include "warp/Error.h"
#include "warp/LaunchQueue.h"
#include "warp/Peers.h"

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
  // A launch that nobody waited for may have failed. After an exception of the
  // program nobody wants to know.
  std::exception_ptr problem;
  if (!PySys_GetObject("last_value"))
    try {
      warp::finishQueuedLaunches();
    } catch (...) {
      problem = std::current_exception();
    }
  exiting = true;
  PyThreadState *state = PyEval_SaveThread();
  warp::stopBackground();
  while (returning != 0)
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  PyEval_RestoreThread(state);
  if (problem)
    std::rethrow_exception(problem);
}

//===----------------------------------------------------------------------===//
// Waits for code
//===----------------------------------------------------------------------===//

/// Function of Python that shows the progress: (done, all), None at the end.
static PyObject *progressFunction = nullptr;

static void *leavePython() {
  return !exiting && PyGILState_Check() ? PyEval_SaveThread() : nullptr;
}

static void enterPython(void *state) {
  if (state)
    warp::python::Unlocked::takeLock(static_cast<PyThreadState *>(state));
}

/// Python looks for signals in the function, too, so an interrupt may be raised
/// there. It ends the wait, or is left for later where the wait may not throw.
static void callProgress(const py::object &done, const py::object &all,
                         bool mayThrow) {
  if (!progressFunction)
    return;
  PyObject *result = PyObject_CallFunctionObjArgs(progressFunction, done.ptr(),
                                                  all.ptr(), nullptr);
  if (result) {
    Py_DECREF(result);
  } else if (mayThrow) {
    throw py::error_already_set();
  } else if (PyErr_ExceptionMatches(PyExc_KeyboardInterrupt)) {
    PyErr_Clear();
    PyErr_SetInterrupt();
  } else {
    PyErr_WriteUnraisable(progressFunction);
  }
}

static void pollPython(int done, int all, bool mayThrow) {
  if (exiting)
    return;
  py::gil_scoped_acquire locked;
  if (mayThrow && PyErr_CheckSignals() != 0)
    throw py::error_already_set();
  callProgress(py::int_(done), py::int_(all), mayThrow);
}

static void endWait() {
  if (exiting)
    return;
  py::gil_scoped_acquire locked;
  callProgress(py::none(), py::none(), /*mayThrow=*/false);
}

void warp::python::watchWaits(py::module_ &m) {
  warp::setWaitHooks({leavePython, enterPython, pollPython, endWait});
  m.def(
      "set_progress",
      [](py::object function) {
        Py_XDECREF(progressFunction);
        progressFunction =
            function.is_none() ? nullptr : function.release().ptr();
      },
      py::arg("function").none(true),
      "Function that is told of a wait for the code of launches ten times a "
      "second: (done, all) kernels, None at its end.");
  m.def("set_lazy_compile", &warp::setLazyCompile, py::arg("is_lazy"));
  m.def("set_compile_threads", &warp::setCompileThreads, py::arg("count"));
  m.def("set_assembler", &warp::setAssembler, py::arg("file"));
  m.def("share_with_others", &warp::shareWithOthers,
        "Launches wait for their code themselves from now on: other libraries "
        "use the memory or the streams.");
  m.def(
      "note_foreign",
      [](int device, uintptr_t memory, bool isOwned) {
        if (warp::isLazyCompile() &&
            (isOwned ||
             warp::memoryKind(device, reinterpret_cast<void *>(memory)) !=
                 warp::MemoryKind::Pool))
          warp::shareWithOthers();
      },
      py::arg("device"), py::arg("ptr"), py::arg("is_owned"),
      "The same, if memory that somebody names by an address is not from our "
      "pools, or goes by its owner's function.");
  m.def("queued_operations", &warp::queuedOperations,
        "Launches, and what is behind them, that wait for code.");
  m.def(
      "queued_value",
      [](uintptr_t memory) -> py::object {
        int32_t value;
        if (!warp::findQueuedFill(reinterpret_cast<void *>(memory), &value,
                                  sizeof(value)))
          return py::none();
        return py::int_(value);
      },
      py::arg("ptr"),
      "The int32 that fills that wait for code will leave, None if not known.");
  m.def("finish_queued_launches", &warp::finishQueuedLaunches,
        "Waits for launches that wait for code, and raises what failed.");
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
