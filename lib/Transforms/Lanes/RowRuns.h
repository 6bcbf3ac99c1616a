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

/// By how many elements the last index of an access grows from one iteration of
/// the `scf.for` around it to the next.
std::optional<int64_t> paceAlongRow(AccessOp access,
                                    const ThreadVariance &variance);

/// True if each lane loads the next, or the previous, element of a row of its
/// own in every iteration of the loop around, and no thread writes to the array
/// but for this element, later in the iteration.
bool isRowLoad(LoadComponentsOp load, const ThreadVariance &variance);

/// The same of a store, in a loop in which nothing else is at the array but a
/// load of the same element before it.
bool isRowStore(StoreComponentsOp store, const ThreadVariance &variance);

/// Iterations of a loop that are done together, so that lanes load or store as
/// many elements of their rows at once; 1 if there are no such accesses, or if
/// that is too much code.
int64_t iterationsInRun(mlir::scf::ForOp loop, const ThreadVariance &variance,
                        int64_t lanes);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ROWRUNS_H
