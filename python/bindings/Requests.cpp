//===- Requests.cpp - Persistent requests of MPI --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A halo of a few kilobytes takes about a microsecond, as much as three calls
// of mpi4py, each of which copies handles and releases the GIL. So requests are
// started and tested here, by two functions of the library that mpi4py has
// loaded. Both take handles by address, and so are called alike whatever a
// handle is.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"
#include "Native.h"

#include <cstring>
#include <vector>

namespace py = pybind11;
using namespace warp::python;

namespace {
using StartAll = int (*)(int count, void *requests);
using TestAll = int (*)(int count, void *requests, int *flag, void *statuses);

/// Bytes of an `MPI_Status`, at most: those of MPI libraries have 20 to 40.
constexpr size_t statusSize = 64;
/// In place of an error of MPI, which is positive.
constexpr int isWaiting = -1;

struct Requests {
  StartAll startAll = nullptr;
  TestAll testAll = nullptr;
  int count = 0;
  int looks = 0;
  /// Words, so that handles and statuses are aligned.
  std::vector<uint64_t> handles, statuses;
  /// Number and step of the plan, and where the rank notes them, or null.
  int64_t *plan = nullptr, *log = nullptr;

  void note() {
    if (!plan)
      return;
    log[0] = plan[0];
    log[1] = ++plan[1];
  }

  int start() { return startAll(count, handles.data()); }

  int wait() {
    for (int i = 0; i < looks; ++i) {
      int isDone = 0;
      int error = testAll(count, handles.data(), &isDone, statuses.data());
      if (error || isDone)
        return error;
    }
    return isWaiting;
  }
};

struct RequestsObject {
  PyObject base;
  Requests *requests;
};
} // namespace

static Requests &requestsOf(PyObject *self) {
  return *reinterpret_cast<RequestsObject *>(self)->requests;
}

static PyObject *newRequests(PyTypeObject *type, PyObject *arguments,
                             PyObject *) {
  unsigned long long start, test;
  PyObject *handles;
  int count, looks;
  if (!PyArg_ParseTuple(arguments, "KKSii", &start, &test, &handles, &count,
                        &looks))
    return nullptr;
  PyObject *self = type->tp_alloc(type, 0);
  if (!self)
    return nullptr;
  auto *made = new Requests;
  made->startAll = reinterpret_cast<StartAll>(start);
  made->testAll = reinterpret_cast<TestAll>(test);
  made->count = count;
  made->looks = looks;
  Py_ssize_t size = PyBytes_GET_SIZE(handles);
  made->handles.resize(size / sizeof(uint64_t) + 1);
  std::memcpy(made->handles.data(), PyBytes_AS_STRING(handles), size);
  made->statuses.resize(statusSize / sizeof(uint64_t) * count);
  reinterpret_cast<RequestsObject *>(self)->requests = made;
  return self;
}

static void freeRequests(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  delete &requestsOf(self);
  type->tp_free(self);
  Py_DECREF(type);
}

static PyObject *note(PyObject *self, PyObject *arguments) {
  unsigned long long plan, log;
  if (!PyArg_ParseTuple(arguments, "KK", &plan, &log))
    return nullptr;
  requestsOf(self).plan = reinterpret_cast<int64_t *>(plan);
  requestsOf(self).log = reinterpret_cast<int64_t *>(log);
  Py_RETURN_NONE;
}

static PyObject *startRequests(PyObject *self, PyObject *) {
  int error;
  {
    Unlocked unlocked;
    error = requestsOf(self).start();
  }
  return PyLong_FromLong(error);
}

static PyObject *waitForRequests(PyObject *self, PyObject *) {
  int error;
  {
    Unlocked unlocked;
    error = requestsOf(self).wait();
  }
  return PyLong_FromLong(error);
}

static PyObject *runRequests(PyObject *self, PyObject *) {
  int error;
  {
    Unlocked unlocked;
    requestsOf(self).note();
    error = requestsOf(self).start();
    if (!error)
      error = requestsOf(self).wait();
  }
  return PyLong_FromLong(error);
}

void warp::python::bindRequests(py::module_ &m) {
  static PyMethodDef methods[] = {
      {"note", note, METH_VARARGS,
       "note(plan, log): addresses of two words, the number and the step of "
       "the plan, which `run` counts, and of two that get both."},
      {"start", startRequests, METH_NOARGS,
       "Starts all; gives the error of MPI, or 0."},
      {"wait", waitForRequests, METH_NOARGS,
       "Tests as often as the constructor was told; gives 0 once all have "
       "ended, the error of MPI, or -1 if they have not ended."},
      {"run", runRequests, METH_NOARGS,
       "Notes a step, then does `start` and `wait`."},
      {nullptr, nullptr, 0, nullptr}};
  static PyType_Slot slots[] = {
      {Py_tp_new, reinterpret_cast<void *>(newRequests)},
      {Py_tp_dealloc, reinterpret_cast<void *>(freeRequests)},
      {Py_tp_methods, methods},
      {Py_tp_doc,
       const_cast<char *>(
           "Requests(start, test, handles, count, looks): persistent requests "
           "of MPI. The first two are the addresses of MPI_Startall and "
           "MPI_Testall.")},
      {0, nullptr}};
  static PyType_Spec spec = {"warp._native.Requests",
                             int(sizeof(RequestsObject)), 0,
                             unsigned(Py_TPFLAGS_DEFAULT), slots};
  PyObject *type = PyType_FromSpec(&spec);
  if (!type)
    throw py::error_already_set();
  m.add_object("Requests", py::reinterpret_steal<py::object>(type));
}
