//===- Bytes.cpp - Numbers and strings in files ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Bytes.h"

#include "Support.h"

#include <cerrno>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

using namespace warp;

void warp::writeCode(Writer &out, const Code &code) {
  out.string(code.entry);
  out.string(code.binary.data(), code.binary.size());
  out.number(code.cost);
  out.number<uint8_t>(code.usesPrintf);
  out.number<uint8_t>(code.exclusive);
  out.number<uint8_t>(code.atomics);
  out.number<uint8_t>(code.isLong);
  out.number<uint8_t>(code.isExact);
  out.number<int32_t>(code.copied.list.size());
  for (const CopiedArray &array : code.copied.list)
    out.number(array);
  out.number(code.copied.plainTime);
  out.number(code.copied.atomicTime);
  out.number<int32_t>(code.items);
  out.number<uint8_t>(code.fixedBlock);
  out.number<uint8_t>(code.cooperative);
  out.number<uint8_t>(code.ragged);
  out.number<int32_t>(code.dynamicBytes);
  out.number<int32_t>(code.maps.size());
  for (const TensorMap &map : code.maps)
    out.number(map);
  out.number<int32_t>(code.rows);
  out.number<int32_t>(code.tile);
  out.number<int32_t>(code.split);
  out.number<int32_t>(code.joined);
  out.number<uint8_t>(code.alternates);
  out.number<uint8_t>(code.sizeFacts);
  out.number<int32_t>(code.sums.size());
  for (const SummedArray &array : code.sums)
    out.number(array);
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
  code.entry = in.string();
  std::string binary = in.string();
  code.binary.assign(binary.begin(), binary.end());
  code.cost = in.number<double>();
  code.usesPrintf = in.number<uint8_t>();
  code.exclusive = in.number<uint8_t>();
  code.atomics = in.number<uint8_t>();
  code.isLong = in.number<uint8_t>();
  code.isExact = in.number<uint8_t>();
  auto copies = in.number<int32_t>();
  for (int32_t i = 0; i < copies && in.ok(); ++i)
    code.copied.list.push_back(in.number<CopiedArray>());
  code.copied.plainTime = in.number<double>();
  code.copied.atomicTime = in.number<double>();
  code.items = in.number<int32_t>();
  code.fixedBlock = in.number<uint8_t>();
  code.cooperative = in.number<uint8_t>();
  code.ragged = in.number<uint8_t>();
  code.dynamicBytes = in.number<int32_t>();
  auto maps = in.number<int32_t>();
  for (int32_t i = 0; i < maps && in.ok(); ++i)
    code.maps.push_back(in.number<TensorMap>());
  code.rows = in.number<int32_t>();
  code.tile = in.number<int32_t>();
  code.split = in.number<int32_t>();
  code.joined = in.number<int32_t>();
  code.alternates = in.number<uint8_t>();
  code.sizeFacts = in.number<uint8_t>();
  auto sums = in.number<int32_t>();
  for (int32_t i = 0; i < sums && in.ok(); ++i)
    code.sums.push_back(in.number<SummedArray>());
  auto sites = in.number<uint64_t>();
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
  param.name = in.string();
  param.kind = static_cast<Param::Kind>(in.number<uint8_t>());
  param.type = in.string();
  param.offset = in.number<int64_t>();
  param.size = in.number<int64_t>();
  param.rank = in.number<int32_t>();
  param.element = in.string();
  param.elementSize = in.number<int64_t>();
  auto arrays = in.number<uint64_t>();
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
    *fact = in.number<uint8_t>();
  access.line = in.number<uint32_t>();
  for (int64_t *size :
       {&access.offset, &access.elementSize, &access.gradientSize})
    *size = in.number<int64_t>();
  return access;
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
