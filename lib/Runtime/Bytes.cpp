//===- Bytes.cpp - Binary serialisation -----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Bytes.h"

#include "FileChecks.h"
#include "Support.h"

#include <cerrno>
#include <cmath>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

using namespace warp;

//===----------------------------------------------------------------------===//
// Reading
//===----------------------------------------------------------------------===//

void Reader::fail(const std::string &what) {
  if (firstProblem.empty())
    firstProblem = what;
  left = 0;
}

bool Reader::take(size_t size) {
  if (ok() && size > left)
    fail("it ends too early");
  if (!ok())
    return false;
  data += size;
  left -= size;
  return true;
}

bool Reader::atEnd() {
  if (left != 0)
    fail("it goes on behind its end");
  return ok();
}

void Reader::failRange(const char *what, const std::string &value,
                       const std::string &least, const std::string &most) {
  fail(std::string(what) + " is '" + value + "', but has to be from " + least +
       " to " + most);
}

double Reader::amount(const char *what) {
  auto value = number<double>();
  if (std::isfinite(value) && value >= 0)
    return value;
  fail(std::string(what) + " is '" + std::to_string(value) +
       "', but has to be finite and not negative");
  return 0;
}

uint64_t Reader::count(size_t leastBytes) {
  auto value = number<uint64_t>();
  if (value <= left / leastBytes)
    return value;
  fail("it has no room for '" + std::to_string(value) + "' entries");
  return 0;
}

std::string Reader::string() {
  uint64_t size = count(1);
  if (!take(size))
    return {};
  return std::string(data - size, size);
}

/// Bytes of the character that begins there; 0 if none does.
static size_t characterAt(std::string_view text) {
  auto byte = [&](size_t i) { return static_cast<unsigned char>(text[i]); };
  if (byte(0) < 0x80)
    return byte(0) != 0;
  size_t size = byte(0) < 0xc2   ? 0
                : byte(0) < 0xe0 ? 2
                : byte(0) < 0xf0 ? 3
                : byte(0) < 0xf5 ? 4
                                 : 0;
  if (size > text.size())
    return 0;
  uint32_t character = byte(0) & (0xff >> (size + 1));
  for (size_t i = 1; i < size; ++i) {
    if (byte(i) >> 6 != 2)
      return 0;
    character = character << 6 | (byte(i) & 0x3f);
  }
  static constexpr uint32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
  bool isSurrogate = character >= 0xd800 && character < 0xe000;
  return character < least[size] || character > 0x10ffff || isSurrogate ? 0
                                                                        : size;
}

std::string Reader::text() {
  std::string value = string();
  std::string_view rest = value;
  while (!rest.empty()) {
    size_t size = characterAt(rest);
    if (size == 0) {
      fail("a name or a type in it is no text");
      return {};
    }
    rest.remove_prefix(size);
  }
  return value;
}

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

/// Bounds of numbers in files: far above what compilers and users make, and so
/// low that sums and products of a few of them stay exact.
static constexpr int32_t mostEntries = 1 << 20;
static constexpr int64_t mostElementBytes = int64_t(1) << 31;

namespace {
/// Writes the value of each fact.
struct FactWriter {
  void operator()(const FactInfo &, bool value) { out.number<uint8_t>(value); }
  void operator()(const FactInfo &, int value) { out.number<int32_t>(value); }
  void operator()(const FactInfo &, uint64_t value) { out.number(value); }
  void operator()(const FactInfo &, double value) { out.number(value); }
  template <typename Entry>
  void operator()(const FactInfo &, const std::vector<Entry> &list) {
    out.number<int32_t>(list.size());
    for (const Entry &entry : list)
      out.number(entry);
  }
  void operator()(const FactInfo &fact, const CopiedArrays &copied) {
    (*this)(fact, copied.list);
    out.number(copied.plainTime);
    out.number(copied.atomicTime);
  }

