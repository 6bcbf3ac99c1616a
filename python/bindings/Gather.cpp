//===- Gather.cpp - Adjoints of stencils without atomics ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"
#include "Native.h"

#include "warp/Gather.h"

#include <pybind11/stl.h>

namespace py = pybind11;
using namespace warp;

void python::bindGather(py::module_ &m) {
  py::class_<GatheredAdjoint>(m, "GatheredAdjoint", "An adjoint in two parts.")
      .def_readonly("sums", &GatheredAdjoint::sums)
      .def_readonly("halo", &GatheredAdjoint::halo)
      .def_readonly("rest", &GatheredAdjoint::rest)
      .def_readonly("atomics", &GatheredAdjoint::atomics);
  m.def("gather_sums", gatherSums, py::arg("adjoint"),
        py::call_guard<warp::python::Unlocked>(),
        "Takes sums over neighbours out of an adjoint; None without such.");
}
