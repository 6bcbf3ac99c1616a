//===- Sharing.h - Arrays that share memory ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_SHARING_H
#define WARP_PYTHON_BINDINGS_SHARING_H

#include <pybind11/pybind11.h>

#include <vector>

namespace warp::python {

/// True if an address may belong to two elements of some arrays.
bool sharesElements(const std::vector<pybind11::object> &arrays);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_SHARING_H
