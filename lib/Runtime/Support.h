//===- Support.h - Utilities of the runtime ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_SUPPORT_H
#define WARP_LIB_RUNTIME_SUPPORT_H

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace warp {

inline int64_t ceilDivide(int64_t a, int64_t b) { return (a + b - 1) / b; }

/// "4.0 GiB".
std::string formatBytes(uint64_t bytes);

/// 64-bit hash of a byte string; a change of any bit changes it.
uint64_t hashBytes(const void *data, size_t size, uint64_t seed = 0);

/// True for an object file, false for text.
inline bool isElf(const std::vector<char> &bytes) {
  return bytes.size() > 4 && std::memcmp(bytes.data(), "\177ELF", 4) == 0;
}

/// A copy of a name that lives as long as the process.
const char *permanentName(const std::string &name);

/// Value of an environment variable, or the empty string.
std::string environment(const char *name);

} // namespace warp

#endif // WARP_LIB_RUNTIME_SUPPORT_H
