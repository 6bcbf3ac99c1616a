//===- Embedded.h - Bytes that the build has compressed ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_EMBEDDED_H
#define WARP_LIB_COMPILER_EMBEDDED_H

#include "llvm/ADT/StringRef.h"

#include <vector>

namespace warp {

/// One frame of zstd, as cmake/WarpEmbed.cmake makes them; nothing if it cannot
/// be read.
std::vector<char> decompress(llvm::StringRef packed);

/// The device library for GPUs without and with functions of tiles, and
/// NVIDIA's functions of libdevice, as LLVM bitcode.
llvm::StringRef gpuLibrary();
llvm::StringRef gpuTileLibrary();
llvm::StringRef libdevice();

} // namespace warp

#endif // WARP_LIB_COMPILER_EMBEDDED_H
