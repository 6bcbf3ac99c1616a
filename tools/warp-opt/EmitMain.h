//===- EmitMain.h - Text output of the library's emitters -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TOOLS_WARPOPT_EMITMAIN_H
#define WARP_TOOLS_WARPOPT_EMITMAIN_H

#include <optional>

/// Handles a command line with --warp-emit; returns the exit status, or
/// nothing if the flag is not there.
std::optional<int> emitMain(int argc, char **argv);

#endif // WARP_TOOLS_WARPOPT_EMITMAIN_H
