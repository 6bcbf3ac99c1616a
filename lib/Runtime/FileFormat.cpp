//===- FileFormat.cpp - File header: magic, version, hash -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "FileFormat.h"

#include "Bytes.h"
#include "Support.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <unistd.h>

using namespace warp;

static constexpr size_t headerSize = 8 + 4 + 8 + 8;

Error FileFormat::error(const std::string &path,
                        const std::string &problem) const {
  return Error(Error::Kind::Runtime,
               std::string(name) + " '" + path + "' " + problem);
}

std::string FileFormat::wrap(const std::string &payload) const {
  Writer file;
  file.bytes.append(magic);
  file.number(version);
  file.number<uint64_t>(payload.size());
  file.number(hashBytes(payload.data(), payload.size()));
  return file.bytes + payload;
}

std::string_view FileFormat::unwrap(const std::string &bytes,
                                    const std::string &path) const {
  if (bytes.size() < headerSize || !bytes.starts_with(magic))
    throw error(path, "is not a " + std::string(name));
  Reader header(bytes.data() + magic.size(), headerSize - magic.size());
  auto found = header.number<uint32_t>();
  auto size = header.number<uint64_t>();
  auto hash = header.number<uint64_t>();
  if (found != version)
    throw error(path, "has format " + std::to_string(found) +
                          ", but this release reads format " +
                          std::to_string(version) + ", " + std::string(remedy));
  std::string_view payload = std::string_view(bytes).substr(headerSize);
  if (size != payload.size() || hash != hashBytes(payload.data(), size))
    throw error(path, "is damaged, its checksum does not fit");
  return payload;
}

void FileFormat::replaceFile(const std::string &path,
                             const std::string &bytes) const {
  std::string temporary = path + ".writing-" + std::to_string(getpid());
  unlink(temporary.c_str());
  if (writeFile(temporary, bytes) &&
      std::rename(temporary.c_str(), path.c_str()) == 0)
    return;
  int reason = errno;
  unlink(temporary.c_str());
  throw error(path, std::string("cannot be written: ") + std::strerror(reason));
}
