//===- Geometry.h - Meshes, hierarchies and grids for Python ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_GEOMETRY_H
#define WARP_PYTHON_BINDINGS_GEOMETRY_H

#include <pybind11/pybind11.h>

namespace warp::python {
void bindGeometry(pybind11::module_ &m);
} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_GEOMETRY_H