  Writer &out;
};

/// Reads it, and checks it against the fact's range.
struct FactReader {
  void operator()(const FactInfo &, bool &value) { value = in.flag(); }
  void operator()(const FactInfo &fact, int &value) {
    value = in.number<int32_t>(int32_t(fact.least), int32_t(fact.most),
                               fact.name);
    if (!fact.allows(value))
      in.fail(std::string(fact.name) + " is '" + std::to_string(value) +
              "', but has to be a power of two");
  }
  void operator()(const FactInfo &, uint64_t &value) {
    value = in.number<uint64_t>();
  }
  void operator()(const FactInfo &fact, double &value) {
    value = in.amount(fact.name);
  }
  template <typename Entry>
  void operator()(const FactInfo &fact, std::vector<Entry> &list) {
    auto count = in.number<int32_t>(0, mostEntries, fact.name);
    for (int32_t i = 0; i < count && in.ok(); ++i)
      list.push_back(in.number<Entry>());
  }
  void operator()(const FactInfo &fact, CopiedArrays &copied) {
    (*this)(fact, copied.list);
    copied.plainTime = in.amount(fact.name);
    copied.atomicTime = in.amount(fact.name);
  }

  Reader &in;
};
} // namespace

void warp::writeFacts(Writer &out, const LaunchFacts &facts) {
  LaunchFacts::visit(facts, FactWriter{out});
}

void warp::readFacts(Reader &in, LaunchFacts &facts) {
  LaunchFacts::visit(facts, FactReader{in});
}

void warp::writeCode(Writer &out, const Code &code) {
  out.string(code.entry);
  out.string(code.binary.data(), code.binary.size());
  Schedule::visit(code.schedule, FactWriter{out});
  out.number<uint64_t>(code.sites.size());
  for (const Site &site : code.sites) {
    out.string(site.kernel);
    out.string(site.file);
    out.string(site.array);
    out.number<int32_t>(site.line);
    out.number<int32_t>(site.column);
  }
}

Code warp::readCode(Reader &in) {
  Code code;
  code.entry = in.text();
  std::string binary = in.string();
  if (code.entry.empty() || binary.empty())
    in.fail("a kernel has no code");
  code.binary.assign(binary.begin(), binary.end());
  Schedule::visit(code.schedule, FactReader{in});
  uint64_t sites = in.count(32);
  for (uint64_t i = 0; i < sites && in.ok(); ++i) {
    Site site;
    site.kernel = in.string();
    site.file = in.string();
    site.array = in.string();
    site.line = in.number<int32_t>();
    site.column = in.number<int32_t>();
    code.sites.push_back(std::move(site));
  }
  return code;
}

void warp::writeParam(Writer &out, const Param &param) {
  out.string(param.name);
  out.number<uint8_t>(static_cast<uint8_t>(param.kind));
  out.string(param.type);
  out.number<int64_t>(param.offset);
  out.number<int64_t>(param.size);
  out.number<int32_t>(param.rank);
  out.string(param.element);
  out.number<int64_t>(param.elementSize);
  out.number<uint64_t>(param.arrays.size());
  for (int64_t offset : param.arrays)
    out.number<int64_t>(offset);
}

Param warp::readParam(Reader &in) {
  Param param;
  param.name = in.text();
  param.kind = static_cast<Param::Kind>(
      in.number<uint8_t>(0, uint8_t(Param::Kind::Struct), "the kind"));
  param.type = in.text();
  param.offset = in.number<int64_t>(firstArgument, mostParameterBytes,
                                    "the place of an argument");
  param.size =
      in.number<int64_t>(0, mostParameterBytes, "the size of an argument");
  param.rank = in.number<int32_t>(0, maxRank, "the rank of an array");
  param.element = in.text();
  param.elementSize =
      in.number<int64_t>(0, mostElementBytes, "the size of an element");
  uint64_t arrays = in.count(8);
  for (uint64_t i = 0; i < arrays && in.ok(); ++i)
    param.arrays.push_back(in.number<int64_t>());
  return param;
}

