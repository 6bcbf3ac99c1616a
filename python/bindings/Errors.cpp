//===- Errors.cpp - Python exceptions of warp::Error ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The classes live in `warp._src.errors`, which also lays out the message with
// the source line. Without that module (the extension used alone) an error is
// a RuntimeError.
//
//===----------------------------------------------------------------------===//

#include "Native.h"

namespace py = pybind11;
using namespace warp;

static const char *kindName(Error::Kind kind) {
  switch (kind) {
  case Error::Kind::Type:
    return "type";
  case Error::Kind::Value:
    return "value";
  case Error::Kind::Index:
    return "index";
  case Error::Kind::Attribute:
    return "attribute";
  case Error::Kind::Key:
    return "key";
  case Error::Kind::Overflow:
    return "overflow";
  case Error::Kind::Parse:
    return "parse";
  case Error::Kind::Compile:
    return "compile";
  case Error::Kind::Launch:
    return "launch";
  case Error::Kind::LaunchType:
    return "launchtype";
  case Error::Kind::LaunchValue:
    return "launchvalue";
  case Error::Kind::Runtime:
    return "runtime";
  case Error::Kind::Memory:
    return "memory";
  }
  return "runtime";
}

/// The exception object, or null with a Python error set.
static PyObject *makeException(const Error &error) {
  PyObject *module = PyImport_ImportModule("warp._src.errors");
  if (!module)
    return nullptr;
  PyObject *made = PyObject_CallMethod(
      module, "from_native", "sssii", kindName(error.kind),
      error.message.c_str(), error.file.c_str(), error.line, error.column);
  Py_DECREF(module);
  return made;
}

void python::setPythonError(const Error &error) {
  PyObject *exception = makeException(error);
  if (!exception) {
    PyErr_Clear();
    PyErr_SetString(PyExc_RuntimeError, error.what());
    return;
  }
  PyErr_SetObject(reinterpret_cast<PyObject *>(Py_TYPE(exception)), exception);
  Py_DECREF(exception);
}

void python::bindErrors(py::module_ &) {
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      std::rethrow_exception(pointer);
    } catch (const Error &error) {
      setPythonError(error);
    } catch (const py::cast_error &error) {
      // A value inside of a function that is no such number or object.
      setPythonError(Error(Error::Kind::LaunchType, error.what()));
    }
  });
}
