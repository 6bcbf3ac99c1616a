//===- Info.cpp - NVIDIA architectures, features and limits ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// From the CUDA C++ Programming Guide, technical specifications per compute
// capability, and the PTX ISA.
//
//===----------------------------------------------------------------------===//

#include "Nvidia.h"

#include "warp/Compile.h"

#include <algorithm>
#include <iterator>

using namespace warp;

static constexpr FeatureSet any{Feature::ReciprocalRoot};
static constexpr FeatureSet ampere =
    any | FeatureSet{Feature::SubgroupMax, Feature::BlockTiles,
                     Feature::AsyncCopy, Feature::Mma};
static constexpr FeatureSet hopper =
    ampere | FeatureSet{Feature::DoubleMma, Feature::PairedFloatAtomics,
                        Feature::ProgrammaticLaunch};
static constexpr FeatureSet hopperAlone =
    hopper | FeatureSet{Feature::TensorMaps, Feature::Wgmma};

namespace {
struct Architecture {
  unsigned version;
  FeatureSet features;
  int64_t sharedKilobytes;
};
} // namespace

/// The architectures that code can be asked for.
static constexpr Architecture architectures[] = {
    {70, any, 96},      {72, any, 96},      {75, any, 64},
    {80, ampere, 163},  {86, ampere, 99},   {87, ampere, 163},
    {89, ampere, 99},   {90, hopper, 227},  {100, hopper, 227},
    {101, hopper, 227}, {103, hopper, 227}, {120, hopper, 99},
    {121, hopper, 99}};

std::vector<int> warp::gpuArchitectures() {
  std::vector<int> versions;
  for (const Architecture &one : architectures)
    versions.push_back(int(one.version));
  return versions;
}

/// Other versions have the features of the last one before, and what any block
/// has of shared memory.
static TargetFacts findFacts(unsigned version) {
  TargetFacts facts;
  facts.subgroupSize = 32;
  facts.features = any;
  facts.sharedBytes = facts.staticSharedBytes;
  for (const Architecture &one : architectures) {
    if (one.version <= version)
      facts.features = one.features;
    if (one.version == version)
      facts.sharedBytes = one.sharedKilobytes << 10;
  }
  return facts;
}

std::unique_ptr<TargetInfo> NvidiaTarget::parse(llvm::StringRef name) {
  llvm::StringRef number = name;
  unsigned version;
  if (!number.consume_front("sm_"))
    return nullptr;
  bool isAlone = number.consume_back("a");
  if (number.getAsInteger(10, version) || version == 0)
    return nullptr;
  TargetFacts facts = findFacts(version);
  if (isAlone && version == 90)
    facts.features = hopperAlone;
  return std::make_unique<NvidiaTarget>(name, facts, version);
}
