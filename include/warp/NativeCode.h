//===- NativeCode.h - Functions that users wrote in C++ ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel may call a function that a compiler for C++ has made bitcode of. It
// takes scalars by value, then a pointer to its result, like the functions of
// the device library, and is linked into the kernel; on CPUs only.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_NATIVECODE_H
#define WARP_NATIVECODE_H

#include "warp/Export.h"

#include <string>

namespace warp {

/// What names of such functions start with. Cached code is found by the name,
/// so the rest of it tells the function's code.
inline constexpr char nativeCodePrefix[] = "warp_native_";
/// Those that read and write memory, at addresses among their arguments.
inline constexpr char nativeMemoryPrefix[] = "warp_native_memory_";

/// Makes the bitcode that defines `symbol` known to the process.
WARP_API void addNativeCode(const std::string &symbol, std::string bitcode);

} // namespace warp

#endif // WARP_NATIVECODE_H
