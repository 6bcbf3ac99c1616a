//===- Pybind.h - Headers of pybind11 that are compiled once ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Precompiled, with the functions that it defines, and put before every source
// of the module (WarpPrecompile.cmake). Sources include what they use all the
// same, and build without it (WARP_PRECOMPILE=OFF).
//
//===----------------------------------------------------------------------===//

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
