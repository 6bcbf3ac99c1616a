//===- KernelObject.h - warp._native.Kernel ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_KERNELOBJECT_H
#define WARP_PYTHON_BINDINGS_KERNELOBJECT_H

#include "Pack.h"

#include "warp/Kernel.h"

namespace warp::python {

/// The instance layout of `warp._native.Kernel`.
struct KernelObject {
  PyObject base;
  Kernel *kernel;
  Packer *packer;
};

extern PyTypeObject *kernelType;

inline KernelObject *asKernel(PyObject *object) {
  return reinterpret_cast<KernelObject *>(object);
}

/// Runs `fn` and turns what it throws into a Python error.
template <typename Fn> PyObject *guarded(Fn &&fn) {
  try {
    return fn();
  } catch (const Error &error) {
    setPythonError(error);
  } catch (pybind11::error_already_set &error) {
    error.restore();
  } catch (const pybind11::cast_error &error) {
    PyErr_SetString(PyExc_TypeError, error.what());
  } catch (const std::exception &error) {
    PyErr_SetString(PyExc_RuntimeError, error.what());
  }
  return nullptr;
}

/// The method that runs kernels, in Launch.cpp.
PyObject *launch(PyObject *self, PyObject *const *args, Py_ssize_t count);
/// The one that runs adjoints, in AdjointLaunch.cpp.
PyObject *launchAdjoint(PyObject *self, PyObject *const *args,
                        Py_ssize_t count);
/// The one that runs a single thread on the CPU, which no graph records.
PyObject *evaluate(PyObject *self, PyObject *const *args, Py_ssize_t count);
void bindPackedLaunch(pybind11::module_ &m);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_KERNELOBJECT_H
