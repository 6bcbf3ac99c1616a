//===- GatherBuilder.h - Builder of gather kernels --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_GATHERBUILDER_H
#define WARP_TRANSFORMS_AUTODIFF_GATHERBUILDER_H

#include "NeighborSums.h"

#include <map>

namespace warp::autodiff {

using Offsets = llvm::SmallVector<int64_t, 3>;

/// Sums of several gradients by what lies between thread and element. The
/// number of the gradient comes with each.
using SumsByOffset =
    std::map<Offsets,
             llvm::SmallVector<std::pair<unsigned, mlir::Operation *>>>;

/// Adds a function in front of the adjoint that does what these sums of it do.
/// `rank` is the number of thread indices.
void buildGather(mlir::func::FuncOp adjoint,
                 llvm::ArrayRef<NeighborSums> gathers, const SumsByOffset &sums,
                 unsigned rank);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_GATHERBUILDER_H
