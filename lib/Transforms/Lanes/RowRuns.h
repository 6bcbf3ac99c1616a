//===- RowRuns.h - Elements that lanes take several of at once --*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ROWRUNS_H
#define WARP_LIB_TRANSFORMS_ROWRUNS_H

#include "Analysis/ThreadVariance.h"
#include "WarpDialect/LaneOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {

/// True if each lane loads the next element of a row of its own in every
/// iteration of the loop around, and no thread writes to the array.
bool isRowLoad(LoadComponentsOp load, const ThreadVariance &variance);

/// The same of a store, in a loop in which nothing else is at the array.
bool isRowStore(StoreComponentsOp store, const ThreadVariance &variance);

/// Iterations of a loop that are done together, so that lanes load or store as
/// many elements of their rows at once; 1 if there are no such accesses, or if
/// that is too much code.
int64_t iterationsInRun(mlir::scf::ForOp loop, const ThreadVariance &variance,
                        int64_t lanes);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ROWRUNS_H
