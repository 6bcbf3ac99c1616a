//===- BlockSums.h - Exact sums of the threads of a block -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_BLOCKSUMS_H
#define WARP_LIB_TRANSFORMS_BLOCKSUMS_H

#include "SumFunctions.h"

namespace warp {

/// A window of digits for the thread, empty.
mlir::Value makeWindow(mlir::OpBuilder &b, mlir::Location loc, unsigned width);

/// Adds the windows of the threads of a block of whole warps to a sum. All of
/// them must come to the insertion point.
void addWindows(mlir::OpBuilder &b, mlir::Location loc, mlir::ModuleOp module,
                SumFunctions &functions, const SumPlace &to, mlir::Value window,
                unsigned width, int64_t blockDim);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_BLOCKSUMS_H
