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

/// Why a launch can be no part of a fused one, whatever the others are; empty
/// if it can.
std::string whyApart(const GraphOperation &launch);

/// Makes the code of several fused launches at a time, that `fuse` will ask
/// for. Errors come there.
void prepareCode(
    const std::vector<std::vector<const GraphOperation *>> &groups);

/// Launches of equal extents and options as one. Says why not if `kernel` is
/// null.
FusedLaunch fuse(const std::vector<const GraphOperation *> &launches,
                 std::string &whyNot);

} // namespace warp

#endif // WARP_LIB_RUNTIME_FUSEDKERNEL_H
