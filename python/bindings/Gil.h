//===- Gil.h - Release of the GIL -------------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A daemon thread outlives the interpreter. When it asks for the lock again,
// Python ends the thread by an exception that no C++ frame may hold up, so the
// process would abort. `Unlocked` therefore keeps such a thread waiting once
// the interpreter has begun to exit, and the exit waits for those that were on
// their way back.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_GIL_H
#define WARP_PYTHON_BINDINGS_GIL_H

#include <pybind11/pybind11.h>

namespace warp::python {

/// Gives up Python's lock until the end of the scope.
class Unlocked {
public:
  Unlocked() : state(PyEval_SaveThread()) {}
  Unlocked(const Unlocked &) = delete;
  ~Unlocked() { takeLock(state); }

  static void takeLock(PyThreadState *state);

private:
  PyThreadState *state;
};

/// Lets threads of Python run while one waits for the code of launches, and
/// tells the runtime of Ctrl-C.
void watchWaits(pybind11::module_ &m);

/// Makes the exit of the interpreter known; by the thread that will do it.
void watchExit(pybind11::module_ &m);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_GIL_H
