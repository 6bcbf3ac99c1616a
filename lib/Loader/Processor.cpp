//===- Processor.cpp - Features of this processor -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// By the kernel's list in /proc/cpuinfo, in the names that LLVM has for them:
// saved kernels name the features that they were compiled for.
//
//===----------------------------------------------------------------------===//

#include "warp/Compile.h"

#include <fstream>
#include <map>
#include <sstream>

#ifdef __aarch64__
/// The line of the list.
static constexpr char lineOfFeatures[] = "Features";

/// LLVM looks for these alone.
static std::string nameOf(const std::string &word) {
  static const std::map<std::string, std::string> names = {
      {"aes", "aes"},          {"asimd", "neon"},     {"atomics", "lse"},
      {"crc32", "crc"},        {"fp", "fp-armv8"},    {"fphp", "fullfp16"},
      {"pmull", "aes"},        {"rng", "rand"},       {"sha1", "sha2"},
      {"sha2", "sha2"},        {"sha3", "sha3"},      {"sm4", "sm4"},
      {"sve", "sve"},          {"sve2", "sve2"},      {"sveaes", "sve-aes"},
      {"svesha3", "sve-sha3"}, {"svesm4", "sve-sm4"},
  };
  auto known = names.find(word);
  return known == names.end() ? "" : known->second;
}
#else
static constexpr char lineOfFeatures[] = "flags";

/// Names that differ; all others are the same up to underscores.
static const std::map<std::string, std::string> &llvmNames() {
  static const std::map<std::string, std::string> names = {
      {"3dnowprefetch", "prfchw"},
      {"abm", "lzcnt"},
      {"amx_bf16", "amx-bf16"},
      {"amx_fp16", "amx-fp16"},
      {"amx_int8", "amx-int8"},
      {"amx_tile", "amx-tile"},
      {"avx512_vp2intersect", "avx512vp2intersect"},
      {"bmi1", "bmi"},
      {"ht", ""},
      {"lahf_lm", "sahf"},
      {"lm", "64bit"},
      {"ospke", "pku"},
      {"pclmulqdq", "pclmul"},
      {"pku", ""},
      {"pni", "sse3"},
      {"rdrand", "rdrnd"},
      {"sha_ni", "sha"},
      {"sse4_1", "sse4.1"},
      {"sse4_2", "sse4.2"},
      {"user_shstk", "shstk"},
  };
  return names;
}

/// "avx512_vnni" and "avx512vnni".
static std::string nameOf(const std::string &word) {
  auto known = llvmNames().find(word);
  if (known != llvmNames().end())
    return known->second;
  std::string joined;
  for (char letter : word)
    if (letter != '_')
      joined += letter;
  return joined;
}
#endif

std::string warp::hostProcessor() {
  static const std::string description = [] {
    std::ifstream file("/proc/cpuinfo");
    std::string line, features;
    while (std::getline(file, line) && line.rfind(lineOfFeatures, 0) != 0)
      continue;
    std::istringstream words(
        line.substr(std::min(line.find(':') + 1, line.size())));
    auto add = [&](const std::string &name) {
      if (!name.empty())
        features += (features.empty() ? " +" : ",+") + name;
    };
    for (std::string word; words >> word;) {
      add(nameOf(word));
      // Each comes with another one that has no word of its own.
      if (word == "sse4_2")
        add("crc32");
      if (word == "xsaveopt")
        add("xsave");
    }
    return "host" + features;
  }();
  return description;
}
