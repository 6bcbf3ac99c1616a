//===- LastAssignments.h - Loop values of one iteration ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_LASTASSIGNMENTS_H
#define WARP_TRANSFORMS_AUTODIFF_LASTASSIGNMENTS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// Computes what counted loops assign under a condition again after the loop, in
/// the iteration that assigned it last.
void computeLastAssignments(mlir::func::FuncOp function);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_LASTASSIGNMENTS_H
