//===- Embedded.cpp - Bytes that the build has embedded -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Embedded.h"

#include <zstd.h>

std::vector<char> warp::decompress(std::string_view packed) {
  constexpr unsigned long long most = 1u << 30;
  auto size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (packed.empty() || size > most)
    return {};
  std::vector<char> bytes(size);
  if (ZSTD_decompress(bytes.data(), size, packed.data(), packed.size()) != size)
    return {};
  return bytes;
}
