//===- Translation.cpp - Translations in the kernel cache -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One file per translation, `<name>.kernel`, sealed like compiled code.
//
//===----------------------------------------------------------------------===//

#include "warp/Translation.h"

#include "Bytes.h"
#include "FileChecks.h"
#include "KernelClaim.h"
#include "warp/KernelCache.h"

#include <string_view>

using namespace warp;

static constexpr char magic[] = {'W', 'A', 'R', 'P', 'K', 'E', 'R', 'N'};
static constexpr uint32_t formatVersion = 1;
static constexpr const char *suffix = ".kernel";

std::string warp::serialize(const std::string &name,
                            const Translation &translation) {
  Writer out;
  out.string(translation.hashes.plain);
  out.string(translation.hashes.located);
  out.number<uint64_t>(translation.params.size());
  for (const Param &param : translation.params)
    writeParam(out, param);
  out.number<uint64_t>(translation.accesses.size());
  for (const Access &access : translation.accesses)
    writeAccess(out, access);
  out.number<int32_t>(translation.rank);
  out.string(translation.notes);
  out.string(translation.text);
  return seal(magic, formatVersion, name, out.bytes);
}

std::optional<Translation>
warp::deserializeTranslation(const std::string &name,
                             const std::string &bytes) {
  std::optional<std::string_view> payload =
      unseal(magic, formatVersion, name, bytes);
  if (!payload)
    return std::nullopt;
  Reader in(payload->data(), payload->size());
  Translation result;
  result.hashes.plain = in.string();
  result.hashes.located = in.string();
  uint64_t params = in.count(1);
  for (uint64_t i = 0; i < params && in.ok(); ++i)
    result.params.push_back(readParam(in));
  uint64_t accesses = in.count(1);
  for (uint64_t i = 0; i < accesses && in.ok(); ++i)
    result.accesses.push_back(readAccess(in));
  result.rank = in.number<int32_t>(1, maxRank, "the rank of a kernel");
  result.notes = in.string();
  result.text = in.string();
  if (!in.atEnd() || !problemOf(result.params, result.accesses).empty())
    return std::nullopt;
  return result;
}

std::optional<Translation> warp::findTranslation(const std::string &name) {
  KernelCache &cache = KernelCache::get();
  std::optional<std::string> bytes = cache.read(name + suffix);
  if (!bytes)
    return std::nullopt;
  std::optional<Translation> found = deserializeTranslation(name, *bytes);
  if (!found)
    cache.remove(name + suffix);
  return found;
}

TranslationClaim::TranslationClaim(const std::string &name)
    : claim(std::make_unique<KernelClaim>(name)) {}

TranslationClaim::~TranslationClaim() = default;

bool TranslationClaim::hasWaited() const { return claim->hasWaited(); }

void warp::storeTranslation(const std::string &name,
                            const Translation &translation) {
  KernelCache::get().write(name + suffix, serialize(name, translation));
}

std::string warp::kernelNameOf(const Translation &translation) {
  std::string_view text = translation.text;
  size_t mark = text.find("warp.kernel");
  size_t at = text.rfind("func.func @", mark);
  if (mark == text.npos || at == text.npos)
    return "";
  text.remove_prefix(at + std::string_view("func.func @").size());
  return std::string(text.substr(0, text.find_first_of("( \n")));
}
