//===- RecordLoads.h - Replay that records loads of loops -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_RECORDLOADS_H
#define WARP_TRANSFORMS_AUTODIFF_RECORDLOADS_H

#include "MemoryLog.h"

namespace warp::autodiff {

/// Makes the functions that measure and fill the log, next to the kernel.
/// `updated` are the arrays, by leaf, that the kernel reads and writes;
/// `counts` are operations at its end whose operands say how many iterations
/// each site has had.
void recordLoads(mlir::func::FuncOp kernel, const MemoryLog &log,
                 const llvm::SmallDenseSet<unsigned> &updated,
                 llvm::ArrayRef<mlir::Operation *> counts);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_RECORDLOADS_H
