//===- Operations.h - Operations that are compiled once ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Precompiled on top of Upstream.h and put before every source that sees MLIR
// (WarpPrecompile.cmake): the declarations of our operations take more time to
// parse than most of our sources. Sources include what they use all the same,
// and build without it (WARP_PRECOMPILE=OFF).
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/WarpOps.h"
