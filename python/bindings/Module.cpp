//===- Module.cpp - The extension module warp._native ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Geometry.h"
#include "Gil.h"
#include "Native.h"

void bindTileBuilder(pybind11::module_ &m);

PYBIND11_MODULE(_native, m) {
  m.doc() = "Compiler and runtime of the warp package; use `warp` instead.";
  warp::python::bindErrors(m);
  warp::python::bindScopes(m);
  bindBuilder(m);
  bindTileBuilder(m);
  warp::python::bindAutodiff(m);
  warp::python::bindGather(m);
  warp::python::bindDevices(m);
  warp::python::bindMemory(m);
  warp::python::bindPeers(m);
  warp::python::bindSequences(m);
  warp::python::bindArray(m);
  warp::python::bindKernel(m);
  warp::python::bindRegions(m);
  warp::python::bindRequests(m);
  warp::python::bindSavedModule(m);
  warp::python::bindGeometry(m);
  warp::python::bindGraph(m);
  warp::python::bindDlpack(m);
  warp::python::bindXlaFfi(m);
  warp::python::watchWaits(m);
  warp::python::watchExit(m);
}
