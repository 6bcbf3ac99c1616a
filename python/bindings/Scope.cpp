//===- Scope.cpp - Interrupt-safe scopes and finalizers -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Python runs signal handlers, and raises what threads send each other, between
// any two steps of its own functions, the first of `__enter__` and `__exit__`
// too. Native functions have no such steps. So these call the Python functions
// of a block or a finalizer, and where an interrupt breaks one that brings back
// state they call it again, until it has ended. The interrupt goes on after.
//
//===----------------------------------------------------------------------===//

#include "Native.h"

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

/// Calls of a function that interrupts break, and of one with another error:
/// that may come from a signal handler, too.
static constexpr int mostCalls = 100, mostFailures = 3;

namespace {
/// The exception of this thread, put aside.
class Exception {
public:
  Exception() { PyErr_Fetch(&type, &value, &traceback); }
  Exception(const Exception &) = delete;
  ~Exception() {
    Py_XDECREF(type);
    Py_XDECREF(value);
    Py_XDECREF(traceback);
  }
  explicit operator bool() const { return type != nullptr; }
  PyObject *kind() const { return type; }
  /// True if it comes from outside of what was going on, like Ctrl-C.
  bool isInterrupt() const {
    return type && !PyErr_GivenExceptionMatches(type, PyExc_Exception);
  }
  void raise() {
    PyErr_Restore(type, value, traceback);
    type = value = traceback = nullptr;
  }
  void swap(Exception &other) {
    std::swap(type, other.type);
    std::swap(value, other.value);
    std::swap(traceback, other.traceback);
  }

private:
  PyObject *type = nullptr, *value = nullptr, *traceback = nullptr;
};
} // namespace

static PyObject *nameOfCheck, *nameOfEnter, *nameOfLeave, *nameOfRestore,
    *nameOfRelease;

//===----------------------------------------------------------------------===//
// Blocks
//===----------------------------------------------------------------------===//

/// Calls `_restore` until it ends; false with the first exception on the way.
/// It brings back what is left of `_enter`, and does nothing the second time.
static bool restore(PyObject *self) {
  Exception first;
  int failures = 0;
  for (int i = 0; i < mostCalls && failures < mostFailures; ++i) {
    PyObject *done = PyObject_CallMethodNoArgs(self, nameOfRestore);
    Py_XDECREF(done);
    if (done)
      break;
    Exception broken;
    failures += !broken.isInterrupt();
    if (!first)
      first.swap(broken);
  }
  if (!first)
    return true;
  first.raise();
  return false;
}

/// A block that was not entered leaves no trace; one that was refused at first
/// has none.
static PyObject *enter(PyObject *self, PyObject *) {
  PyObject *checked = PyObject_CallMethodNoArgs(self, nameOfCheck);
  if (!checked)
    return nullptr;
  Py_DECREF(checked);
  PyObject *entered = PyObject_CallMethodNoArgs(self, nameOfEnter);
  if (entered)
    return entered;
  Exception why;
  if (!restore(self))
    PyErr_Clear();
  why.raise();
  return nullptr;
}

static PyObject *leave(PyObject *self, PyObject *arguments) {
  PyObject *kind, *value, *traceback;
  if (!PyArg_UnpackTuple(arguments, "__exit__", 3, 3, &kind, &value,
                         &traceback))
    return nullptr;
  PyObject *left = PyObject_CallMethodObjArgs(self, nameOfLeave, kind, value,
                                              traceback, nullptr);
  Exception why;
  if (!restore(self) && !why) {
    Exception broken;
    // The error of the block says more, but goes on by itself.
    if (kind == Py_None || broken.isInterrupt())
      why.swap(broken);
  }
  if (!why)
    return left;
  Py_XDECREF(left);
  PyErr_Clear();
  why.raise();
  return nullptr;
}

static PyObject *enterNothing(PyObject *self, PyObject *) {
  return Py_NewRef(self);
}

static PyObject *leaveNothing(PyObject *, PyObject *) { Py_RETURN_NONE; }

//===----------------------------------------------------------------------===//
// Finalizers
//===----------------------------------------------------------------------===//

/// Calls a function that must end where nobody can be told of an exception. An
/// interrupt is raised again where the thread was, and the function is called
/// again.
static void insist(PyObject *function) {
  Exception outer, interrupt;
  for (int i = 0; i < mostCalls; ++i) {
    PyObject *done = PyObject_CallNoArgs(function);
    Py_XDECREF(done);
    if (done)
      break;
    Exception broken;
    if (!broken.isInterrupt()) {
      broken.raise();
      PyErr_WriteUnraisable(function);
      break;
    }
    interrupt.swap(broken);
  }
  if (interrupt)
    PyThreadState_SetAsyncExc(PyThread_get_thread_ident(), interrupt.kind());
  outer.raise();
}

