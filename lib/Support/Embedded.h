//===- Embedded.h - Embedded resources of the build -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_SUPPORT_EMBEDDED_H
#define WARP_LIB_SUPPORT_EMBEDDED_H

#include <string_view>
#include <vector>

/// Defines `name`, a function that gives what cmake/WarpEmbed.cmake has
/// embedded under that name.
#define WARP_EMBEDDED(name)                                                    \
  extern "C" const char warp_##name##_begin[], warp_##name##_end[];            \
  static std::string_view name() {                                             \
    return {warp_##name##_begin,                                               \
            size_t(warp_##name##_end - warp_##name##_begin)};                  \
  }

namespace warp {

/// One frame of zstd, as cmake/WarpEmbed.cmake makes them; nothing if it cannot
/// be read.
std::vector<char> decompress(std::string_view packed);

} // namespace warp

#endif // WARP_LIB_SUPPORT_EMBEDDED_H
