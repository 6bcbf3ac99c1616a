//===- Embedded.cpp - Bytes that the build has compressed -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Embedded.h"

#include <zstd.h>

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

// What a process compiles with lives as long as it.
#define WARP_EMBEDDED(function, name)                                          \
  extern "C" const char warp_##name##_begin[], warp_##name##_end[];            \
  llvm::StringRef warp::function() {                                           \
    static const auto *bytes = new std::vector<char>(                          \
        decompress({warp_##name##_begin,                                       \
                    size_t(warp_##name##_end - warp_##name##_begin)}));        \
    return {bytes->data(), bytes->size()};                                     \
  }
WARP_EMBEDDED(gpuLibrary, devicelib_cuda)
WARP_EMBEDDED(gpuTileLibrary, devicelib_tiles)
WARP_EMBEDDED(libdevice, libdevice)
