//===- MachineCode.cpp - Machine code of GPU kernels on disk --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "MachineCode.h"

#include "Bytes.h"
#include "Support.h"
#include "warp/Device.h"
#include "warp/KernelCache.h"
#include "warp/Version.h"

#include <cstdio>

using namespace warp;

static constexpr char magic[] = {'W', 'A', 'R', 'P', 'C', 'U', 'B', 'N'};
static constexpr uint32_t formatVersion = 1;
static constexpr const char *suffix = ".machine";

std::string warp::machineCodeKey(const Code &ptx, int arch) {
  std::string what = std::to_string(arch) + " " +
                     std::to_string(cudaDriverVersion()) + " " + buildId();
  std::string key;
  for (uint64_t seed = 0; seed < 4; ++seed) {
    char digits[17];
    uint64_t hash = hashBytes(what.data(), what.size(), seed);
    std::snprintf(digits, sizeof(digits), "%016llx",
                  static_cast<unsigned long long>(
                      hashBytes(ptx.binary.data(), ptx.binary.size(), hash)));
    key += digits;
  }
  return key;
}

std::optional<MachineCode>
warp::deserializeMachineCode(const std::string &key, const std::string &bytes) {
  std::optional<std::string_view> payload =
      unseal(magic, formatVersion, key, bytes);
  if (!payload)
    return std::nullopt;
  Reader in(payload->data(), payload->size());
  MachineCode code;
  code.entry = in.string();
  code.isBest = in.flag();
  std::string binary = in.string();
  if (!in.atEnd())
    return std::nullopt;
  code.binary.assign(binary.begin(), binary.end());
  if (!isElf(code.binary))
    return std::nullopt;
  return code;
}

std::optional<MachineCode> warp::findMachineCode(const std::string &key) {
  KernelCache &cache = KernelCache::get();
  std::optional<std::string> bytes = cache.read(key + suffix);
  if (!bytes)
    return std::nullopt;
  std::optional<MachineCode> found = deserializeMachineCode(key, *bytes);
  if (!found)
    removeMachineCode(key);
  return found;
}

void warp::storeMachineCode(const std::string &key, const MachineCode &code) {
  Writer out;
  out.string(code.entry);
  out.number<uint8_t>(code.isBest);
  out.string(code.binary.data(), code.binary.size());
  KernelCache::get().write(key + suffix,
                           seal(magic, formatVersion, key, out.bytes));
}

void warp::removeMachineCode(const std::string &key) {
  KernelCache::get().remove(key + suffix);
}
