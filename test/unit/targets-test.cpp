//===- targets-test.cpp - Names, features and limits of targets -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Targets/Target.h"

#include "warp/Compile.h"
#include "warp/Error.h"

#include <gtest/gtest.h>

using namespace warp;

namespace {

/// True if all targets of a family are found and have a feature.
bool has(llvm::StringRef name, Feature feature) {
  const TargetInfo *target = parseTarget(name);
  return target && target->has(feature);
}

} // namespace

TEST(Targets, HaveOneObjectForAName) {
  for (llvm::StringRef name :
       {"cpu", "cpu:znver5", "sm_75", "sm_90", "sm_90a", "gfx90a", "gfx1100"}) {
    const TargetInfo *target = parseTarget(name);
    ASSERT_TRUE(target) << name.str();
    EXPECT_EQ(target->getName(), name);
    EXPECT_EQ(target, parseTarget(name));
  }
}

TEST(Targets, RefuseOtherNames) {
  for (llvm::StringRef name :
       {"", "gpu", "cpuid", "sm_", "sm_0", "sm_9x", "sm_90b", "gfx", "90"})
    EXPECT_FALSE(parseTarget(name)) << name.str();
  CompileOptions options;
  options.target = "riscv";
  EXPECT_THROW(getTarget(options), Error);
}

TEST(Targets, HaveFeaturesFromAGenerationOn) {
  EXPECT_FALSE(has("sm_75", Feature::BlockTiles));
  for (llvm::StringRef name : {"sm_80", "sm_89", "sm_90", "sm_120"}) {
    EXPECT_TRUE(has(name, Feature::AsyncCopy)) << name.str();
    EXPECT_TRUE(has(name, Feature::Mma)) << name.str();
  }
  EXPECT_FALSE(has("sm_89", Feature::PairedFloatAtomics));
  EXPECT_FALSE(has("sm_89", Feature::ProgrammaticLaunch));
  EXPECT_TRUE(has("sm_100", Feature::PairedFloatAtomics));
  EXPECT_TRUE(has("sm_90", Feature::DoubleMma));
}

// An "a" is for what no later architecture has.
TEST(Targets, HaveFeaturesOfOneArchitecture) {
  EXPECT_TRUE(has("sm_90a", Feature::Wgmma));
  EXPECT_TRUE(has("sm_90a", Feature::TensorMaps));
  for (llvm::StringRef name : {"sm_90", "sm_100", "sm_100a", "sm_120"}) {
    EXPECT_FALSE(has(name, Feature::Wgmma)) << name.str();
    EXPECT_FALSE(has(name, Feature::TensorMaps)) << name.str();
  }
}

TEST(Targets, HaveLimits) {
  EXPECT_EQ(parseTarget("sm_90")->getSharedBytes(), 227 << 10);
  EXPECT_EQ(parseTarget("sm_86")->getSharedBytes(), 99 << 10);
  // An architecture that is not in the table has as much as all of them.
  EXPECT_EQ(parseTarget("sm_91")->getSharedBytes(), 48 << 10);
  EXPECT_EQ(parseTarget("gfx90a")->getSharedBytes(), 64 << 10);
  EXPECT_EQ(parseTarget("cpu:skylake-avx512")->getVectorBits(), 512);
  EXPECT_EQ(parseTarget("sm_90")->getVectorBits(), 0);
}

TEST(Targets, HaveSubgroups) {
  EXPECT_EQ(parseTarget("sm_90")->getSubgroupSize(), 32);
  EXPECT_EQ(parseTarget("gfx1100")->getSubgroupSize(), 32);
  EXPECT_EQ(parseTarget("gfx90a")->getSubgroupSize(), 64);
  EXPECT_TRUE(parseTarget("gfx1100")->hasFullSubgroups(96));
  EXPECT_FALSE(parseTarget("gfx90a")->hasFullSubgroups(96));
  EXPECT_FALSE(parseTarget("cpu")->isSimt());
}
