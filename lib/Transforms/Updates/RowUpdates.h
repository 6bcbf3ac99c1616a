//===- RowUpdates.h - Sums along rows of threads on GPUs --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ROWUPDATES_H
#define WARP_LIB_TRANSFORMS_ROWUPDATES_H

#include "WarpDialect/WarpOps.h"

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// Makes atomic additions of the sums that loops add to gradients, each thread
/// along a row of its own.
void addAlongRows(mlir::FunctionOpInterface kernel, ThreadsOp threads);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ROWUPDATES_H
