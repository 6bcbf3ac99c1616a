//===- NonNegative.h - Indices that need no wrapping ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_NONNEGATIVE_H
#define WARP_LIB_ANALYSIS_NONNEGATIVE_H

#include "mlir/IR/Value.h"

namespace warp {

/// Whether an index can be told not to be negative, in a block if that helps.
bool isNonNegative(mlir::Value index, mlir::Block *where);

} // namespace warp

#endif // WARP_LIB_ANALYSIS_NONNEGATIVE_H
