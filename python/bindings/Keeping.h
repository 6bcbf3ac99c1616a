//===- Keeping.h - Copy-on-write of recorded memory -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_KEEPING_H
#define WARP_PYTHON_BINDINGS_KEEPING_H

#include "Versions.h"

namespace warp::python {

/// The packed array with all that a version is of, if that is the whole of a
/// packed array and was kept in one piece; else null. Borrowed.
PyObject *keptContents(VersionObject *version, PyObject *array);

void bindKeeping(pybind11::module_ &m);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_KEEPING_H
