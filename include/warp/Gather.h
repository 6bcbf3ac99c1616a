//===- Gather.h - Adjoints of stencils without atomics ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A thread of a stencil reads its neighbourhood, so the same thread of the
// adjoint adds to it: the sums of an element come from many threads.
// `gatherSums` makes gathers of these scatters where it can, with two launches
// in place of one.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_GATHER_H
#define WARP_GATHER_H

#include "warp/Builder.h"
#include "warp/Export.h"

#include <cstdint>
#include <optional>
#include <vector>

namespace warp {

/// An adjoint as two kernels: first `sums`, then `rest`. Right for launches of
/// as many dimensions as `halo` has, with extents below 2^29, whose threads
/// access arrays within their bounds, and whose arrays do not share memory.
struct GatheredAdjoint {
  /// Its parameters are those of the adjoint and then the extents of the
  /// launch, integers of 32 bits.
  Module sums;
  /// By how much the extents of its launch are larger.
  std::vector<int> halo;
  /// The rest of the adjoint, if any; it has its parameters.
  std::optional<Module> rest;
  /// Additions in `rest` that are atomic.
  int64_t atomics = 0;
};

/// Nothing unless there is an atomic addition that can be saved.
WARP_API std::optional<GatheredAdjoint> gatherSums(const Module &adjoint);

} // namespace warp

#endif // WARP_GATHER_H
