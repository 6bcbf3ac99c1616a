//===- Bytes.cpp - Numbers and strings in files ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Bytes.h"

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
  out.number<int32_t>(code.copied.list.size());
  for (const CopiedArray &array : code.copied.list)
    out.number(array);
  out.number(code.copied.plainTime);
  out.number(code.copied.atomicTime);
  out.number<int32_t>(code.items);
  out.number<uint8_t>(code.fixedBlock);
  out.number<uint8_t>(code.cooperative);
  out.number<int32_t>(code.dynamicBytes);
  out.number<int32_t>(code.rows);
  out.number<int32_t>(code.tile);
  out.number<int32_t>(code.split);
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
  auto copies = in.number<int32_t>();
  for (int32_t i = 0; i < copies && in.ok(); ++i)
    code.copied.list.push_back(in.number<CopiedArray>());
  code.copied.plainTime = in.number<double>();
  code.copied.atomicTime = in.number<double>();
  code.items = in.number<int32_t>();
  code.fixedBlock = in.number<uint8_t>();
  code.cooperative = in.number<uint8_t>();
  code.dynamicBytes = in.number<int32_t>();
  code.rows = in.number<int32_t>();
  code.tile = in.number<int32_t>();
  code.split = in.number<int32_t>();
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
