//===- Embedded.cpp - Bytes that the build has compressed -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Embedded.h"

#include <zstd.h>

extern "C" const char warp_libdevice_begin[], warp_libdevice_end[];
extern "C" const char warp_devicelib_cuda_begin[], warp_devicelib_cuda_end[];

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

/// What a process compiles with lives as long as it.
static llvm::StringRef keep(llvm::StringRef packed) {
  auto *bytes = new std::vector<char>(warp::decompress(packed));
  return {bytes->data(), bytes->size()};
}

llvm::StringRef warp::gpuLibrary() {
  static llvm::StringRef library =
      keep({warp_devicelib_cuda_begin,
            size_t(warp_devicelib_cuda_end - warp_devicelib_cuda_begin)});
  return library;
}

llvm::StringRef warp::libdevice() {
  static llvm::StringRef library = keep(
      {warp_libdevice_begin, size_t(warp_libdevice_end - warp_libdevice_begin)});
  return library;
}