static PyObject *release(PyObject *self, PyObject *) {
  Exception outer;
  PyObject *function = PyObject_GetAttr(self, nameOfRelease);
  if (function)
    insist(function);
  else
    PyErr_WriteUnraisable(self);
  Py_XDECREF(function);
  outer.raise();
  Py_RETURN_NONE;
}

/// A callable, which weak references call with themselves.
struct FinalizerObject {
  PyObject base;
  PyObject *function;
};

static PyObject *newFinalizer(PyTypeObject *type, PyObject *arguments,
                              PyObject *) {
  PyObject *function;
  if (!PyArg_UnpackTuple(arguments, "Finalizer", 1, 1, &function))
    return nullptr;
  PyObject *self = type->tp_alloc(type, 0);
  if (self)
    reinterpret_cast<FinalizerObject *>(self)->function = Py_NewRef(function);
  return self;
}

static PyObject *callFinalizer(PyObject *self, PyObject *, PyObject *) {
  insist(reinterpret_cast<FinalizerObject *>(self)->function);
  Py_RETURN_NONE;
}

static void freeFinalizer(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  Py_DECREF(reinterpret_cast<FinalizerObject *>(self)->function);
  type->tp_free(self);
  Py_DECREF(type);
}

//===----------------------------------------------------------------------===//
// Types
//===----------------------------------------------------------------------===//

static void addType(py::module_ &m, const char *name, size_t size,
                    unsigned long flags, PyType_Slot *slots) {
  std::string full = std::string("warp._native.") + name;
  PyType_Spec spec = {full.c_str(), int(size), 0,
                      unsigned(Py_TPFLAGS_DEFAULT | flags), slots};
  PyObject *type = PyType_FromSpec(&spec);
  if (!type)
    throw py::error_already_set();
  m.add_object(name, py::reinterpret_steal<py::object>(type));
}

void python::bindScopes(py::module_ &m) {
  nameOfCheck = PyUnicode_InternFromString("_check");
  nameOfEnter = PyUnicode_InternFromString("_enter");
  nameOfLeave = PyUnicode_InternFromString("_leave");
  nameOfRestore = PyUnicode_InternFromString("_restore");
  nameOfRelease = PyUnicode_InternFromString("_release");
  static PyMethodDef scopeMethods[] = {
      {"__enter__", enter, METH_NOARGS,
       "Enters the block, or leaves no trace."},
      {"__exit__", leave, METH_VARARGS, "Leaves the block in any case."},
      {"_check", leaveNothing, METH_NOARGS, "Throws if it cannot be entered."},
      {"_enter", enterNothing, METH_NOARGS,
       "Work of a class when the block begins."},
      {"_leave", leaveNothing, METH_VARARGS,
       "Work when it has ended, with the state of the block."},
      {"_restore", leaveNothing, METH_NOARGS, "Brings back the state before."},
      {nullptr, nullptr, 0, nullptr}};
  static PyType_Slot scopeSlots[] = {
      {Py_tp_methods, scopeMethods},
      {Py_tp_doc, const_cast<char *>("A block that interrupts cannot break.")},
      {0, nullptr}};
  addType(m, "Scope", sizeof(PyObject), Py_TPFLAGS_BASETYPE, scopeSlots);
  static PyMethodDef finalMethods[] = {
      {"__del__", release, METH_NOARGS,
       "Calls `_release`; an interrupt meanwhile is not lost."},
      {nullptr, nullptr, 0, nullptr}};
  static PyType_Slot finalSlots[] = {
      {Py_tp_methods, finalMethods},
      {Py_tp_doc,
       const_cast<char *>("A function that runs when an object is released.")},
      {0, nullptr}};
  addType(m, "Finalized", sizeof(PyObject), Py_TPFLAGS_BASETYPE, finalSlots);
  static PyType_Slot callableSlots[] = {
      {Py_tp_new, reinterpret_cast<void *>(newFinalizer)},
      {Py_tp_call, reinterpret_cast<void *>(callFinalizer)},
      {Py_tp_dealloc, reinterpret_cast<void *>(freeFinalizer)},
      {Py_tp_doc, const_cast<char *>("A function for `weakref.ref` to call, "
                                     "without arguments.")},
      {0, nullptr}};
  addType(m, "Finalizer", sizeof(FinalizerObject), 0, callableSlots);
}
