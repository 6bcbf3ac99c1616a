//===- Recording.h - Replay of the forward kernel ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_RECORDING_H
#define WARP_TRANSFORMS_AUTODIFF_RECORDING_H

#include "llvm/ADT/StringRef.h"

namespace warp::attr {
/// On a function next to an adjoint: it runs the kernel again, on copies of
/// what that writes, and keeps what loops read.
constexpr llvm::StringLiteral recording = "warp.recording";
/// On a function next to that: it finds how many values each thread keeps.
constexpr llvm::StringLiteral sizing = "warp.sizing";
/// On a kernel: there is no copy of what its launch has overwritten, but what
/// it has left. The recording finds out whether that is enough.
constexpr llvm::StringLiteral unrecorded = "warp.unrecorded";
} // namespace warp::attr

#endif // WARP_TRANSFORMS_AUTODIFF_RECORDING_H