void warp::writeAccess(Writer &out, const Access &access) {
  for (bool fact : {access.loaded, access.stored, access.combined,
                    access.fetched, access.watched})
    out.number<uint8_t>(fact);
  out.number<uint32_t>(access.line);
  for (int64_t size : {access.offset, access.elementSize, access.gradientSize})
    out.number<int64_t>(size);
}

Access warp::readAccess(Reader &in) {
  Access access;
  for (bool *fact : {&access.loaded, &access.stored, &access.combined,
                     &access.fetched, &access.watched})
    *fact = in.flag();
  access.line = in.number<uint32_t>();
  access.offset = in.number<int64_t>(firstArgument, mostParameterBytes,
                                     "the place of an array");
  for (int64_t *size : {&access.elementSize, &access.gradientSize})
    *size = in.number<int64_t>(0, mostElementBytes, "the size of an element");
  return access;
}

static void writeIdWord(Writer &out, const IdWord &word) {
  out.number<int32_t>(word.access);
  out.number<int64_t>(word.offset);
}

static IdWord readIdWord(Reader &in) {
  IdWord word;
  word.access = in.number<int32_t>(-1, INT32_MAX, "the array of an id");
  word.offset = in.number<int64_t>(0, mostParameterBytes, "the place of an id");
  return word;
}

void warp::writeIdFlow(Writer &out, const IdFlow &flow) {
  writeIdWord(out, flow.from);
  out.number<uint8_t>(flow.to.has_value());
  if (flow.to)
    writeIdWord(out, *flow.to);
}

IdFlow warp::readIdFlow(Reader &in) {
  IdFlow flow{readIdWord(in), std::nullopt};
  if (in.flag())
    flow.to = readIdWord(in);
  return flow;
}

static constexpr size_t keyLength = 64;
static constexpr size_t headerSize = 8 + 4 + keyLength + 8 + 8;

std::string warp::seal(const char (&magic)[8], uint32_t version,
                       const std::string &key, const std::string &payload) {
  Writer file;
  file.bytes.reserve(headerSize + payload.size());
  file.bytes.append(magic, sizeof(magic));
  file.number(version);
  file.bytes.append(key);
  file.number<uint64_t>(payload.size());
  file.number(hashBytes(payload.data(), payload.size()));
  file.bytes += payload;
  return std::move(file.bytes);
}

std::optional<std::string_view> warp::unseal(const char (&magic)[8],
                                             uint32_t version,
                                             const std::string &key,
                                             const std::string &bytes) {
  if (key.size() != keyLength || bytes.size() < headerSize ||
      std::memcmp(bytes.data(), magic, sizeof(magic)) != 0 ||
      bytes.compare(12, keyLength, key) != 0)
    return std::nullopt;
  uint32_t found;
  std::memcpy(&found, bytes.data() + 8, 4);
  Reader header(bytes.data() + 12 + keyLength, 16);
  auto size = header.number<uint64_t>();
  auto hash = header.number<uint64_t>();
  const char *payload = bytes.data() + headerSize;
  if (found != version || size != bytes.size() - headerSize ||
      hash != hashBytes(payload, size))
    return std::nullopt;
  return std::string_view(payload, size);
}

std::optional<std::string> warp::readFile(const std::string &path) {
  int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0)
    return std::nullopt;
  std::string bytes;
  struct stat status;
  if (fstat(file, &status) == 0 && S_ISREG(status.st_mode))
    bytes.resize(status.st_size);
  size_t done = 0;
  while (done < bytes.size()) {
    ssize_t got = read(file, bytes.data() + done, bytes.size() - done);
    if (got < 0 && errno == EINTR)
      continue;
    if (got <= 0)
      break;
    done += got;
  }
  close(file);
  bytes.resize(done);
  return bytes;
}

bool warp::writeFile(const std::string &path, const std::string &bytes) {
  int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0)
    return false;
  size_t done = 0;
  while (done < bytes.size()) {
    ssize_t put = write(file, bytes.data() + done, bytes.size() - done);
    if (put < 0 && errno == EINTR)
      continue;
    if (put <= 0)
      break;
    done += put;
  }
  return close(file) == 0 && done == bytes.size();
}
