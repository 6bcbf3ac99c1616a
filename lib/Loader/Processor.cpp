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

std::string warp::hostProcessor() {
  static const std::string description = [] {
    std::ifstream file("/proc/cpuinfo");
    std::string line, features;
    while (std::getline(file, line) && line.rfind("flags", 0) != 0)
      continue;
    std::istringstream words(
        line.substr(std::min(line.find(':') + 1, line.size())));
    auto add = [&](const std::string &name) {
      if (!name.empty())
        features += (features.empty() ? " +" : ",+") + name;
    };
    for (std::string word; words >> word;) {
      auto known = llvmNames().find(word);
      if (known != llvmNames().end()) {
        add(known->second);
      } else {
        // "avx512_vnni" and "avx512vnni".
        std::string joined;
        for (char letter : word)
          if (letter != '_')
            joined += letter;
        add(joined);
      }
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
