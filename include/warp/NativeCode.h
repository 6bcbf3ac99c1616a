//===- NativeCode.h - User functions in C++ ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel may call a function whose text is C++ or CUDA. It takes scalars by
// value, then a pointer to its results, like the functions of the device
// library. It is compiled when a kernel that calls it is: for CPUs by Clang,
// whose bitcode is linked into the kernel, for GPUs by NVRTC, whose PTX becomes
// part of the kernel's.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_NATIVECODE_H
#define WARP_NATIVECODE_H

#include "warp/Export.h"

#include <string>
#include <vector>

namespace warp {

/// The prefix of the names of such functions. Cached code is found by the name,
/// so the rest of it tells the function's code.
inline constexpr char nativeCodePrefix[] = "warp_native_";
/// Functions that read and write memory, or that threads do together: they stay
/// where they stand.
inline constexpr char nativeMemoryPrefix[] = "warp_native_memory_";
/// Functions with atomics, which may tell which thread came first.
inline constexpr char nativeTurnPrefix[] = "warp_native_memory_turn_";

struct NativeCode {
  /// The name of the function, for messages.
  std::string name;
  /// Defines `extern "C" void SYMBOL(..., Results *)`; `__CUDACC_RTC__` tells
  /// that it is for a GPU.
  std::string text;
  /// The text of a message about it: a place in the user's program and its
  /// line, with '%' where the problem comes; empty for the problem alone.
  std::string place;
  /// Folders of headers, for CPUs and for GPUs.
  std::vector<std::string> cpuFolders = {}, gpuFolders = {};
};

/// Makes the function `symbol` known to the process.
WARP_API void addNativeCode(const std::string &symbol, NativeCode code);

/// Folders where NVRTC is looked for, after what WARP_NVRTC names and before
/// what the system finds.
WARP_API void setNvrtcFolders(std::vector<std::string> folders);

/// The Clang that compiles functions for CPUs, which WARP_CLANG may name, or
/// the NVRTC that compiles them for GPUs; empty if there is none.
WARP_API std::string nativeCompiler(bool gpu);

} // namespace warp

#endif // WARP_NATIVECODE_H
