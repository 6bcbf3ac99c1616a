//===- Embedded.cpp - Bytes that the build has embedded -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Embedded.h"

#include <zstd.h>

WARP_EMBEDDED(devicelib_cuda)
WARP_EMBEDDED(devicelib_tiles)
WARP_EMBEDDED(libdevice)

std::vector<char> warp::decompress(llvm::StringRef packed) {
  constexpr unsigned long long most = 1u << 30;
  auto size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (packed.empty() || size > most)
    return {};
  std::vector<char> bytes(size);
  if (ZSTD_decompress(bytes.data(), size, packed.data(), packed.size()) != size)
    return {};
  return bytes;
}

// Objects that a process compiles with live as long as it.
#define WARP_KEPT(function, packed)                                            \
  llvm::StringRef warp::function() {                                           \
    static const auto *bytes = new std::vector<char>(decompress(packed()));    \
    return {bytes->data(), bytes->size()};                                     \
  }
WARP_KEPT(gpuLibrary, devicelib_cuda)
WARP_KEPT(gpuTileLibrary, devicelib_tiles)
WARP_KEPT(libdevice, ::libdevice)
