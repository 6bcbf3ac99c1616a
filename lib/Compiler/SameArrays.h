//===- SameArrays.h - Aliasing of kernel arguments --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_SAMEARRAYS_H
#define WARP_LIB_COMPILER_SAMEARRAYS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

#include <vector>

namespace warp {

/// Lets a kernel use one array in place of others that are the same memory.
///
/// same: for each array among the arguments, as `AutodiffOptions::active`
/// counts them, the number of the one to use.
mlir::LogicalResult joinSameArrays(mlir::func::FuncOp kernel,
                                   const std::vector<int> &same);

} // namespace warp

#endif // WARP_LIB_COMPILER_SAMEARRAYS_H
