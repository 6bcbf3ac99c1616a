//===- Geometry.h - Meshes, hierarchies and grids for Python ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_GEOMETRY_H
#define WARP_PYTHON_BINDINGS_GEOMETRY_H

#include "Native.h"

#include <pybind11/pybind11.h>

#include <new>

namespace warp::python {

void bindGeometry(pybind11::module_ &m);
void bindVolumes(pybind11::module_ &m);

inline const ArrayDescriptor &descriptorOf(pybind11::handle array) {
  if (!isArray(array.ptr()))
    throw pybind11::type_error("expects an array");
  return asArray(array.ptr())->descriptor;
}

inline ArrayDescriptor optionalOf(pybind11::handle array) {
  return array.is_none() ? ArrayDescriptor() : descriptorOf(array);
}

/// Calls what builds something of a number of elements, without Python's lock.
template <class Build>
auto building(const char *what, int64_t count, const char *elements,
              Build build) {
  pybind11::gil_scoped_release unlocked;
  try {
    return build();
  } catch (const std::bad_alloc &) {
    throw Error(Error::Kind::Memory,
                "out of memory on 'cpu' while a " + std::string(what) + " of " +
                    std::to_string(count) + ' ' + elements + " was built");
  }
}

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_GEOMETRY_H
