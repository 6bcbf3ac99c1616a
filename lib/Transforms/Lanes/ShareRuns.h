//===- ShareRuns.h - Reconvergence in neighbour loops -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_SHARERUNS_H
#define WARP_LIB_TRANSFORMS_SHARERUNS_H

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {
class ThreadVariance;

/// Lets the lanes of loops through runs of a list come to its elements
/// together. True if there was such a loop; the variance is out of date then.
bool shareRuns(mlir::FunctionOpInterface kernel,
               const ThreadVariance &variance);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_SHARERUNS_H
