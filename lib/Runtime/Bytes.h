//===- Bytes.h - Numbers and strings in files -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_BYTES_H
#define WARP_LIB_RUNTIME_BYTES_H

#include "warp/Compile.h"

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

namespace warp {

/// Appends numbers as they lie in memory and strings behind their length.
class Writer {
public:
  template <typename T> void number(T value) {
    bytes.append(reinterpret_cast<const char *>(&value), sizeof(T));
  }
  void string(const char *data, size_t size) {
    number<uint64_t>(size);
    bytes.append(data, size);
  }
  void string(const std::string &text) { string(text.data(), text.size()); }

  std::string bytes;
};

/// Reads what a `Writer` wrote, and trusts nothing: what goes beyond the end
/// gives zero and turns `ok` off.
class Reader {
public:
  Reader(const char *data, size_t size) : data(data), left(size) {}

  template <typename T> T number() {
    T value{};
    if (take(sizeof(T)))
      std::memcpy(&value, data - sizeof(T), sizeof(T));
    return value;
  }
  std::string string() {
    auto size = number<uint64_t>();
    if (size > left) {
      good = false;
      return {};
    }
    take(size);
    return std::string(data - size, size);
  }
  bool atEnd() const { return good && left == 0; }
  bool ok() const { return good; }

private:
  bool take(size_t size) {
    good = good && size <= left;
    if (!good)
      return false;
    data += size;
    left -= size;
    return true;
  }

  const char *data;
  size_t left;
  bool good = true;
};

/// The fields of `Code`, in the kernel cache and in saved modules.
void writeCode(Writer &out, const Code &code);
Code readCode(Reader &in);
void writeParam(Writer &out, const Param &param);
Param readParam(Reader &in);
void writeAccess(Writer &out, const Access &access);
Access readAccess(Reader &in);

/// A payload behind what tells that it is whole, and that of this key (64
/// characters): magic | version | key | length | hash.
std::string seal(const char (&magic)[8], uint32_t version,
                 const std::string &key, const std::string &payload);
/// The payload, a part of `bytes`; nothing if they are not exactly right.
std::optional<std::string_view> unseal(const char (&magic)[8],
                                       uint32_t version,
                                       const std::string &key,
                                       const std::string &bytes);

/// Bytes of a regular file; nothing if it cannot be read.
std::optional<std::string> readFile(const std::string &path);
/// Writes a file that must not exist yet.
bool writeFile(const std::string &path, const std::string &bytes);

} // namespace warp

#endif // WARP_LIB_RUNTIME_BYTES_H
