//===- NativeCompilers.h - Compilers for user functions ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_NATIVECOMPILERS_H
#define WARP_LIB_COMPILER_NATIVECOMPILERS_H

#include "warp/NativeCode.h"

namespace warp {

/// Bitcode for the host by Clang. Throws std::runtime_error, with Clang's
/// words if there is one.
std::string compileForCpu(const NativeCode &code);

/// PTX for an architecture such as "sm_90" by NVRTC. Throws
/// std::runtime_error, with NVRTC's words if there is one.
std::string compileForGpu(const NativeCode &code,
                          const std::string &architecture);

} // namespace warp

#endif // WARP_LIB_COMPILER_NATIVECOMPILERS_H
