//===- Info.cpp - AMD processors, features and limits ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// From LLVM's AMDGPU usage: processors, and address spaces and their sizes.
//
//===----------------------------------------------------------------------===//

#include "Amd.h"

#include "llvm/ADT/STLExtras.h"

using namespace warp;

namespace {
struct Processor {
  llvm::StringLiteral name;
  int64_t waveSize;
};
} // namespace

static constexpr Processor processors[] = {
    {"gfx90a", 64}, {"gfx942", 64}, {"gfx1030", 32}, {"gfx1100", 32}};

std::unique_ptr<TargetInfo> AmdTarget::parse(llvm::StringRef name) {
  auto *found = llvm::find_if(
      processors, [&](const Processor &one) { return one.name == name; });
  if (found == std::end(processors))
    return nullptr;
  TargetFacts facts;
  facts.features = {Feature::ReciprocalRoot};
  facts.subgroupSize = found->waveSize;
  facts.sharedBytes = 64 << 10;
  return std::make_unique<AmdTarget>(name, facts);
}
