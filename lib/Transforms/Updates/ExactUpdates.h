//===- ExactUpdates.h - Choose the sums that are exact ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_EXACTUPDATES_H
#define WARP_LIB_TRANSFORMS_EXACTUPDATES_H

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// In a deterministic launch: marks the updates of a kernel whose sums are made
/// exactly, and lists the arrays of those in its schedule.
void markExactUpdates(mlir::FunctionOpInterface kernel);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_EXACTUPDATES_H
