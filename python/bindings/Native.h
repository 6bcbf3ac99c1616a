//===- Native.h - The extension module's parts ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `warp._native` is a thin layer over include/warp. The types of launches
// (arrays, kernels) are types written against the C API, because a launch has
// about a microsecond; everything else is pybind11.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_NATIVE_H
#define WARP_PYTHON_BINDINGS_NATIVE_H

#include "warp/Device.h"
#include "warp/Error.h"
#include "warp/Launch.h"

#include <pybind11/pybind11.h>

#include <string>

namespace warp::python {

void bindArray(pybind11::module_ &m);
void bindAutodiff(pybind11::module_ &m);
void bindDevices(pybind11::module_ &m);
void bindDlpack(pybind11::module_ &m);
void bindErrors(pybind11::module_ &m);
void bindGather(pybind11::module_ &m);
void bindGraph(pybind11::module_ &m);
void bindKernel(pybind11::module_ &m);
void bindMemory(pybind11::module_ &m);
void bindPeers(pybind11::module_ &m);
void bindRegions(pybind11::module_ &m);
void bindRequests(pybind11::module_ &m);
void bindSavedModule(pybind11::module_ &m);
void bindScopes(pybind11::module_ &m);
void bindSequences(pybind11::module_ &m);
void bindXlaFfi(pybind11::module_ &m);

/// The device of arrays and launches that name none.
constexpr int defaultDevice = cpuDevice;

/// Sets the Python exception for an error.
void setPythonError(const Error &error);

/// A number per type text, so that launches compare ints.
int typeId(const std::string &text);
const std::string &typeText(int id);
/// Python's name of a type: "float32" for "f32".
std::string pythonTypeName(const std::string &text);

/// Graphs being recorded; guarded by the GIL.
extern int capturesInProgress;
void holdForCaptures(int device, PyObject *object);

/// Lets graphs that are being recorded on a device keep an object.
inline void hold(int device, PyObject *object) {
  if (__builtin_expect(capturesInProgress != 0, 0))
    holdForCaptures(device, object);
}

/// The same for work of this thread on the host.
inline void hold(PyObject *object) { hold(cpuDevice, object); }

/// Bits of `ArrayDescriptor::flags` below those of `ArrayFact`, in Python's
/// structs: the memory must not be written; the array's device plus 2, or 0 if
/// all devices reach it.
constexpr int readOnlyFlag = 1 << 16, ownerMask = readOnlyFlag - 1;

/// The instance layout of `warp._native.Array`.
struct ArrayObject {
  PyObject base;
  ArrayDescriptor descriptor;
  PyObject *dtype;
  PyObject *owner;
  PyObject *shape;
  PyObject *strides;
  int64_t itemSize;
  int typeId;
  /// The key that packing compares first: `typeId`, or -1 for memory that must
  /// not be written and for `describesItself`, which take the way with all
  /// checks.
  int packId;
  int device;
  bool pinned;
  /// Memory of a library that allows no writing.
  bool readOnly;
  /// Launches ask `__ctype__` of a derived class for the memory.
  bool describesItself;
  /// Adjoint launches leave the gradient, which they otherwise set to zero
  /// where they overwrite the array.
  bool retainsGradient;

  bool isContiguous() const { return descriptor.flags & arrayPacked; }
};

extern PyTypeObject *arrayType;

/// A method with any of C's calling conventions as the table wants it.
template <typename Fn> PyCFunction asMethod(Fn *function) {
  return reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(function));
}

inline bool isArray(PyObject *object) {
  return Py_TYPE(object) == arrayType ||
         PyType_IsSubtype(Py_TYPE(object), arrayType);
}

inline ArrayObject *asArray(PyObject *object) {
  return reinterpret_cast<ArrayObject *>(object);
}

/// Native type text of a Python class, from the resolver that the package
/// registered; empty if it has none.
std::string resolveType(PyTypeObject *type);

} // namespace warp::python

/// The builder half, in Builder.cpp.
void bindBuilder(pybind11::module_ &m);

#endif // WARP_PYTHON_BINDINGS_NATIVE_H
