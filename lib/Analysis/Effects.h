//===- Effects.h - Side effects of operations -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_EFFECTS_H
#define WARP_LIB_ANALYSIS_EFFECTS_H

#include "WarpDialect/WarpOps.h"

namespace warp {

/// True if an operation reads an array, and nothing else.
bool isPlainRead(mlir::Operation *op);

/// True if it adds to an element and returns nothing, so that such operations
/// may trade places.
bool isSum(mlir::Operation *op);

/// True if it is seen after the launch that an operation ran: it writes to an
/// array, prints or asserts. Calls and nested operations are not looked into.
bool isObservable(mlir::Operation *op);

/// True if it makes a saturated integer of a float: an intrinsic, of which MLIR
/// does not know that it only computes.
bool isConversion(mlir::Operation *op);

} // namespace warp

#endif // WARP_LIB_ANALYSIS_EFFECTS_H
