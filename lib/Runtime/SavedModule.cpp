//===- SavedModule.cpp - Ahead-of-time compiled kernels -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Reading and writing the file that SavedModule.h describes. As in the kernel
// cache, reading trusts nothing: magic, version, length and hash are checked
// before the payload is looked at, and every length in it against what is
// left.
//
//===----------------------------------------------------------------------===//

#include "warp/SavedModule.h"

#include "Bytes.h"
#include "FileChecks.h"
#include "FileFormat.h"
#include "Support.h"
#include "warp/Version.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <set>

using namespace warp;

/// The version goes up when the file, the parameter block or what code calls
/// changes.
static constexpr FileFormat format{"WARPSAVE", 16, "saved module",
                                   "compile it again"};

//===----------------------------------------------------------------------===//
// Payload
//===----------------------------------------------------------------------===//

static void writeOptions(Writer &out, const KernelOptions &options) {
  out.number<uint8_t>(options.debug);
  out.number<uint8_t>(options.fastMath);
  out.number<uint8_t>(options.lineinfo);
  out.number<int32_t>(options.optLevel);
  out.number<int32_t>(options.blockDim);
  out.number<int32_t>(options.maxRegisters);
  out.number<int32_t>(options.maxThreads);
  out.number<int32_t>(options.minBlocks);
  out.number<int64_t>(options.orderedSlots);
}

static KernelOptions readOptions(Reader &in) {
  KernelOptions options;
  options.debug = in.flag();
  options.fastMath = in.flag();
  options.lineinfo = in.flag();
  options.optLevel = in.number<int32_t>(0, 3, "the level of optimization");
  options.blockDim = in.number<int32_t>(0, 1024, "the threads of a block");
  options.maxRegisters = in.number<int32_t>(0, 65536, "the most registers");
  options.maxThreads = in.number<int32_t>(0, 65536, "the most threads");
  options.minBlocks = in.number<int32_t>(0, 65536, "the fewest blocks");
  options.orderedSlots =
      in.number<int64_t>(0, INT64_MAX, "the threads that keep their order");
  return options;
}

static void writeVariant(Writer &out, const SavedVariant &variant) {
  writeFacts(out, variant);
  writeCode(out, variant.code);
}

static SavedVariant readVariant(Reader &in) {
  SavedVariant variant;
  readFacts(in, variant);
  variant.code = readCode(in);
  return variant;
}

static void writeKernel(Writer &out, const SavedKernel &kernel) {
  out.string(kernel.name);
  out.string(kernel.target);
  out.string(kernel.processor);
  out.string(kernel.source);
  writeOptions(out, kernel.options);
  out.number<uint64_t>(kernel.params.size());
  for (const Param &param : kernel.params)
    writeParam(out, param);
  out.number<uint64_t>(kernel.accesses.size());
  for (const Access &access : kernel.accesses)
    writeAccess(out, access);
  out.number<uint64_t>(kernel.idFlows.size());
  for (const IdFlow &flow : kernel.idFlows)
    writeIdFlow(out, flow);
  out.number<uint64_t>(kernel.variants.size());
  for (const SavedVariant &variant : kernel.variants)
    writeVariant(out, variant);
}

/// "cpu" or "sm_90".
static bool isTarget(const std::string &target) {
  if (target == "cpu")
    return true;
  return target.starts_with("sm_") && target.size() > 4 && target.size() < 7 &&
         std::all_of(
             target.begin() + 3, target.end(),
             [](char digit) { return digit >= '0' && digit <= '9'; });
}

/// How the fields of a kernel fit together.
static std::string problemOf(const SavedKernel &kernel) {
  if (!isTarget(kernel.target))
    return "there is no target '" + kernel.target + "'";
  std::string problem = warp::problemOf(kernel.params, kernel.accesses);
  size_t bytes = parameterBytes(kernel.params);
  if (problem.empty())
    problem = warp::problemOf(kernel.idFlows, kernel.accesses, bytes);
  for (const SavedVariant &variant : kernel.variants) {
    if (problem.empty())
      problem = warp::problemOf(variant.code, kernel.params, bytes);
    if (problem.empty() &&
        variant.blockDim < variant.code.schedule.splitReduction)
      problem = "it has no possible block of threads";
  }
  if (problem.empty() && kernel.variants.empty())
    problem = "it has no code";
  return problem;
}

