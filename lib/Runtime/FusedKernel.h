//===- FusedKernel.h - One kernel for several launches ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_FUSEDKERNEL_H
#define WARP_LIB_RUNTIME_FUSEDKERNEL_H

#include "GraphFusion.h"

#include <string>
#include <vector>

namespace warp {

/// Launches that are to be one.
struct FusionPlan {
  std::vector<const GraphOperation *> launches;
  /// Threads of the blocks that each run all of them for one index of their
  /// first extent; 0 if each thread runs all of them for its own index.
  int blockThreads = 0;
  /// The launches before which threads of a block wait.
  std::vector<bool> waits;
};

/// Why a launch can be no part of a fused one, whatever the others are; empty
/// if it can.
std::string whyApart(const GraphOperation &launch);

/// True if the code of a launch counts on its blocks.
bool worksTogether(const GraphOperation &launch);

/// Threads of a row: those of one index of the first extent.
int64_t rowThreads(const LaunchDim &dim);

/// True if blocks of a launch work together, each on a row.
bool hasBlocksOfRows(const GraphOperation &launch);

/// Makes the code of several fused launches at a time, that `fuse` will ask
/// for. Errors come there.
void prepareCode(const std::vector<FusionPlan> &plans);

/// Launches of equal options, and extents if the plan has no blocks, as one.
/// Says why not if `kernel` is null.
FusedLaunch fuse(const FusionPlan &plan, std::string &whyNot);

} // namespace warp

#endif // WARP_LIB_RUNTIME_FUSEDKERNEL_H
