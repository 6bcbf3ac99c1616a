//===- UnrollUpdates.h - Short loops over sums ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_UNROLLUPDATES_H
#define WARP_LIB_TRANSFORMS_UNROLLUPDATES_H

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// Unrolls short loops of constant length that update an element per iteration,
/// the same for all threads, so that each has an address without a counter.
void unrollUpdates(mlir::FunctionOpInterface kernel);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_UNROLLUPDATES_H
