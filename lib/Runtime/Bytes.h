//===- Bytes.h - Binary serialisation ---------------------------*- C++ -*-===//
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

/// Reads what a `Writer` wrote, and trusts nothing: what goes beyond the end or
/// is no possible value gives the least one, turns `ok` off and is the
/// `problem`, the first of which stays.
class Reader {
public:
  Reader(const char *data, size_t size) : data(data), left(size) {}

  template <typename T> T number() {
    T value{};
    if (take(sizeof(T)))
      std::memcpy(&value, data - sizeof(T), sizeof(T));
    return value;
  }
  /// One from `least` to `most`; `what` names it in the problem.
  template <typename T> T number(T least, T most, const char *what) {
    T value = number<T>();
    if (value >= least && value <= most)
      return value;
    failRange(what, std::to_string(value), std::to_string(least),
              std::to_string(most));
    return least;
  }
  bool flag() { return number<uint8_t>(0, 1, "a flag") != 0; }
  /// One that is finite and not negative.
  double amount(const char *what);
  /// How many entries follow, each of so many bytes at least.
  uint64_t count(size_t leastBytes);
  std::string string();
  /// One that is UTF-8 and has no zeros.
  std::string text();

  void fail(const std::string &what);
  bool atEnd();
  bool ok() const { return firstProblem.empty(); }
  const std::string &problem() const { return firstProblem; }

private:
  bool take(size_t size);
  void failRange(const char *what, const std::string &value,
                 const std::string &least, const std::string &most);

  const char *data;
  size_t left;
  std::string firstProblem;
};

/// The facts of a variant, as they lie in Launch.td.
void writeFacts(Writer &out, const LaunchFacts &facts);
void readFacts(Reader &in, LaunchFacts &facts);

/// The fields of `Code`, in the kernel cache and in saved modules. Readers
/// check each field; FileChecks.h has how fields fit together.
void writeCode(Writer &out, const Code &code);
Code readCode(Reader &in);
void writeParam(Writer &out, const Param &param);
Param readParam(Reader &in);
void writeAccess(Writer &out, const Access &access);
void writeIdFlow(Writer &out, const IdFlow &flow);
Access readAccess(Reader &in);
IdFlow readIdFlow(Reader &in);

/// A payload behind what tells that it is whole, and that of this key (64
/// characters): magic | version | key | length | hash.
std::string seal(const char (&magic)[8], uint32_t version,
                 const std::string &key, const std::string &payload);
/// The payload, a part of `bytes`; nothing if they are not exactly right.
std::optional<std::string_view> unseal(const char (&magic)[8], uint32_t version,
                                       const std::string &key,
                                       const std::string &bytes);

/// Bytes of a regular file; nothing if it cannot be read.
std::optional<std::string> readFile(const std::string &path);
/// Writes a file that must not exist yet.
bool writeFile(const std::string &path, const std::string &bytes);

} // namespace warp

#endif // WARP_LIB_RUNTIME_BYTES_H
