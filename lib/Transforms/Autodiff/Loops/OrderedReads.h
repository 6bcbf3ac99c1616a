//===- OrderedReads.h - Loads from elements written once --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_ORDEREDREADS_H
#define WARP_TRANSFORMS_AUTODIFF_ORDEREDREADS_H

#include "Autodiff/MemoryClasses.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// Loads in loops, each with a condition in the kernel: true if the element
/// has been written before and is not written again, false if it still has the
/// value from before the launch.
using OrderedReads = llvm::DenseMap<mlir::Operation *, mlir::Value>;

/// Finds loads that cannot be recovered otherwise and makes their conditions.
OrderedReads findOrderedReads(mlir::func::FuncOp kernel,
                              const MemoryClasses &memory);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_ORDEREDREADS_H
