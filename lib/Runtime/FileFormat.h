//===- FileFormat.h - File header: magic, version, hash ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Saved modules and saved graphs: magic | format version (32 bits) | length of
// the payload | its hash | payload, numbers little-endian. Reading trusts
// nothing.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_FILEFORMAT_H
#define WARP_LIB_RUNTIME_FILEFORMAT_H

#include "warp/Error.h"

#include <cstdint>
#include <string>
#include <string_view>

namespace warp {

struct FileFormat {
  /// Eight characters.
  std::string_view magic;
  uint32_t version;
  /// The kind of a file, and the remedy for one of another version, in errors.
  std::string_view name, remedy;

  Error error(const std::string &path, const std::string &problem) const;
  std::string wrap(const std::string &payload) const;
  /// The payload, a part of `bytes`; throws what is wrong with them.
  std::string_view unwrap(const std::string &bytes,
                          const std::string &path) const;
  /// Writes a file in one step: others see the old one or the new one.
  void replaceFile(const std::string &path, const std::string &bytes) const;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_FILEFORMAT_H