static SavedKernel readKernel(Reader &in) {
  SavedKernel kernel;
  kernel.name = in.text();
  kernel.target = in.text();
  kernel.processor = in.text();
  kernel.source = in.text();
  kernel.options = readOptions(in);
  uint64_t params = in.count(1);
  for (uint64_t i = 0; i < params && in.ok(); ++i)
    kernel.params.push_back(readParam(in));
  uint64_t accesses = in.count(1);
  for (uint64_t i = 0; i < accesses && in.ok(); ++i)
    kernel.accesses.push_back(readAccess(in));
  uint64_t flows = in.count(1);
  for (uint64_t i = 0; i < flows && in.ok(); ++i)
    kernel.idFlows.push_back(readIdFlow(in));
  uint64_t variants = in.count(1);
  for (uint64_t i = 0; i < variants && in.ok(); ++i)
    kernel.variants.push_back(readVariant(in));
  std::string problem = in.ok() ? problemOf(kernel) : "";
  if (!problem.empty())
    in.fail("kernel '" + kernel.name + "': " + problem);
  return kernel;
}

//===----------------------------------------------------------------------===//
// Files
//===----------------------------------------------------------------------===//

std::string SavedModule::bytes() const {
  Writer payload;
  payload.string(version());
  payload.string(name);
  payload.number<uint64_t>(kernels.size());
  for (const SavedKernel &kernel : kernels)
    writeKernel(payload, kernel);
  return format.wrap(payload.bytes);
}

SavedModule SavedModule::fromBytes(const std::string &bytes,
                                   const std::string &origin) {
  std::string_view payload = format.unwrap(bytes, origin);
  Reader in(payload.data(), payload.size());
  SavedModule module;
  in.string();
  module.name = in.text();
  uint64_t count = in.count(1);
  for (uint64_t i = 0; i < count && in.ok(); ++i)
    module.kernels.push_back(readKernel(in));
  if (!in.atEnd())
    throw format.error(origin, "is damaged, " + in.problem());
  return module;
}

SavedModule SavedModule::load(const std::string &path) {
  std::optional<std::string> bytes = readFile(path);
  if (!bytes)
    throw format.error(path, std::string("cannot be read: ") +
                                 std::strerror(errno ? errno : ENOENT));
  return fromBytes(*bytes, path);
}

void SavedModule::save(const std::string &path) const {
  format.replaceFile(path, bytes());
}

//===----------------------------------------------------------------------===//
// Kernels
//===----------------------------------------------------------------------===//

std::vector<std::string> SavedModule::kernelNames() const {
  std::vector<std::string> names;
  for (const SavedKernel &kernel : kernels)
    if (std::find(names.begin(), names.end(), kernel.name) == names.end())
      names.push_back(kernel.name);
  return names;
}

std::shared_ptr<Kernel> SavedModule::kernel(const std::string &wanted) {
  std::shared_ptr<Kernel> &found = loaded[wanted];
  if (found)
    return found;
  for (const SavedKernel &saved : kernels) {
    if (saved.name != wanted)
      continue;
    if (found)
      found->attach(saved);
    else
      found = std::make_shared<Kernel>(saved);
  }
  if (found)
    return found;
  loaded.erase(wanted);
  std::string known;
  for (const std::string &other : kernelNames())
    known += (known.empty() ? "'" : ", '") + other + "'";
  throw Error(Error::Kind::Key, "saved module '" + name + "' has no kernel '" +
                                    wanted + "', it has: " + known);
}

/// Features whose instructions are for systems and libraries: no kernel has
/// them, and systems hide some that a processor has.
static const std::set<std::string> &unusedFeatures() {
  static const std::set<std::string> names = {
      "cldemote", "clflushopt", "clwb",      "clzero",   "enqcmd", "fsgsbase",
      "hreset",   "invpcid",    "kl",        "lwp",      "mwaitx", "pconfig",
      "pku",      "prefetchi",  "ptwrite",   "rdpid",    "rdpru",  "rdrnd",
      "rdseed",   "rtm",        "serialize", "sgx",      "shstk",  "tsxldtrk",
      "uintr",    "usermsr",    "waitpkg",   "wbnoinvd", "widekl", "xsave",
      "xsavec",   "xsaveopt",   "xsaves"};
  return names;
}

/// "skylake +avx,-sse4a": the features that are on.
static std::set<std::string> featuresOf(const std::string &processor) {
  std::set<std::string> features;
  size_t start = processor.find(' ');
  while (start != std::string::npos) {
    size_t end = processor.find(',', start + 1);
    std::string feature = processor.substr(start + 1, end - start - 1);
    if (!feature.empty() && feature[0] == '+')
      features.insert(feature.substr(1));
    start = end;
  }
  return features;
}

void warp::checkProcessor(const SavedKernel &saved) {
  std::set<std::string> present = featuresOf(hostProcessor());
  std::string missing;
  for (const std::string &feature : featuresOf(saved.processor))
    if (!present.count(feature) && !unusedFeatures().count(feature))
      missing += (missing.empty() ? "'" : ", '") + feature + "'";
  if (!missing.empty())
    throw Error(Error::Kind::Runtime,
                "kernel '" + saved.name + "' was compiled for '" +
                    saved.processor.substr(0, saved.processor.find(' ')) +
                    "', this processor lacks " + missing);
}
